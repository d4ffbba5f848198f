autoplot <- ggplot2::autoplot

played_with <- function(returns, policy = policy_random(), ...) {
  rollout(scripted_environment(returns, ...), policy, episodes = length(returns), seed = 1)
}

many <- c(10, 12.5, 13, 15, 16, 18, 20, 40)

test_that("each rollout has a row from the top, with its name, its median and its colour", {
  picture <- drawn(autoplot(upper = played_with(many), lower = played_with(c(3, 3))))
  data <- comparison_plot_data(list(upper = played_with(many), lower = played_with(0:1)))
  expect_identical(as.character(data$rows$label), c("upper", "lower"))
  expect_identical(data$rows$median, c(15.5, 0.5))
  expect_identical(row_titles(data$rows),
                   c(upper = "upper, median 15.5", lower = "lower, median 0.5"))
  expect_identical(layers_of(picture, "GeomRug")[[1]]$x, c(many, 3, 3))
  expect_identical(layers_of(picture, "GeomVline")[[1]]$xintercept, c(15.5, 3))
  expect_identical(picture$labels$subtitle, "2 to 8 episodes each")
  expect_identical(unique(layers_of(picture, "GeomDensity")[[1]]$fill), series_colours[[1]])
  expect_identical(unique(layers_of(picture, "GeomBar")[[1]]$fill), series_colours[[2]])
})

test_that("rows show their own returns as densities, or as bars of one width", {
  picture <- drawn(autoplot(
    a = played_with(many), b = played_with(rep(c(0, 40), c(6, 2))), c = played_with(rep(5, 4))
  ))
  area <- layers_of(picture, "GeomDensity")[[1]]
  whole <- density(many, from = 10, to = 40)
  expect_equal(area$x, whole$x)
  expect_equal(area$y, whole$y / max(whole$y))
  bars <- layers_of(picture, "GeomBar")[[1]]
  expect_equal(bars$xmax - bars$xmin, rep(0.9, 3))
  # The higher bar of a row fills it, the other is a third as high.
  expect_equal(bars$y, c(1, 1 / 3, 1))
  marks <- function(picture) {
    breaks <- ggplot2::ggplot_build(picture)$layout$panel_params[[1]]$x$breaks
    breaks[!is.na(breaks)]
  }
  expect_equal(marks(autoplot(played_with(c(3, 3)), played_with(c(0, 0, 5, 5)))), c(0, 3, 5))
  expect_false(identical(marks(picture), c(0, 5, 40)))
})

test_that("a row of whole numbers is a histogram", {
  picture <- drawn(autoplot(a = played_with(c(1:8, 8)), b = played_with(many)))
  bars <- layers_of(picture, "GeomBar")
  bars <- bars[[length(bars)]]
  expect_equal(bars$y[bars$y > 0], c(rep(0.5, 7), 1))
  expect_equal(unique(round(bars$xmax - bars$xmin, 9)), 1)
})

test_that("the policies of one rollout have a row each, with their names", {
  env <- fake_vector_env(4, reward = function(seed, step, action) action)
  zero <- function(observation) rep(0L, nrow(observation))
  one <- function(observation) rep(1L, nrow(observation))
  labels <- function(...) as.character(comparison_plot_data(list(...))$rows$label)
  played <- rollout(env, list(zero = zero, one = one), 6, seed = 1)
  expect_identical(labels(played = played), c("zero", "one"))
  expect_identical(comparison_plot_data(list(played = played))$rows$median, c(0, 3))
  unnamed <- rollout(env, list(zero, one), 6, seed = 1)
  expect_identical(labels(played = unnamed), c("1", "2"))
  expect_identical(labels(first = played, second = unnamed),
                   c("first zero", "first one", "second 1", "second 2"))
  drawn(autoplot(rollout(env, list(policy_random()), 5, seed = 1)))
})

test_that("of many policies those with the highest mean returns are shown, and it is said", {
  rollouts <- lapply(c(1:6, 12:7), function(value) played_with(c(value, value + 1)))
  data <- comparison_plot_data(stats::setNames(rollouts, letters[1:12]))
  expect_identical(as.character(data$rows$label),
                   c("g", "h", "i", "j", "k", "l", "f", "e", "d", "c"))
  expect_identical(data$subtitle[[1]], "the 10 of 12 policies with the highest mean returns")
})

test_that("each environment has a column, with axis and bars of its own", {
  local_device()
  picture <- plot(
    random = played_with(many), random = played_with(c(-300, -300, -100), id = "Other-v0"),
    other = played_with(c(3, 3, 4))
  )
  panels <- ggplot2::ggplot_build(picture)$layout$layout
  expect_identical(unique(as.character(panels$env_id)), c("Fake-v0", "Other-v0"))
  expect_identical(unique(as.character(panels$label)), c("random", "other"))
  expect_identical(anyDuplicated(panels$SCALE_X[panels$label == "random"]), 0L)
  bars <- layers_of(picture, "GeomBar")
  expect_equal(bars[[1]]$xmax - bars[[1]]$xmin, c(0.8, 0.8))
  expect_equal(bars[[2]]$xmax - bars[[2]]$xmin, c(2, 2))
  expect_setequal(layers_of(picture, "GeomVline")[[1]]$xintercept, c(15.5, -300, 3))
})

test_that("the title names every environment", {
  data <- comparison_plot_data(list(a = played_with(1:3), b = played_with(1:3, id = "Other-v0")))
  expect_identical(toString(data$envs), "Fake-v0, Other-v0")
})

test_that("what cannot be compared is refused", {
  played <- played_with(1:3)
  refused <- function(code, text) expect_error(code, text, class = "gym_error_argument")
  refused(plot(played, "trajectory"), "must be a result like the others, or have a name")
  refused(plot(a = played, b = played, type = "trajectory"), "shows one rollout, not 2")
  refused(autoplot(played, played, type = "filmstrip"), "A filmstrip shows one rollout, not 2")
})

test_that("a rollout that was interrupted before it had an episode is refused", {
  interrupted <- function(observation) rlang::interrupt()
  none <- suppressMessages(rollout(fake_environment(), interrupted, episodes = 2))
  some <- rollout(fake_environment(), policy_random(), episodes = 2)
  expect_error(plot(none), "has no episode to plot", class = "gym_error_argument")
  expect_error(plot(some, none), "has no episode to plot", class = "gym_error_argument")
})

evaluated <- function(policies, episodes = 4) {
  env <- fake_vector_env(4, reward = function(seed, step, action) action + seed %% 2)
  evaluate_policy(env, policies, episodes = episodes, seed = 1)
}

test_that("each policy is a dot with its interval, from the top", {
  zero <- function(observation) rep(0L, nrow(observation))
  one <- function(observation) rep(1L, nrow(observation))
  evaluation <- evaluated(list(zero = zero, one = one))
  picture <- drawn(autoplot(evaluation))
  dots <- layers_of(picture, "GeomPoint")[[1]]
  expect_identical(dots$x, evaluation$mean_return)
  expect_identical(as.integer(dots$y), 2:1)
  bars <- layers_of(picture, "GeomLinerange")[[1]]
  expect_identical(bars$xmin, evaluation$lower)
  expect_identical(bars$xmax, evaluation$upper)
  expect_identical(levels(picture$data$label), c("one", "zero"))
  expect_match(picture$labels$subtitle, "95% interval, 4 episodes each")
  expect_identical(picture$labels$title, "Fake-v0")
  local_device()
  expect_identical(plot(evaluation, xlab = "return")$labels$x, "return")
  # A single episode has no interval.
  drawn(autoplot(evaluated(policy_random(), 1)))
})

test_that("of many policies those with the highest mean returns are dots", {
  evaluation <- evaluated(policy_random())
  evaluation <- structure(evaluation[rep(1, 12), ], row.names = letters[1:12])
  evaluation$mean_return <- c(1:6, 12:7)
  picture <- drawn(autoplot(evaluation))
  expect_identical(rev(levels(picture$data$label)), strsplit("ghijklfedc", "")[[1]])
  expect_match(picture$labels$subtitle, "the 10 of 12 policies with the highest mean returns")
  expect_error(plot(evaluation[-4]), "`lower`", class = "gym_error_argument")
})

compared_scores <- function() {
  curves <- data.frame(training = rep(c("p", "q"), each = 5), seed = 1:5, steps = 50,
                       env_id = "A", mean_return = c(1:5, 2:6))
  compare_trainings(curves, seed = 1)
}

test_that("scores are bars with intervals, a panel for each statistic", {
  compared <- compared_scores()
  bars <- layers_of(drawn(ggplot2::autoplot(compared)), "GeomPointrange")[[1]]
  expect_setequal(bars$x, compared$table$value)
  expect_setequal(bars$xmin, compared$table$lower)
  expect_identical(nlevels(bars$PANEL), 2L)
  pair <- layers_of(drawn(ggplot2::autoplot(compared, "improvement")), "GeomPointrange")[[1]]
  expect_identical(pair$x, compared$improvement$probability)
})

test_that("a profile is a step line for each training", {
  picture <- drawn(ggplot2::autoplot(compared_scores(), type = "profile"))
  expect_identical(key_of(picture), c("p", "q"))
  expect_setequal(layers_of(picture, "GeomStep")[[1]]$y, (0:5) / 5)
  expect_error(plot(compared_scores(), type = "other"), class = "gym_error_argument")
})

test_that("the share that has reached a target rises in steps, with failures as ticks", {
  compared <- structure(
    c(
      list(by = "steps", notes = "targets differ: a 1; b 2", level = 0.95, runs = data.frame(
        training = "a", env_id = "A", seed = 1:3, steps = c(10, 20, 30),
        reached = c(TRUE, TRUE, FALSE)
      )),
      list(profile = data.frame(
        training = "a", env_id = "A", steps = c(0, 10, 20, 30), share = c(0, 1, 2, 2) / 3,
        lower = NA_real_, upper = NA_real_
      ))
    ),
    class = "gym_comparison"
  )
  picture <- drawn(ggplot2::autoplot(compared))
  line <- layers_of(picture, "GeomPath")[[1]]
  expect_identical(line$x, c(0, 10, 10, 20, 20, 30, 30))
  expect_equal(line$y, c(0, 0, 1, 1, 2, 2, 2) / 3)
  expect_identical(layers_of(picture, "GeomPoint")[[1]]$x, 30)
  expect_match(picture$labels$caption, "targets differ")
})
