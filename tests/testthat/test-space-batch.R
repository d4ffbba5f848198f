# Values of sub-environments, as Gymnasium batches them: the sub-environment comes first.

sub_envs_of_spaces <- function() {
  list(
    discrete = new_space(list(name = "Discrete", n = 3L, start = 5L, dtype = "int64")),
    box = new_space(describe_box(c(-1, 0), c(1, 9), dtype = "float32")),
    picture = new_space(describe_box(rep(0, 6), rep(255, 6), c(2, 3), "uint8")),
    scalar = new_space(describe_box(-1, 1, integer())),
    column = new_space(describe_box(-2, 2)),
    dials = new_space(list(name = "MultiDiscrete", shape = list(2L), dtype = "int64",
                           nvec = list(2L, 3L), start = list(0L, 4L))),
    bits = new_space(list(name = "MultiBinary", shape = list(2L), dtype = "int8")),
    text = new_space(list(name = "Text", min_length = 1L, max_length = 3L, characters = "abc"))
  )
}

tensor_for <- function(dtype, shape, x) {
  list(dtype = dtype, shape = shape, bytes = tensor_types[[dtype]]$write(x))
}

tuple_of <- function(...) new_space(list(name = "Tuple", spaces = list(...)))

test_that("the space of the sub-environments has the sub-environment as its first dimension", {
  lines <- c(
    discrete = "<MultiDiscrete [3, 3, 3, 3] from [5, 5, 5, 5]>", box = "<Box float32 [4, 2]>",
    picture = "<Box uint8 [4, 2, 3]>", scalar = "<Box float64 [4]>",
    column = "<Box float64 [4, 1]>", dials = "<MultiDiscrete of shape [4, 2]>",
    bits = "<MultiBinary [4, 2]>"
  )
  spaces <- sub_envs_of_spaces()
  for (kind in names(lines)) {
    expect_identical(format(batch_space(spaces[[kind]], 4)), lines[[kind]])
  }
  expect_match(format(batch_space(spaces$text, 4)), "^<Tuple \\(Text of 1 to 3 characters, Text")
})

test_that("each number of the sub-environments has its bounds", {
  spaces <- sub_envs_of_spaces()
  box <- spread_bounds(batch_space(spaces$box, 3))
  expect_identical(box$low, c(-1, 0, -1, 0, -1, 0))
  expect_identical(box$high, c(1, 9, 1, 9, 1, 9))
  expect_identical(box$shape, c(3L, 2L))
  discrete <- spread_bounds(batch_space(spaces$discrete, 3))
  expect_identical(discrete$nvec, c(3L, 3L, 3L))
  expect_identical(discrete$start, c(5L, 5L, 5L))
  expect_null(spread_bounds(batch_space(spaces$column, 3))$column)
  nested <- spread_bounds(batch_space(new_space(describe_dict(a = describe_box(0, 1))), 2))
  expect_identical(nested$spaces$a$low, c(0, 0))
})

test_that("a value for each sub-environment belongs, drawn from each kind of space", {
  withr::local_seed(1)
  for (space in sub_envs_of_spaces()) {
    for (n in c(1L, 3L)) {
      batch <- spread_bounds(batch_space(space, n))
      values <- space_sample(batch)
      expect_true(space_contains(batch, values))
      expect_no_error(check_batch(space, batch_space(space, n), values, n, NULL))
      for (i in seq_len(n)) expect_true(space_contains(space, batch_value(space, values, i)))
    }
  }
  expect_type(space_sample(batch_space(sub_envs_of_spaces()$text, 3)), "character")
})

test_that("values of sub-environments of 80 random spaces belong, and come back through tensors", {
  skip_unless_all()
  withr::local_seed(6)
  tried <- 0L
  while (tried < 80L) {
    space <- new_space(random_description())
    n <- sample(1:4, 1)
    batch <- batch_space(space, n)
    singles <- lapply(seq_len(n), function(i) space_sample(space))
    values <- batch_of(space, singles)
    expect_no_error(check_batch(space, batch, values, n, NULL))
    # An empty Tuple has no sub-environments.
    if (!length(unlist(lapply(singles, unlist)))) next
    back <- from_json(write_batch(space, values, n))
    expect_identical(batch_of(space, lapply(back, decode_value, space = space)), values)
    if (!has_tensors(space)) next
    parts <- to_tensors(batch, values, "action", NULL)
    texts <- Filter(is.character, parts)
    file <- read_tensors(write_tensors(Filter(is.list, parts), c(request = "{}")))
    back <- from_tensors(batch, "action", list(tensors = file$tensors, texts = texts))
    expect_identical(back, values, info = format(space))
    tried <- tried + 1L
  }
})

refused <- function(space, values, n, ...) {
  error <- expect_error(
    check_batch(space, batch_space(space, n), values, n, NULL), class = "gym_error_space"
  )
  for (part in c(...)) expect_match(conditionMessage(error), part, fixed = TRUE)
  error
}

test_that("the error for a wrong number of sub-environments has both numbers", {
  spaces <- sub_envs_of_spaces()
  wrong <- list(
    discrete = 5:7, box = matrix(0, 3, 2), picture = array(0, c(3, 2, 3)), scalar = c(0, 0, 0),
    column = c(0, 0, 0), dials = matrix(4, 3, 2), bits = matrix(0, 3, 2), text = c("a", "b", "c")
  )
  for (kind in names(wrong)) {
    refused(spaces[[kind]], wrong[[kind]], 4L, "each of the sub-environments", "4, not 3")
  }
  pair <- tuple_of(describe_box(0, 1), list(name = "Discrete", n = 2L))
  refused(pair, list(c(0, 0), c(1, 1)), 3L, "3, not 2")
  refused(new_space(describe_dict(a = describe_box(0, 1))), list(a = 0), 2L, "2, not 1")
  refused(new_space(list(name = "Sequence", space = describe_box(0, 1))), list(), 2L, "2, not 0")
})

test_that("the sub-environment whose value does not fit is named, counted from 1, with its value", {
  spaces <- sub_envs_of_spaces()
  error <- refused(spaces$discrete, c(5, 6, NA, 7), 4L, "Sub-environment 3: ", "value NA ",
                   "<Discrete 3 from 5>")
  expect_identical(error$sub_env, 3L)
  refused(spaces$discrete, c(5, 6.5), 2L, "Sub-environment 2: ", "6.5")
  refused(spaces$discrete, c(5, Inf), 2L, "Sub-environment 2: ")
  refused(spaces$discrete, c("left", "right"), 2L, "Sub-environment 1: ", "\"left\"")
  refused(spaces$box, rbind(c(0, 1), c(0, NA)), 2L, "Sub-environment 2: ", "`$[1]`",
          "<Box float32 [2]>")
  refused(spaces$dials, rbind(c(0, 4), c(0.5, 4)), 2L, "Sub-environment 2: ", "not whole")
  refused(spaces$text, c("a", NA), 2L, "Sub-environment 2: ", "one string")
  both <- new_space(describe_dict(x = describe_box(c(0, 0), c(1, 1)),
                                  y = list(name = "Discrete", n = 2L)))
  refused(both, list(x = matrix(0, 3, 2), y = c(0, 1, NA)), 3L, "Sub-environment 3: ", "`$y`")
  many <- new_space(list(name = "Sequence", space = list(name = "Discrete", n = 2L)))
  refused(many, list(list(0), list(1, "a")), 2L, "Sub-environment 2: ", "`$[1]`")
})

test_that("what has not the form of sub-environments is refused", {
  spaces <- sub_envs_of_spaces()
  refused(spaces$discrete, data.frame(a = 5:6), 2L, "MultiDiscrete")
  refused(spaces$discrete, matrix(5, 2, 1), 2L, "length 2")
  refused(spaces$discrete, list(5, 6), 2L, "numeric")
  refused(spaces$box, matrix(0, 2, 3), 2L, "2 x 2")
  refused(spaces$box, c(0, 0), 2L, "2 x 2")
  refused(spaces$box, data.frame(a = 1:2, b = 1:2), 2L, "numeric")
  both <- new_space(describe_dict(x = describe_box(0, 1), y = describe_box(0, 1)))
  refused(both, list(x = c(0, 0)), 2L, "\"y\"")
  refused(both, list(x = c(0, 0), y = 0), 2L, "`$y`")
})

test_that("logicals are actions of Discrete sub-environments, a vector those of one number", {
  spaces <- sub_envs_of_spaces()
  moves <- discrete_space(2L)
  expect_no_error(check_batch(moves, batch_space(moves, 2), c(TRUE, FALSE), 2L, NULL))
  expect_identical(write_batch(moves, c(TRUE, FALSE), 2L), "[1,0]")
  parts <- to_tensors(batch_space(moves, 2), c(TRUE, FALSE), "action", NULL)
  expect_identical(read_int32(parts$action$bytes, 2L), 1:0)
  as_vector <- to_tensors(batch_space(spaces$column, 2), c(1, 2), "action", NULL)
  as_column <- to_tensors(batch_space(spaces$column, 2), matrix(c(1, 2)), "action", NULL)
  expect_identical(as_vector, as_column)
  expect_no_error(check_batch(spaces$column, batch_space(spaces$column, 2), 1:2, 2L, NULL))
})

test_that("actions beyond R's integers travel as 64 bits", {
  wide <- discrete_space(2L, 2^40)
  values <- 2^40 + c(0, 1)
  parts <- to_tensors(batch_space(wide, 2), values, "action", NULL)
  expect_identical(parts$action$dtype, "I64")
  expect_identical(read_int64(TRUE)(parts$action$bytes, 2L), values)
  narrow <- to_tensors(batch_space(discrete_space(2L), 2), 0:1, "action", NULL)
  expect_identical(narrow$action$dtype, "I32")
})

test_that("thousands of sub-environments are read row by row", {
  n <- 5000L
  values <- matrix(seq_len(4 * n), n, byrow = TRUE)
  space <- new_space(describe_box(rep(0, 4), rep(1, 4), dtype = "float32"))
  parts <- to_tensors(batch_space(space, n), values, "observation", NULL)
  more <- list(
    reward = tensor_for("F32", n, rep(1, n)), truncated = tensor_for("BOOL", n, logical(n))
  )
  file <- read_tensors(write_tensors(c(parts, more), c(info = "{}")))
  expect_identical(file$tensors$observation, values + 0)
  expect_identical(file$tensors$reward, rep(1, n))
  expect_identical(file$tensors$truncated, logical(n))
})

spaces <- list(
  discrete = list(name = "Discrete", n = 5L, start = 0L, dtype = "int64"),
  flat = describe_box(c(-1, -2, -3), c(1, 2, 3)),
  scalar = list(name = "Box", shape = list(), dtype = "float64", low = list(0), high = list(1)),
  array = list(name = "Box", shape = list(2L, 3L), dtype = "float64", low = as.list(rep(-9, 6)),
               high = as.list(1:6)),
  binary = list(name = "MultiBinary", shape = list(3L), dtype = "int8"),
  text = list(name = "Text", min_length = 1L, max_length = 3L, characters = "ab"),
  sequence = list(name = "Sequence", space = describe_box(0, 1), stack = FALSE)
)
spaces$tuple <- list(name = "Tuple", spaces = unname(spaces))
spaces$dict <- do.call(describe_dict, spaces)

test_that("what was put together comes apart again, by sub-environment and in any choice", {
  for (name in names(spaces)) {
    space <- new_space(spaces[[name]])
    set.seed(1)
    values <- replicate(4, space_sample(space), simplify = FALSE)
    batch <- batch_of(space, values)
    for (i in 1:4) {
      expect_identical(batch_value(space, batch, i), values[[i]], info = name)
    }
    chosen <- c(4L, 1L, 4L)
    expect_identical(batch_rows(space, batch, chosen), batch_of(space, values[chosen]),
                     info = name)
    one <- batch_of(space, values[1])
    expect_identical(batch_value(space, one, 1L), values[[1]], info = name)
    others <- batch_rows(space, batch, 2:4)
    expect_identical(bind_batches(space, list(one, others)), batch, info = name)
  }
})

test_that("values for several sub-environments are drawn as single ones are, one after the other", {
  for (name in c("discrete", "flat", "array", "binary", "text", "sequence")) {
    space <- new_space(spaces[[name]])
    set.seed(1)
    values <- replicate(4, space_sample(space), simplify = FALSE)
    set.seed(1)
    expect_equal(sample_batch(space, 4L), batch_of(space, values), info = name)
  }
})

test_that("values are put in the place of some of a batch, whatever the space", {
  skip_unless_all()
  withr::local_seed(8)
  for (number in 1:100) {
    space <- new_space(random_description())
    values <- replicate(7, space_sample(space), simplify = FALSE)
    expected <- values[c(1, 6, 3, 7, 5)]
    replaced <- replace_rows(
      space, batch_of(space, values[1:5]), 5L, c(2L, 4L), batch_of(space, values[6:7])
    )
    each <- function(batch) lapply(1:5, batch_value, space = space, batch = batch)
    expect_equal(each(replaced), each(batch_of(space, expected)), info = format(space))
  }
})
