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
