test_that("the data are those of the table of steps", {
  played <- short_rollout(episodes = 2)
  for (episode in 1:2) {
    data <- trajectory_plot_data(played, episode)
    steps <- played$steps[played$steps$episode == episode, ]
    for (name in c("cart_position", "pole_angular_velocity", "action")) {
      rows <- data$values[data$values$name == name, ]
      expect_identical(rows$value, as.numeric(steps[[name]]))
      expect_identical(rows$step, steps$step)
      expect_identical(rows$time, steps$step - 1L)
    }
    expect_identical(data$length, nrow(steps))
  }
  expect_identical(
    data$panels$panel,
    c("cart position (m)", "cart velocity (m/s)", "pole angle (rad)",
      "pole angular velocity (rad/s)", "action")
  )
  expect_identical(data$panels$kind, c(rep("line", 4), "choice"))
})

test_that("actions have the documented words, also of a function and of doubles", {
  words <- data.frame(value = 0:1, label = c("push left", "push right"))
  choices <- function(policy) trajectory_plot_data(short_rollout(3, policy))$choices
  expect_equal(choices(policy_random()), words)
  expect_equal(choices(function(observation) rep(1, nrow(observation))), words)
  unknown <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  expect_identical(trajectory_plot_data(unknown)$choices$label,
                   as.character(sort(unique(unknown$steps$action))))
})

test_that("limits are those of the environment, with its panels", {
  limits <- trajectory_plot_data(short_rollout(3))$limits
  expect_identical(limits$panel, rep(c("cart position (m)", "pole angle (rad)"), each = 2))
  expect_equal(limits$at, c(-2.4, 2.4, -12 * pi / 180, 12 * pi / 180))
  fake <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  expect_identical(nrow(trajectory_plot_data(fake)$limits), 0L)
})

test_that("a limit is near where what happened still fills a tenth of the room", {
  expect_identical(near_limits(c(-1, 1), c(0, 0.5)), c(-1, 1))
  expect_identical(near_limits(c(-10, 1), c(0, 0.5)), 1)
  expect_identical(near_limits(c(-1, 1), c(0, 0.01, NA, Inf)), numeric())
})

test_that("the ending is that of the episode", {
  cut <- trajectory_plot_data(short_rollout(3))
  expect_identical(cut$ending, "truncated")
  right <- function(observation) rep(1L, nrow(observation))
  expect_identical(trajectory_plot_data(short_rollout(100, right))$ending, "terminated")
})

many_numbers <- function() {
  fake_environment(
    observation_space = box_space(rep(-1, 12), rep(1, 12)),
    action_space = box_space(rep(-1, 9), rep(1, 9))
  )
}

test_that("of many numbers the first are shown, with a message, or those chosen", {
  played <- rollout(many_numbers(), policy_random(), seed = 1, steps = TRUE)
  expect_message(data <- trajectory_plot_data(played), "first 8 of 12 numbers of the observation",
                 class = "gym_message_variables") |>
    expect_message("first 6 of 9 numbers of the action")
  expect_identical(data$panels$panel, c(paste0("obs_", 1:8), "actions"))
  expect_identical(data$panels$kind[[9]], "line")
  expect_identical(unique(data$values$name), c(paste0("obs_", 1:8), paste0("action_", 1:6)))
  expect_null(data$choices)
  suppressMessages(
    chosen <- trajectory_plot_data(played, variables = c("obs_12", "reward"))
  )
  expect_identical(chosen$panels$panel, c("obs_12", "reward", "actions"))
  expect_error(trajectory_plot_data(played, variables = "obs_13"), "\"obs_1\", \"obs_2\"",
               class = "gym_error_argument")
})

test_that("a Box of one number is named as documented, with its unit", {
  client <- test_client()
  played <- rollout("Pendulum-v1", policy_random(), seed = 1, max_steps = 5, steps = TRUE,
                    client = client)
  data <- trajectory_plot_data(played)
  expect_identical(data$panels$panel[[4]], "action: torque (N m)")
  expect_identical(data$panels$kind[[4]], "line")
})

test_that("parts that are no numbers are left out", {
  played <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  played$steps$obs_2 <- letters[seq_len(nrow(played$steps))]
  played$steps$obs_3 <- I(as.list(seq_len(nrow(played$steps))))
  panels <- trajectory_plot_data(played)$panels$panel
  expect_identical(panels, c("obs_1", "obs_4", "action"))
})

test_that("a rollout without steps says how to get them", {
  plain <- rollout(fake_environment(), policy_random(), seed = 1)
  expect_error(plot(plain, type = "trajectory"), "steps = TRUE", class = "gym_error_argument")
})
