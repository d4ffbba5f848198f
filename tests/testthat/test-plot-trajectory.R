autoplot <- ggplot2::autoplot

panel_kinds <- function(data) data$values$kind[!duplicated(data$values$panel)]

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
    levels(data$values$panel),
    c("cart position (m)", "cart velocity (m/s)", "pole angle (rad)",
      "pole angular velocity (rad/s)", "action")
  )
  expect_identical(panel_kinds(data), c(rep("line", 4), "choice"))
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
  expect_identical(as.character(limits$panel),
                   rep(c("cart position (m)", "pole angle (rad)"), each = 2))
  expect_equal(limits$at, c(-2.4, 2.4, -12 * pi / 180, 12 * pi / 180))
  fake <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  expect_identical(nrow(trajectory_plot_data(fake)$limits), 0L)
})

test_that("a limit is near where what happened still fills a tenth of the room", {
  expect_identical(is_near(c(-1, 1), c(0, 0.5)), c(TRUE, TRUE))
  expect_identical(is_near(c(-10, 1), c(0, 0.5)), c(FALSE, TRUE))
  expect_identical(is_near(c(-1, 1), c(0, 0.01, NA, Inf)), c(FALSE, FALSE))
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
  expect_identical(levels(data$values$panel), c(paste0("obs_", 1:8), "actions"))
  expect_identical(panel_kinds(data)[[9]], "line")
  expect_identical(unique(data$values$name), c(paste0("obs_", 1:8), paste0("action_", 1:6)))
  expect_null(data$choices)
  suppressMessages(
    chosen <- trajectory_plot_data(played, variables = c("obs_12", "reward"))
  )
  expect_identical(levels(chosen$values$panel), c("obs_12", "reward", "actions"))
  expect_error(trajectory_plot_data(played, variables = "obs_13"), "\"obs_1\", \"obs_2\"",
               class = "gym_error_argument")
})

test_that("a Box of one number is named as documented, with its unit", {
  client <- test_client()
  played <- rollout("Pendulum-v1", policy_random(), seed = 1, max_steps = 5, steps = TRUE,
                    client = client)
  data <- trajectory_plot_data(played)
  expect_identical(levels(data$values$panel)[[4]], "action: torque (N m)")
  expect_identical(panel_kinds(data)[[4]], "line")
})

test_that("parts that are no numbers are left out", {
  played <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  played$steps$obs_2 <- letters[seq_len(nrow(played$steps))]
  played$steps$obs_3 <- I(as.list(seq_len(nrow(played$steps))))
  panels <- levels(trajectory_plot_data(played)$values$panel)
  expect_identical(panels, c("obs_1", "obs_4", "action"))
})

test_that("a rollout without steps says how to get them", {
  plain <- rollout(fake_environment(), policy_random(), seed = 1)
  expect_error(plot(plain, type = "trajectory"), "steps = TRUE", class = "gym_error_argument")
})

# The picture ------------------------------------------------------------------------

drawable <- function() {
  numbers <- fake_environment(
    observation_space = box_space(rep(-1, 3), rep(1, 3)),
    action_space = box_space(c(-1, -1), c(1, 1))
  )
  one_step <- fake_environment(ends = function(seed, step, action) TRUE)
  endless <- fake_environment(observation_space = box_space(-1, 1, 1L))
  played <- lapply(list(fake_environment(), numbers, one_step, endless), rollout,
                   policy_random(), seed = 1, steps = TRUE)
  odd <- played[[1]]
  odd$steps$obs_1 <- c(NaN, Inf, -Inf)[seq_len(nrow(odd$steps))]
  odd$steps$obs_2[1] <- NA
  c(played, list(odd))
}

test_that("any trajectory is drawn", {
  for (played in drawable()) drawn(autoplot(played, type = "trajectory"))
})

test_that("a panel has the values of its part, actions a bar each in their place and colour", {
  played <- short_rollout()
  picture <- drawn(autoplot(played, type = "trajectory"))
  lines <- layers_of(picture, "GeomLine")[[1]]
  for (i in 1:4) {
    expect_identical(lines$y[lines$PANEL == i], played$steps[[2 + i]])
  }
  expect_identical(unique(lines$x), as.numeric(0:9))
  bars <- layers_of(picture, "GeomTile")[[1]]
  expect_identical(as.integer(bars$y), played$steps$action)
  expect_identical(as.character(unique(bars$PANEL)), "5")
  expect_identical(key_of(picture, "fill"), c("0: push left", "1: push right"))
  expect_identical(layers_of(picture, "GeomVline")[[1]]$xintercept[[1]], 10)
})

test_that("limits are drawn in their own panels, and named in all", {
  right <- function(observation) rep(1L, nrow(observation))
  played <- short_rollout(100, right)
  limits <- layers_of(drawn(autoplot(played, type = "trajectory")), "GeomHline")[[1]]
  expect_equal(limits$yintercept[limits$PANEL == 3], c(-12, 12) * pi / 180)
  titles <- trajectory_plot_data(played)$titles
  expect_identical(titles[["pole angle (rad)"]], "pole angle (rad), fails at \u00b112\u00b0")
})

test_that("the numbers of an action share a panel, and have a key", {
  numbers <- fake_environment(
    observation_space = discrete_space(9L), action_space = box_space(c(-1, -1), c(1, 1))
  )
  played <- rollout(numbers, policy_random(), seed = 1, steps = TRUE)
  picture <- drawn(autoplot(played, type = "trajectory"))
  expect_identical(key_of(picture), c("action_1", "action_2"))
  expect_identical(unique(layers_of(picture, "GeomLine")[[1]]$colour), series_colours[1:2])
})

test_that("a panel of a constant has a mark at its value alone", {
  played <- short_rollout()
  played$steps$cart_position <- 0L
  played$steps$cart_velocity <- 0.125
  picture <- drawn(autoplot(played, type = "trajectory"))
  marks <- lapply(ggplot2::ggplot_build(picture)$layout$panel_params, function(panel) {
    Filter(Negate(is.na), panel$y$breaks)
  })
  expect_identical(marks[[1]], 0)
  expect_identical(marks[[2]], 0.125)
  expect_gt(length(marks[[3]]), 1)
})
