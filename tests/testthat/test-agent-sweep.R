sweep_fake <- function(settings = expand.grid(noise = c(0.1, 1), candidates = 2), ...,
                       seeds = 1:5, env = fake_environment(reward = first_action)) {
  suppressMessages(sweep_agent(
    agent_hill_climb, env, settings, seeds = seeds, ..., iterations = 2, eval_episodes = 2,
    target = Inf
  ))
}

# For all tests that only look at it.
plain_env <- fake_environment(reward = first_action)
plain_sweep <- sweep_fake(env = plain_env)

test_that("each setting is trained with each seed, as train_agent() does", {
  sweep <- plain_sweep
  expect_identical(names(sweep$trainings),
                   c("noise = 0.1, candidates = 2", "noise = 1, candidates = 2"))
  one <- train_agent(agent_hill_climb(noise = 1, candidates = 2), iterations = 2, target = Inf,
                     env = fake_environment(reward = first_action), eval_episodes = 2, seed = 3)
  own <- sweep$trainings[[2]]$trainings[["3"]]
  expect_identical(own$evaluations, one$evaluations)
  expect_identical(own$policy, one$policy)
  table <- as.data.frame(sweep)
  expect_identical(unique(table$noise), c(0.1, 1))
  expect_identical(nrow(table), 4L)
  expect_identical(table$value, sweep$comparison$table$value)
  expect_identical(nrow(sweep$runs), 10L)
})

test_that("tuning seeds choose, reporting seeds are others, and the print says which", {
  # More candidates are better.
  settings <- data.frame(noise = 1, candidates = c(1, 8))
  sweep <- sweep_fake(settings, report_seeds = 11:15)
  iqm <- subset(as.data.frame(sweep), statistic == "iqm")
  expect_identical(sweep$best, iqm$setting[[which.max(iqm$value)]])
  expect_identical(names(sweep$reported$trainings), as.character(11:15))
  expect_output(print(sweep), "Tuning seeds: 1 to 5, which chose the setting", fixed = TRUE)
  expect_output(print(sweep), "Reporting seeds: 11 to 15, which chose nothing", fixed = TRUE)
  expect_output(print(sweep_fake(settings)), "No reporting seeds")
  expect_error(sweep_fake(report_seeds = 5:9), "Seed 5", class = "gym_error_argument")
})

test_that("a setting that fails does not lose the others: its row says the error", {
  settings <- data.frame(noise = c(0.1, -1))
  sweep <- sweep_fake(settings)
  table <- as.data.frame(sweep)
  expect_match(table$error[table$noise == -1], "noise")
  expect_true(all(is.na(table$error[table$noise == 0.1])))
  expect_output(print(sweep), "5 runs failed, the first, noise = -1")
  # An error in the middle of a run.
  env <- fake_environment(reward = function(seed, step, action) if (seed %% 7 == 0) NaN else 1)
  broken <- sweep_fake(settings[1, , drop = FALSE], env = env, seeds = 1:12)
  failed <- !is.na(broken$runs$error)
  expect_true(any(failed) && !all(failed))
  expect_identical(length(broken$trainings[[1]]$trainings), sum(!failed))
  expect_error(sweep_fake(settings[2, , drop = FALSE]), "noise", class = "gym_error_argument")
})

test_that("an interrupted sweep goes on with what is missing", {
  folder <- withr::local_tempdir()
  env <- fake_environment(reward = first_action)
  step <- env$step
  env$step <- function(action) if (length(env$seeds) == 60L) rlang::interrupt() else step(action)
  begun <- suppressWarnings(sweep_fake(folder = folder, env = env), classes = "gym_warning_seeds")
  expect_true(begun$interrupted)
  expect_lt(nrow(begun$runs), 10L)
  played <- fake_environment(reward = first_action)
  again <- sweep_fake(folder = folder, env = played)
  expect_false(again$interrupted)
  expect_identical(as.data.frame(again), as.data.frame(plain_sweep))
  expect_lt(length(played$seeds), length(plain_env$seeds))
  expect_length(list.files(folder, "[.]rds$"), 10)
})

test_that("a picture has a panel for each setting", {
  picture <- drawn(ggplot2::autoplot(sweep_fake(eval_every = 1, max_steps = 3)))
  built <- ggplot2::ggplot_build(picture)
  expect_identical(nrow(built$layout$layout), 2L)
  expect_no_match(picture$labels$subtitle, "target")
  # What all settings share is not repeated.
  expect_match(picture$labels$subtitle, "candidates = 2")
  expect_identical(unname(varied_settings(names(plain_sweep$trainings))$each),
                   c("noise = 0.1", "noise = 1"))
  expect_identical(varied_settings("noise = 1"),
                   list(constant = NULL, each = c(`noise = 1` = "noise = 1")))
  stopping <- sweep_agent(
    agent_hill_climb, fake_environment(), data.frame(noise = 1:2), seeds = 1:5, iterations = 1,
    eval_episodes = 2, target = 100
  )
  expect_match(ggplot2::autoplot(stopping)$labels$subtitle, "dashed line: target 100")
})

test_that("arguments of a sweep are checked", {
  env <- fake_environment()
  bad <- function(...) expect_error(sweep_agent(...), class = "gym_error_argument")
  bad(agent_ars(), env, data.frame(noise = 1), 1:5, iterations = 1)
  bad(agent_ars, env, list(noise = 1), 1:5, iterations = 1)
  bad(agent_ars, env, data.frame(noise = 1), c(1, 1), iterations = 1)
  bad(agent_ars, env, data.frame(noise = 1), 1:5)
  bad(agent_ars, env, data.frame(noise = 1), iterations = 1)
  bad(search_ars, env, data.frame(noise = 1), 1:5, iterations = 1)
  expect_error(sweep_agent(agent_ars, env, data.frame(stepsize = 1), 1:5, iterations = 1),
               "no argument `stepsize`.*Did you mean `step_size`", class = "gym_error_argument")
})

test_that("no setting is the best where no run reached the target", {
  env <- fake_environment(reward = function(seed, step, action) -1)
  sweep <- sweep_agent(
    agent_hill_climb, env, data.frame(noise = c(0.1, 1)), seeds = 1:5, report_seeds = 6:10,
    iterations = 1, eval_episodes = 2, target = 100
  )
  expect_null(sweep$best)
  expect_null(sweep$reported)
  expect_output(print(sweep), "Best: none, no run reached the target", fixed = TRUE)
  expect_output(print(sweep), "Tuning seeds: 1 to 5\n", fixed = TRUE)
})

test_that("of equal settings none is the best, and the print names them", {
  by_steps <- function(reached, median) {
    list(by = "steps", table = data.frame(training = c("a", "b", "c"), runs = 4,
                                          reached = reached, median = median))
  }
  expect_identical(best_settings(by_steps(c(4, 4, 3), c(50, 60, 10))), "a")
  expect_identical(best_settings(by_steps(c(4, 4, 3), c(50, 50, 10))), c("a", "b"))
  expect_identical(best_settings(by_steps(c(1, 0, 1), NA)), c("a", "c"))
  expect_identical(best_settings(by_steps(c(0, 0, 0), NA)), character())
  by_scores <- list(by = "scores", table = data.frame(
    training = c("a", "b", "a"), statistic = c("iqm", "iqm", "mean"), value = c(3, 3, 9)
  ))
  expect_match(no_best_text(by_scores), "none, equal are a; b. More `seeds` may tell", fixed = TRUE)
})

test_that("the curves of a sweep are those of its settings", {
  curves <- learning_curves(plain_sweep)
  expect_setequal(curves$training, c("noise = 0.1, candidates = 2", "noise = 1, candidates = 2"))
})

test_that("the runs of a sweep go to the workers of the plan", {
  skip_unless_all()
  skip_if_not_installed("future")
  sweep <- function() {
    suppressMessages(sweep_agent(
      agent_hill_climb, "CartPole-v1", data.frame(noise = c(0.1, 0.5)), seeds = 1:2,
      iterations = 2, eval_episodes = 2, target = Inf, max_steps = 20
    ), classes = "message")
  }
  here <- suppressWarnings(sweep(), classes = "gym_warning_seeds")
  old <- future::plan(future::multisession, workers = 2)
  withr::defer(future::plan(old))
  there <- suppressWarnings(sweep(), classes = "gym_warning_seeds")
  expect_identical(as.data.frame(there), as.data.frame(here))
  expect_identical(coef(there$trainings[[2]]), coef(here$trainings[[2]]))
})

test_that("a sweep tunes the agent that the trainer with its preset trains, and says so", {
  client <- test_client()
  expect_message(
    sweep <- suppressWarnings(sweep_agent(
      agent_ars, "CartPole-v1", data.frame(directions = 2, noise = 0.3), seeds = 1:2,
      iterations = 1, eval_episodes = 2, target = Inf, client = client
    ), classes = "gym_warning_seeds"),
    class = "gym_message_preset"
  )
  one <- suppressMessages(search_ars(
    "CartPole-v1", directions = 2, noise = 0.3, iterations = 1, eval_episodes = 2, target = Inf,
    seed = 2, client = client
  ))
  own <- sweep$trainings[[1L]]$trainings[["2"]]
  expect_identical(coef(own), coef(one))
  expect_identical(provenance(own)$preset$origin, "ours")
  expect_setequal(provenance(own)$preset$changed, provenance(one)$preset$changed)
})
