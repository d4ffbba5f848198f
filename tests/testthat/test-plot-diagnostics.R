test_that("diagnostics have a panel for each number that is logged, without the random episodes", {
  trained <- suppressMessages(train_agent(
    agent_reinforce(batch_steps = 20, min_episodes = 2), fake_environment(),
    policy_network(c(NA, NA), output = "softmax", activation = "identity", normalize = TRUE),
    iterations = 4, eval_episodes = 2, seed = 1
  ))
  picture <- ggplot2::autoplot(trained, type = "diagnostics")
  expect_identical(levels(picture$data$name), reinforce_log)
  of <- picture$data[picture$data$name == "value_loss", ]
  expect_identical(of$steps, trained$history$steps[-1])
  expect_identical(of$value, trained$history$value_loss[-1])
  withr::local_pdf(NULL)
  expect_s3_class(plot(trained, type = "diagnostics"), "ggplot")
  expect_error(ggplot2::autoplot(a = trained, b = trained, type = "diagnostics"), "one training",
               class = "gym_error_argument")
  # A learning rate that stays the same is drawn at its value.
  trained$history$value_loss <- 3e-4
  built <- ggplot2::ggplot_build(ggplot2::autoplot(trained, type = "diagnostics"))
  panel <- built$layout$layout$PANEL[built$layout$layout$name == "value_loss"]
  axis <- built$layout$panel_params[[panel]]$y
  expect_gt(axis$continuous_range[[1]], 1e-4)
  expect_lt(axis$continuous_range[[2]], 5e-4)
  without <- train_agent(agent_hill_climb(), fake_environment(), iterations = 1, eval_episodes = 2)
  expect_error(plot(without, type = "diagnostics"), "logs none", class = "gym_error_argument")
})
