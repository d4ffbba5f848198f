test_that("the classic calls return the spaces", {
  client <- test_client()
  id <- env_create(client, "CartPole-v0")
  withr::defer(env_close(client, id))
  expect_equal(env_action_space_info(client, id)[["name"]], "Discrete")
  expect_equal(env_action_space_info(client, id)[["n"]], 2)
  space <- env_observation_space_info(client, id)
  expect_equal(space$shape, 4)
  # The limits of CartPole's observations, as float32 has them.
  expect_equal(space$high, c(4.8, Inf, 0.41887903, Inf), tolerance = 1e-7)
  expect_identical(space$low, -space$high)
})

test_that("values that belong to a space are distinguished from those that do not", {
  env <- local_env()
  member <- function(value) env_action_space_contains(env$client, env$instance_id, value)
  expect_true(member(0))
  expect_true(member(1L))
  for (value in list(2, -1, 0.5, "a", NULL, NA, c(0, 1))) {
    expect_false(member(value))
    expect_false(space_contains(env$action_space, value))
  }
  observed <- function(value) env_observation_space_contains(env$client, env$instance_id, value)
  expect_true(observed(c(0, 1e30, 0, 0)))
  expect_true(observed(env$reset()))
  for (value in list(c(9, 0, 0, 0), 1:3, 0, "a", matrix(0, 1, 4))) expect_false(observed(value))
})

test_that("a Box of one number knows its members", {
  env <- local_env("Pendulum-v1")
  member <- function(value) env_action_space_contains(env$client, env$instance_id, value)
  expect_true(member(1.5))
  expect_false(member(2.5))
})
