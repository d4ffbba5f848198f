test_that("the registry is a data frame of what can be made", {
  registry <- env_registry(test_client())
  expect_identical(
    vapply(registry, typeof, ""),
    c(id = "character", max_episode_steps = "integer", reward_threshold = "double",
      vectorised = "logical", extra = "character", available = "logical", reason = "character")
  )
  row <- registry[registry$id == "CartPole-v1", ]
  expect_identical(row$max_episode_steps, 500L)
  expect_identical(row$reward_threshold, 475)
  expect_true(row$available)
  expect_identical(row$extra, NA_character_)
  expect_identical(registry$extra[registry$id == "LunarLander-v3"], "box2d")
  expect_identical(registry$extra[registry$id == "FrozenLake-v1"], NA_character_)
  expect_identical(is.na(registry$reason), registry$available)
  expect_match(registry$reason[registry$id == "Ant-v2"], "no longer part of Gymnasium")
  expect_false(anyDuplicated(registry$id) > 0)
})

test_that("searching finds parts of ids in any case, and near misses", {
  client <- test_client()
  expect_true(all(grepl("cartpole", env_registry(client, "cartpole")$id, ignore.case = TRUE)))
  expect_true("FrozenLake-v1" %in% env_registry(client, "FrozenLaek")$id)
  expect_identical(names(env_registry(client, "zzzzzzzzzz")), names(env_registry(client, "Taxi")))
  expect_error(env_registry(client, 3), "search", class = "gym_error_argument")
})
