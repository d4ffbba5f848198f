box <- function(shape, dtype = "float32", low = -1, high = 1) {
  size <- prod(unlist(shape))
  new_space(list(
    name = "Box", shape = as.list(shape), dtype = dtype,
    low = as.list(rep_len(low, size)), high = as.list(rep_len(high, size))
  ))
}
discrete <- function(n, start = 0L) new_space(list(name = "Discrete", n = n, start = start))

test_that("a space prints in one line", {
  expect_output(print(box(4)), "<Box float32 [4]>", fixed = TRUE)
  expect_output(print(box(c(2, 3), "uint8")), "<Box uint8 [2, 3]>", fixed = TRUE)
  expect_output(print(discrete(2)), "<Discrete 2>", fixed = TRUE)
  expect_output(print(discrete(3, -1L)), "<Discrete 3 from -1>", fixed = TRUE)
})

test_that("the classic elements of a space are there", {
  expect_equal(discrete(2)[["n"]], 2)
  space <- box(4)
  expect_equal(space[["name"]], "Box")
  expect_equal(space[["shape"]][[1]], 4)
  expect_length(space[["low"]], 4)
})

test_that("infinite bounds arrive as infinite", {
  space <- box(2, low = -1e100, high = 1e100)
  expect_identical(space$low, c(-Inf, -Inf))
  expect_identical(space$high, c(Inf, Inf))
})

test_that("an unknown kind of space is an error that names it", {
  expect_error(new_space(list(name = "Riddle")), "Riddle", class = "gym_error_space")
})

test_that("a discrete action is one whole number", {
  space <- discrete(2)
  expect_equal(encode_value(space, 1, NULL), "1")
  expect_equal(encode_value(space, 1L, NULL), "1")
  expect_equal(encode_value(space, TRUE, NULL), "1")
  for (bad in list(0.5, NA, NA_real_, NULL, "1", c(0, 1), Inf, NaN, list(1), integer())) {
    expect_error(encode_value(space, bad, NULL), "<Discrete 2>", class = "gym_error_space")
  }
})

test_that("the error for an action shows the value", {
  expect_error(encode_value(discrete(2), "left", NULL), "\"left\"", class = "gym_error_space")
  expect_error(encode_value(box(2), c(0.5, 1, 7), NULL), "c\\(0.5, 1, 7\\)",
               class = "gym_error_space")
})

test_that("TRUE and FALSE are 1 and 0 in a MultiDiscrete, as in a Discrete", {
  space <- new_space(list(
    name = "MultiDiscrete", dtype = "int64", shape = list(2L), nvec = list(2L, 2L),
    start = list(0L, 0L)
  ))
  expect_equal(encode_value(space, c(TRUE, FALSE), NULL), "[1,0]")
  expect_identical(
    to_tensors(space, c(TRUE, FALSE), "action", NULL), to_tensors(space, 1:0, "action", NULL)
  )
  expect_true(space_contains(space, c(TRUE, FALSE)))
  expect_error(encode_value(space, c(TRUE, NA), NULL), class = "gym_error_space")
})

test_that("an action of a Box keeps its digits and its shape", {
  expect_equal(encode_value(box(1), 0.1, NULL), "[0.10000000000000001]")
  expect_equal(encode_value(box(integer()), 0.5, NULL), "0.5")
  expect_equal(encode_value(box(3), 1:3, NULL), "[1,2,3]")
  expect_equal(
    encode_value(box(c(2, 3)), matrix(1:6, 2, byrow = TRUE), NULL), "[[1,2,3],[4,5,6]]"
  )
  cube <- aperm(array(1:24, c(4, 3, 2)))
  expect_match(encode_value(box(c(2, 3, 4)), cube, NULL), "^\\[\\[\\[1,2,3,4\\],\\[5,6")
})

test_that("an action of a Box with the wrong shape or type is refused", {
  for (bad in list(1, 1:3, "a", NA_real_, c(1, NA), NULL, list(1, 2), TRUE, matrix(1:2, 1))) {
    expect_error(encode_value(box(2), bad, NULL), "<Box float32 \\[2\\]>",
                 class = "gym_error_space")
  }
  expect_error(encode_value(box(c(2, 3)), 1:6, NULL), "2 x 3", class = "gym_error_space")
})

test_that("integers are integer where they fit, double up to 2^53", {
  space <- box(2, "int64")
  expect_identical(decode_value(space, from_json("[1, -2147483647]")), c(1L, -2147483647L))
  expect_identical(decode_value(space, from_json("[1, -2147483648]")), c(1, -2147483648))
  expect_identical(decode_value(space, from_json("[1, 9007199254740991]")), c(1, 2^53 - 1))
})

test_that("integers beyond 2^53 - 1 are an error, never rounded", {
  for (digits in c("9007199254740992", "9007199254740993", "-9223372036854775808")) {
    expect_error(decode_value(box(2, "int64"), from_json(paste0("[1, ", digits, "]"))),
                 "beyond 2^53 - 1", fixed = TRUE, class = "gym_error_space")
  }
})

test_that("of an unbounded int64 only numbers that R can represent are drawn", {
  space <- space_box(-2^63, 2^63, 20, "int64")
  withr::local_seed(1)
  drawn <- space_sample(space)
  expect_true(all(abs(drawn) < 2^53 & drawn == trunc(drawn)))
  expect_gt(max(abs(drawn)), 2^51)
})

test_that("drawing a value stays inside the bounds and follows R's generator", {
  skip_unless_all()
  spaces <- list(
    discrete(3, -1L), box(3), box(c(2, 3), "uint8", 0, 255), box(2, low = 5, high = 1e100),
    box(2, low = -1e100, high = -5), box(2, low = -1e100, high = 1e100)
  )
  for (space in spaces) {
    set.seed(1)
    first <- space_sample(space)
    for (i in 1:50) {
      value <- space_sample(space)
      if (space$name == "Box") {
        expect_true(all(row_major(value) >= space$low & row_major(value) <= space$high))
      } else {
        expect_true(value %in% -1:1)
      }
    }
    set.seed(1)
    expect_identical(space_sample(space), first)
  }
  expect_equal(dim(space_sample(box(c(2, 3)))), c(2, 3))
})

test_that("a Box of integers draws both its bounds", {
  set.seed(1)
  drawn <- replicate(200, space_sample(box(1, "int8", 0, 1)))
  expect_setequal(drawn, 0:1)
})

test_that("values of every sort arrive from a real server as Python had them", {
  server <- odd_server()
  expect_identical(
    make_odd("Image", server)$reset(),
    aperm(array(0:23, c(4, 3, 2)))
  )
  expect_identical(make_odd("NotFinite", server)$reset(), c(NaN, Inf, -Inf, 1 / 3))
  expect_identical(make_odd("MiddlingIntegers", server)$reset(), c(-2^31, 2^31, 2^53 - 1))
  lopsided <- make_odd("Lopsided", server)$observation_space
  expect_identical(lopsided$low, c(-Inf, 0, -1))
  expect_identical(lopsided$high, c(Inf, Inf, 1))
  shifted <- make_odd("Shifted", server)
  expect_equal(shifted$action_space$start, 5)
  expect_true(shifted$reset() %in% -1:1)
  expect_error(shifted$step(1), "Discrete", class = "gym_error_space")
})

test_that("integers of a real server that R cannot hold are errors, not NA", {
  skip_unless_all()
  server <- odd_server()
  for (name in c("LargeIntegers", "SmallestInteger", "LargestNatural")) {
    expect_error(make_odd(name, server)$reset(), "beyond 2^53 - 1", fixed = TRUE,
                 class = "gym_error_space")
  }
})

test_that("an action comes back from a real server as it was sent", {
  env <- make_odd("Echo", odd_server())
  env$reset()
  values <- matrix(c(1 / 3, -1e300, 5e-324, 0, pi, -0.1), 2)
  expect_identical(env$step(values)$observation, values)
  infinite <- matrix(c(Inf, -Inf, 1:4), 2)
  expect_identical(env$step(infinite)$observation, infinite)
})

test_that("a bare number is an action of a Box of one number", {
  skip_unless_all()
  env <- make_odd("OneNumber", odd_server())
  env$reset()
  expect_equal(env$step(0.5)$reward, 1)
  expect_false(space_contains(env$action_space, 2))
  expect_equal(env$step(2)$reward, 1)
  expect_error(env$step(NaN), class = "gym_error_space")
})

test_that("a space that is not known is refused at creation and named", {
  skip_unless_all()
  expect_error(make_odd("Riddle", odd_server()), "Riddle", class = "gym_error_http_400")
})

nested <- function() {
  new_space(describe_dict(
    position = describe_box(c(-1, -1, -1), c(1, 1, 1)),
    "a/b" = list(name = "Tuple", spaces = list(
      list(name = "Discrete", n = 3L, start = 0L),
      list(name = "Text", min_length = 1L, max_length = 3L, characters = "abc")
    )),
    bits = list(name = "MultiBinary", shape = list(2L), dtype = "int8"),
    items = list(name = "Sequence", space = list(name = "Discrete", n = 2L), stack = FALSE),
    graph = list(
      name = "Graph", node_space = describe_box(c(0, 0), c(1, 1)),
      edge_space = list(name = "Discrete", n = 3L)
    ),
    one = list(name = "OneOf", spaces = list(
      list(name = "Discrete", n = 2L), list(name = "MultiDiscrete", shape = list(2L),
                                            dtype = "int64", nvec = list(2L, 3L))
    ))
  ))
}

member <- function() {
  list(
    position = c(0, 0, 0), "a/b" = list(1, "ab"), bits = c(0, 1), items = list(0, 1),
    graph = list(nodes = matrix(0.5, 2, 2), edges = 1, edge_links = matrix(0:1, 1)),
    one = list(1, c(1, 2))
  )
}

test_that("nested spaces print in one line, shortened when they are long", {
  space <- nested()
  expect_output(print(space), "^<Dict \\(position: Box float64 \\[3\\], a/b: Tuple .*\\.\\.\\.>$")
  lines <- c(
    "a/b" = "<Tuple (Discrete 3, Text of 1 to 3 characters)>", bits = "<MultiBinary [2]>",
    items = "<Sequence of Discrete 2>",
    graph = "<Graph of nodes Box float64 [2], edges Discrete 3>",
    one = "<OneOf (Discrete 2, MultiDiscrete [2, 3])>"
  )
  for (part in names(lines)) expect_identical(format(space$spaces[[part]]), lines[[part]])
})

test_that("a value that does not fit is refused with its place, the space there, and itself", {
  skip_unless_all()
  space <- nested()
  expect_true(space_contains(space, member()))
  refused <- function(change, place, part) {
    value <- change(member())
    expect_false(space_contains(space, value))
    error <- expect_error(check_value(space, value, "", NULL, bounds = TRUE),
                          class = "gym_error_space")
    expect_match(conditionMessage(error), paste0("`", place, "`"), fixed = TRUE)
    expect_match(conditionMessage(error), part, fixed = TRUE)
  }
  with <- function(expr) {
    expr <- substitute(expr)
    function(value) {
      eval(expr)
      value
    }
  }
  refused(with(value$position[3] <- 2), "$position[2]", "<Box float64 [3]>")
  refused(with(value$position[2] <- NA), "$position[1]", "<Box float64 [3]>")
  refused(with(value$position <- 1:2), "$position", "1:2")
  refused(with(value$`a/b`[[1]] <- 0.5), "$`a/b`[0]", "<Discrete 3>")
  refused(with(value$`a/b`[[2]] <- "abx"), "$`a/b`[1]", "abx")
  refused(with(value$`a/b`[[2]] <- ""), "$`a/b`[1]", "0 characters")
  refused(with(value$bits[2] <- 2), "$bits[1]", "<MultiBinary [2]>")
  refused(with(value$items[[2]] <- 7), "$items[1]", "7")
  refused(with(value$graph$nodes[2, 1] <- 9), "$graph$nodes[1][0]", "Box float64 [2, 2]")
  refused(with(value$graph$edge_links[1, 2] <- 5L), "$graph$edge_links[0][1]", "Box")
  refused(with(value$one[[1]] <- 2), "$one[0]", "<OneOf")
  refused(with(value$one[[2]][2] <- 3), "$one[1][1]", "<MultiDiscrete [2, 3]>")
})

test_that("keys that are missing or strange are named", {
  space <- nested()
  expect_error(check_value(space, member()[-1], "", NULL), "no element named \"position\"",
               class = "gym_error_space")
  expect_error(check_value(space, c(member(), extra = 1), "", NULL), "\"extra\"",
               class = "gym_error_space")
  expect_error(check_value(space, unname(member()), "", NULL), "names", class = "gym_error_space")
  # The order of the names does not matter.
  expect_identical(encode_value(space, rev(member()), NULL), encode_value(space, member(), NULL))
})

test_that("a value outside of a nested space is named by a real server, too", {
  skip_unless_all()
  env <- make_odd("Nested", odd_server())
  env$reset()
  good <- list(position = c(0, 0, 0), "a.b" = 1)
  expect_identical(env$step(good)$reward, 1)
  expect_error(env$step(list(position = c(0, 0, Inf), "a.b" = 1)), "$position[2]", fixed = TRUE,
               class = "gym_error_space")
  expect_error(env$step(list(position = c(0, 0, NA), "a.b" = 1)), "$position[2]", fixed = TRUE,
               class = "gym_error_space")
})

test_that("a Box of dtype bool is logical", {
  space <- new_space(describe_box(c(0, 0), c(1, 1), dtype = "bool"))
  expect_identical(decode_value(space, from_json("[true, false]")), c(TRUE, FALSE))
  expect_identical(encode_value(space, c(TRUE, FALSE), NULL), "[true,false]")
  expect_type(space_sample(space), "logical")
})

test_that("a float32 is looked at as Python will have it", {
  high <- 0.41887903213500977
  space <- new_space(describe_box(-high, high, dtype = "float32"))
  expect_true(space_contains(space, 0.418879032135))
  expect_false(space_contains(space, 0.4188791))
})

test_that("a space draws and checks values by Gymnasium's names, too", {
  space <- space_box(c(a = 0, b = 1), 2)
  expect_identical(with_generator(new_generator(1), space$sample()),
                   with_generator(new_generator(1), space_sample(space)))
  expect_true(space$contains(c(0, 1)))
  expect_false(space$contains(c(0, 0)))
  expect_null(space$nothing)
})
