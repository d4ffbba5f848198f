test_that("observations have the names of Gymnasium's documentation, in every version", {
  names_of <- function(env_id, n) observation_names(env_id, paste0("obs_", seq_len(n)))
  cart_pole <- c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")
  expect_identical(names_of("CartPole-v0", 4), cart_pole)
  expect_identical(names_of("CartPole-v1", 4), cart_pole)
  expect_identical(names_of("MountainCarContinuous-v0", 2), c("position", "velocity"))
  expect_identical(names_of("Blackjack-v1", 3), c("player_sum", "dealer_card", "usable_ace"))
  expect_identical(names_of("LunarLanderContinuous-v3", 8), names_of("LunarLander-v3", 8))
})

test_that("unknown environments and changed observations keep the names of their columns", {
  columns <- paste0("obs_", 1:5)
  expect_identical(observation_names("Unknown-v0", columns[1:2]), columns[1:2])
  expect_identical(observation_names("CartPole-v1", columns), columns)
  expect_identical(observation_names(NULL, "obs_1"), "obs_1")
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
