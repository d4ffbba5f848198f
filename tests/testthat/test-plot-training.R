trained_in_fake <- function(...) {
  train_agent(agent_ars(directions = 3), fake_environment(reward = first_action), iterations = 7,
              seed = 1, eval_every = 2, eval_episodes = 4, ...)
}

test_that("a training's plot shows candidates, median, evaluations, target and final evaluation", {
  trained <- trained_in_fake(target = 30)
  data <- training_plot_data(trained)
  expect_identical(data$history, trained$history)
  expect_identical(data$curve$steps, c(36, 72, 108))
  expect_identical(data$final$steps, 126)
  expect_identical(data$final$mean_return, trained$final$mean_return)
  expect_identical(data$target, 30)
  expect_identical(data$xlim, c(0, 126))
  expect_identical(max(data$ylim), 30)
  expect_null(training_plot_data(trained_in_fake(target = Inf))$target)
})

test_that("a training is drawn by base R and by ggplot2", {
  trained <- trained_in_fake(target = 30)
  local_device()
  expect_leaves_session_alone(plot(trained))
  expect_identical(plot(trained, main = "mine"), trained)
  skip_if_not_installed("ggplot2")
  plot <- ggplot2::autoplot(trained)
  built <- ggplot2::ggplot_build(plot)
  expect_identical(built$data[[1]]$ymax, trained$history$max_return)
  expect_identical(built$data[[3]]$y, trained$evaluations$mean_return[1:3])
  expect_identical(built$data[[4]]$ymax, trained$final$upper)
  expect_identical(built$data[[5]]$yintercept, 30)
  expect_identical(plot$labels$title, "ARS V2-t in Fake-v0")
})

test_that("a training without an iteration is refused", {
  env <- fake_environment()
  env$step <- function(action) rlang::interrupt()
  trained <- suppressMessages(train_agent(agent_ars(), env, iterations = 2, seed = 1))
  expect_error(plot(trained), "nothing to plot", class = "gym_error_argument")
})
