test_that("labels have the documented units, and unknown names stay as they are", {
  cart_pole <- observation_parts$CartPole
  expect_identical(
    observation_labels("CartPole-v0", cart_pole),
    c("cart position (m)", "cart velocity (m/s)", "pole angle (rad)",
      "pole angular velocity (rad/s)")
  )
  expect_identical(observation_labels("CartPole-v1", c("reward", "obs_1")), c("reward", "obs_1"))
  expect_identical(observation_labels("Unknown-v0", c("pole_angle", "obs_1")),
                   c("pole_angle", "obs_1"))
  expect_identical(observation_labels("Taxi-v4", "state"), "state")
  expect_identical(observation_labels("Pendulum-v1", c("cos_theta", "angular_velocity")),
                   c("cos theta", "angular velocity (rad/s)"))
  expect_identical(observation_labels(NULL, "obs_1"), "obs_1")
})

test_that("units and limits are of parts that there are", {
  for (family in names(observation_units)) {
    expect_true(all(names(observation_units[[family]]) %in% observation_parts[[family]]))
  }
  for (family in names(episode_limits)) {
    expect_true(all(names(episode_limits[[family]]) %in% observation_parts[[family]]))
    for (limit in episode_limits[[family]]) {
      expect_true(limit$kind %in% names(limit_colours))
    }
  }
})

test_that("CartPole: no episode goes on beyond its limits", {
  limits <- episode_limits$CartPole
  played <- rollout("CartPole-v1", policy_random(), 300, seed = 1, steps = TRUE,
                    client = test_client())
  right <- function(observation) rep(1L, nrow(observation))
  steps <- rbind(
    played$steps,
    rollout("CartPole-v1", right, 300, seed = 1, steps = TRUE, client = test_client())$steps
  )
  expect_true(all(abs(steps$pole_angle) <= limits$pole_angle$at[2]))
  # And up to there they do.
  expect_gt(max(abs(steps$pole_angle)), 0.98 * limits$pole_angle$at[2])
  expect_true(all(abs(steps$cart_position) <= limits$cart_position$at[2]))
})
