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

# Columns of tables -----------------------------------------------------------------------

test_that("a column has the name of its number, or counts", {
  columns <- function(space, ...) names(observation_columns(space, batch_of(space, list(...))))
  box <- box_space(c(-1, -1), c(1, 1))
  expect_identical(columns(box, c(0, 1), c(1, 0)), c("obs_1", "obs_2"))
  expect_identical(columns(box_space(-1, 1), 0), "obs_1")
  expect_identical(columns(discrete_space(), 0L), "obs_1")
  box$names <- c("position", "velocity")
  expect_identical(columns(box, c(0, 1), c(1, 0)), box$names)
  tuple <- new_space(list(name = "Tuple", spaces = list(
    list(name = "Discrete", n = 3L), describe_box(c(0, 0), c(1, 1))
  )))
  expect_identical(columns(tuple, list(1L, c(0, 1))), c("obs_1", "obs_2_1", "obs_2_2"))
  tuple$names <- c("sum", "card")
  expect_identical(columns(tuple, list(1L, c(0, 1))), c("sum", "card_1", "card_2"))
  dict <- new_space(describe_dict(a = describe_box(c(0, 0), c(1, 1))))
  dict$spaces$a$names <- c("x", "y")
  expect_identical(columns(dict, list(a = c(0, 1))), c("obs_a_x", "obs_a_y"))
})

test_that("a column of an observation is not taken for another column of the steps", {
  box <- box_space(rep(-1, 5), rep(1, 5))
  box$names <- c("step", "action", "action_2", "next_card", "actions")
  values <- batch_of(box, list(1:5 / 10))
  expect_identical(
    names(observation_columns(box, values)),
    c("obs_step", "obs_action", "obs_action_2", "obs_next_card", "actions")
  )
})

test_that("columns are bare vectors, also of a single observation with names", {
  box <- box_space(c(-1, -1), c(1, 1))
  box$names <- c("position", "velocity")
  one <- matrix(c(0.5, 1), 1, dimnames = list(NULL, box$names))
  expect_identical(observation_columns(box, one), list(position = 0.5, velocity = 1))
})

test_that("parts of nested values have columns of their own", {
  space <- new_space(describe_dict(
    a = describe_box(c(-1, -1), c(1, 1)), "b.c" = list(name = "Discrete", n = 3L),
    t = list(name = "Tuple", spaces = list(
      list(name = "Text", min_length = 0L, max_length = 9L, characters = "ab"),
      list(name = "MultiBinary", shape = list(1L), dtype = "int8")
    )),
    s = list(name = "Sequence", space = list(name = "Discrete", n = 3L), stack = FALSE)
  ))
  value <- function(i) {
    list(a = c(i, i + 0.5), b.c = i, t = list(letters[i], 1L), s = as.list(seq_len(i)))
  }
  columns <- value_columns(space, batch_of(space, lapply(1:2, value)), "obs")
  expect_named(columns, c("obs_a_1", "obs_a_2", "obs_b.c", "obs_t_1", "obs_t_2", "obs_s"))
  expect_identical(columns$obs_a_2, c(1.5, 2.5))
  expect_identical(columns$obs_t_1, c("a", "b"))
  table <- data.frame(columns)
  expect_identical(dim(table), c(2L, 6L))
  expect_identical(table$obs_s[[2]], list(1L, 2L))
})
