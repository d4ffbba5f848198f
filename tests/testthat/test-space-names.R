test_that("a value gets the names of its space, and of the parts of its space", {
  box <- box_space(c(-1, -1), c(1, 1))
  expect_null(naming(box))
  box$names <- c("x", "y")
  expect_identical(naming(box)(c(0, 1)), c(x = 0, y = 1))
  batch <- matrix(1:6, ncol = 2)
  expect_identical(naming(box, batch = TRUE)(batch), cbind(x = 1:3, y = 4:6))
  number <- discrete_space()
  number$names <- "position"
  expect_null(naming(number))
  tuple <- structure(list(name = "Tuple", spaces = list(box, number)),
                     class = c("gym_space_tuple", "gym_space"))
  expect_identical(naming(tuple)(list(c(0, 1), 1L)), list(c(x = 0, y = 1), 1L))
  tuple$names <- c("place", "count")
  expect_identical(naming(tuple)(list(c(0, 1), 1L)), list(place = c(x = 0, y = 1), count = 1L))
  dict <- new_space(describe_dict(a = describe_box(0, 1), b = describe_box(0, 1)))
  expect_null(naming(dict))
  dict$spaces$b <- box
  expect_identical(naming(dict, batch = TRUE)(list(a = 1:3, b = batch)),
                   list(a = 1:3, b = cbind(x = 1:3, y = 4:6)))
})

test_that("batches that are put together and taken apart keep their names", {
  box <- box_space(c(-1, -1), c(1, 1))
  box$names <- c("x", "y")
  values <- list(c(x = 0, y = 1), c(x = 0.5, y = 0.25), c(x = 1, y = 0))
  batch <- batch_of(box, values)
  expect_identical(colnames(batch), c("x", "y"))
  expect_identical(lapply(1:3, batch_value, space = box, batch = batch), values)
  both <- bind_batches(box, list(batch_rows(box, batch, 1L), batch_rows(box, batch, 2:3)))
  expect_identical(both, batch)
  tuple <- new_space(list(name = "Tuple", spaces = list(
    list(name = "Discrete", n = 3L), list(name = "Discrete", n = 3L)
  )))
  hands <- batch_of(tuple, list(list(sum = 1L, card = 2L), list(sum = 0L, card = 1L)))
  expect_identical(hands, list(sum = 1:0, card = 2:1))
  expect_identical(batch_value(tuple, hands, 2L), list(sum = 0L, card = 1L))
  expect_identical(bind_batches(tuple, list(hands, batch_rows(tuple, hands, 2:1))),
                   list(sum = c(1:0, 0:1), card = c(2:1, 1:2)))
})
