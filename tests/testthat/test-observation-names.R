test_that("observations have the names of Gymnasium's documentation, in every version", {
  cart_pole <- c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")
  expect_identical(observation_names("CartPole-v0", 4), cart_pole)
  expect_identical(observation_names("CartPole-v1", 4), cart_pole)
  expect_identical(observation_names("MountainCarContinuous-v0", 2), c("position", "velocity"))
})

test_that("unknown environments and changed observations are numbered", {
  expect_identical(observation_names("Unknown-v0", 2), c("obs_1", "obs_2"))
  expect_identical(observation_names("CartPole-v1", 5), paste0("obs_", 1:5))
  expect_identical(observation_names(NULL, 1), "obs_1")
})
