autoplot <- ggplot2::autoplot

# A training as it would be, with these evaluations.
training_of <- function(steps, returns, target = 5, agent = agent_ars(), rules = NULL, ...) {
  evaluations <- data.frame(
    iteration = seq_along(steps), kind = c(rep("curve", length(steps) - 1L), "final"),
    mean_return = returns, ...
  )
  structure(
    list(history = data.frame(steps = steps), evaluations = evaluations, agent = agent,
         target = target, env_id = "Fake-v0", rules = rules),
    class = "gym_training"
  )
}

trainings_of <- function(...) {
  trainings <- list(...)
  structure(
    list(trainings = trainings, agent = trainings[[1]]$agent, target = trainings[[1]]$target,
         env_id = "Fake-v0"),
    class = "gym_trainings"
  )
}

test_that("a band is the middle half of the seeds, its line their median", {
  trained <- trainings_of(
    training_of(c(10, 20, 30), c(0, 1, 2)), training_of(c(10, 20, 40), c(4, 5, 6)),
    training_of(c(5, 20), c(7, 10)), training_of(c(10, 20), c(8, 8)),
    training_of(c(10, 40), c(9, 9))
  )
  picture <- drawn(autoplot(ARS = trained))
  curve <- picture$data
  # From where all were evaluated once; one that ended stays where it came to.
  expect_identical(range(curve$steps), c(10, 40))
  expect_equal(unlist(curve[1, c("median", "lower", "upper")]),
               c(median = 8, lower = 4, upper = 8))
  at_last <- sort(c(2, 6, 10, 8, 9))
  expect_equal(unlist(curve[nrow(curve), c("median", "lower", "upper")]),
               c(median = at_last[[3]], lower = at_last[[2]], upper = at_last[[4]]))
  expect_identical(layers_of(picture, "GeomRibbon")[[1]]$ymax, curve$upper)
  expect_identical(layers_of(picture, "GeomHline")[[1]]$yintercept, 5)
  expect_identical(picture$labels$title, "ARS V2-t in Fake-v0, 5 seeds")
})

test_that("between evaluations a curve is straight, of several at one place the last counts", {
  evaluated_twice <- training_of(c(10, 10, 20), c(99, 1, 3))
  curve <- autoplot(trainings_of(evaluated_twice, evaluated_twice))$data
  expect_equal(curve$median, 1 + (curve$steps - 10) / 10 * 2)
})

test_that("trainings that are given together are compared, by their names", {
  ars <- trainings_of(training_of(c(10, 20), c(1, 2)), training_of(c(10, 20), c(3, 4)))
  cem <- training_of(c(10, 30), c(1, 6), agent = agent_cem())
  picture <- drawn(autoplot(A = ars, cem = cem))
  expect_identical(levels(picture$data$label), c("A", "cem"))
  expect_identical(picture$data$median[picture$data$label == "cem"], c(1, 6))
  expect_identical(key_of(picture), c("A", "cem", "target 5"))
  expect_identical(unique(layers_of(picture, "GeomLine")[[1]]$colour), series_colours[1:2])
  expect_identical(levels(autoplot(cem, A = ars)$data$label), c("cem", "A"))
  # Different targets are no line, and the caption says so.
  other <- training_of(c(10, 30), 1:2, target = 9)
  expect_identical(key_of(autoplot(ars, other)), c("ars", "other"))
  caption <- autoplot(ars, other)$labels$caption
  expect_match(caption, "targets differ: ars: 5; other: 9", fixed = TRUE)
  expect_error(plot(ars, 3), class = "gym_error_argument")
  expect_error(autoplot(ars, col = 3), "no argument for `col`", class = "gym_error_argument")
})

test_that("from where a seed has ended the line is thin, and the caption says so", {
  ends <- trainings_of(training_of(c(10, 40), c(1, 4)), training_of(c(10, 20), c(3, 6)))
  picture <- drawn(autoplot(A = ends, B = training_of(c(10, 60), c(0, 5))))
  line <- layers_of(picture, "GeomLine")
  of_first <- function(line) range(line$x[line$colour == series_colours[[1]]])
  expect_identical(of_first(line[[1]]), c(10, 20))
  expect_identical(of_first(line[[2]]), c(20, 60))
  expect_lt(line[[2]]$linewidth[[1]], line[[1]]$linewidth[[1]])
  expect_false(series_colours[[2]] %in% line[[2]]$colour)
  expect_match(picture$labels$caption, "a seed has ended, and counts with its last evaluation")
  curve <- picture$data[picture$data$label == "A", ]
  expect_identical(curve$median[nrow(curve)], 5)
  whole <- autoplot(trainings_of(training_of(c(10, 40), c(1, 4)), training_of(c(10, 40), c(3, 6))))
  expect_null(whole$labels$caption)
})

test_that("a comparison names other budgets and rules of evaluation", {
  one <- function(...) training_of(c(10, 20), 1:2, rules = list(...))
  captions <- function(...) gsub("\n", " ", autoplot(...)$labels$caption)
  short <- one(total_steps = 2e4, eval_episodes = 100)
  long <- one(total_steps = 5e4, eval_episodes = 100)
  expect_null(autoplot(short, again = short)$labels$caption)
  expect_identical(captions(short, long),
                   "budgets differ: short: total_steps 20,000; long: total_steps 50,000")
  seldom <- one(total_steps = 2e4, eval_episodes = 20, max_steps = 9)
  expect_identical(
    captions(short, seldom),
    paste("rules of evaluation differ: short: no max_steps, eval_episodes 100;",
          "seldom: max_steps 9, eval_episodes 20")
  )
  # Targets of several environments are different ones.
  elsewhere <- short
  elsewhere$env_id <- "Other-v0"
  elsewhere$target <- 9
  expect_null(autoplot(short, elsewhere)$labels$caption)
})

test_that("each environment has a panel, in which an agent keeps its name and has its own target", {
  elsewhere <- function(training) {
    training$env_id <- "Other-v0"
    training$target <- 70
    training
  }
  first <- training_of(c(10, 20), c(1, 2), rules = list(total_steps = 20))
  longer <- training_of(c(10, 30), c(1, 3), rules = list(total_steps = 30), agent = agent_cem())
  second <- elsewhere(training_of(c(100, 300), c(50, 60), rules = list(total_steps = 300)))
  local_device()
  pictures <- list(
    drawn(autoplot(ARS = first, CEM = longer, ARS = second)),
    plot(ARS = first, CEM = longer, ARS = second),
    autoplot(list(first)[[1]], CEM = longer, list(second)[[1]])
  )
  for (picture in pictures) {
    expect_identical(levels(picture$data$label)[2], "CEM")
    expect_length(levels(picture$data$label), 2)
    panels <- ggplot2::ggplot_build(picture)$layout$layout
    expect_identical(as.character(panels$env_id), c("Fake-v0", "Other-v0"))
    lines <- layers_of(picture, "GeomLine")[[1]]
    expect_identical(range(lines$x[lines$PANEL == 2]), c(100, 300))
    expect_identical(unique(lines$colour[lines$PANEL == 2]), series_colours[[1]])
    targets <- layers_of(picture, "GeomHline")[[1]]
    expect_identical(targets$yintercept[order(targets$PANEL)], c(5, 70))
    expect_match(picture$labels$caption, "budgets differ in Fake-v0: ", fixed = TRUE)
    # A line is thin from its end to that of its own panel.
    expect_lte(max(layers_of(picture, "GeomLine")[[2]]$x), 300)
    thin <- layers_of(picture, "GeomLine")[[2]]
    expect_identical(max(thin$x[thin$PANEL == 1]), 30)
  }
  expect_identical(key_of(pictures[[1]]), c("ARS", "CEM", "target"))
  # In one environment two trainings need two names.
  expect_identical(levels(autoplot(ARS = first, ARS = first)$data$label), c("ARS", "ARS 1"))
})

test_that("a curve begins before the first iteration", {
  trained <- training_of(c(10, 20), c(4, 6))
  trained$evaluations <- rbind(data.frame(iteration = 0, kind = "curve", mean_return = 1),
                               trained$evaluations)
  expect_identical(autoplot(trained, trained)$data$steps[1:3], c(0, 10, 20))
})

test_that("trainings that were evaluated once are a point and a bar", {
  once <- trainings_of(training_of(10, 1), training_of(10, 3), training_of(10, 2))
  bar <- layers_of(suppressMessages(autoplot(once)), "GeomPointrange")[[1]]
  expect_equal(unlist(bar[c("y", "ymin", "ymax")]), c(y = 2, ymin = 1.5, ymax = 2.5))
})

test_that("bars count the seeds by the iterations that they needed to reach the target", {
  ended <- function(iterations, solved, interrupted = FALSE) {
    training <- training_of(seq_len(iterations), rep(1, iterations))
    training[c("solved", "interrupted")] <- list(solved, interrupted)
    training
  }
  some <- trainings_of(ended(1, TRUE), ended(3, TRUE), ended(1, TRUE), ended(9, FALSE),
                       ended(2, NA, TRUE))
  picture <- drawn(autoplot(some, type = "iterations"))
  bars <- layers_of(picture, "GeomBar")[[1]]
  expect_identical(bars$count[order(bars$x)], c(2, 0, 1))
  expect_equal(sort(bars$x), 1:3)
  expect_identical(picture$labels$subtitle, "3 of 4 seeds have reached the target")
  two <- drawn(autoplot(A = some, B = trainings_of(ended(5, FALSE)), type = "iterations"))
  panels <- ggplot2::ggplot_build(two)$layout$layout$panel
  expect_identical(as.character(panels), c("A: 3 of 4", "B: 0 of 1"))
  expect_error(autoplot(trainings_of(ended(5, FALSE)), type = "iterations"), "no seed has reached",
               class = "gym_error_argument")
  expect_error(autoplot(some, type = "steps"), "`type`", class = "gym_error_argument")
})

test_that("searches with many seeds plot the rounds that they needed", {
  env <- fake_environment(reward = first_action)
  searches <- search_random(env, rounds = 4, episodes = 3, target = 11, seeds = 1:4)
  picture <- drawn(autoplot(searches))
  expect_identical(picture$labels$x, "rounds to the target")
  expect_error(autoplot(searches, type = "returns"), "was evaluated", class = "gym_error_argument")
})

test_that("a search among them is refused, with or without a name", {
  search <- search_random(fake_environment(), rounds = 2, seed = 1)
  trained <- training_of(c(10, 20), c(1, 2))
  expect_error(plot(trained, search), "has no evaluations", class = "gym_error_argument")
  expect_error(plot(ARS = trained, random = search), "agent_random", class = "gym_error_argument")
})

test_that("trainings without an evaluation are refused, and single ones drawn without", {
  env <- fake_environment(reward = first_action)
  step <- env$step
  env$step <- function(action) if (length(env$seeds) == 40L) rlang::interrupt() else step(action)
  trained <- suppressMessages(
    train_agent(agent_ars(), env, iterations = 9, seed = 1, target = Inf)
  )
  expect_identical(nrow(trained$evaluations), 0L)
  expect_identical(key_of(drawn(autoplot(trained))), c("range of candidates", "their median"))
  expect_error(plot(trained, trained), "no policy of trained was evaluated",
               class = "gym_error_argument")
})

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
