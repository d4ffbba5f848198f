played_with <- function(returns, policy = policy_random(), ...) {
  rollout(scripted_environment(returns, ...), policy, episodes = length(returns), seed = 1)
}

# The labels of the rows that plot() shows for its arguments.
shown_rows <- function(...) {
  given <- given_rollouts(list(...), substitute(list(...)))
  names(given$rollouts)
}

many <- c(10, 12, 13, 15, 16, 18, 20, 40)

test_that("each rollout has a row from the top, under its name, its variable's or its policy's", {
  a <- played_with(1:3)
  expect_identical(shown_rows(random = a, `no name` = a), c("random", "no name"))
  expect_identical(shown_rows(a, b = a), c("a", "b"))
  expect_identical(shown_rows(played_with(1:3), a), c("random", "a"))
  expect_identical(shown_rows(a, a), c("a", "a 1"))
  data <- comparison_plot_data(list(upper = played_with(many), lower = played_with(0:1)))
  expect_identical(data$rows$label, c("upper", "lower"))
  expect_identical(data$rows$y, c(1, 0))
  expect_identical(data$title, "Fake-v0, 2 policies")
})

test_that("rows show their own returns, medians and densities, or bars of one width", {
  data <- comparison_plot_data(
    list(a = played_with(many), b = played_with(rep(c(0, 40), c(6, 2))), c = played_with(rep(5, 4)))
  )
  expect_identical(data$rows$median, c(15.5, 0, 5))
  expect_identical(data$rows$text,
                   c("median 15.5 (n = 8)", "median 0 (n = 8)", "median 5 (n = 4)"))
  expect_identical(split(data$returns$value, data$returns$label),
                   list(a = many, b = rep(c(0, 40), c(6, 2)), c = rep(5, 4)))
  shape <- function(label) data$shapes[data$shapes$label == label, ]
  whole <- density(many, from = 10, to = 40)
  expect_identical(range(shape("a")$x), c(10, 40))
  expect_equal(shape("a")$y[seq_along(whole$y) + 1], 2 + 0.66 * whole$y / max(whole$y))
  bars <- rbind(shape("b"), shape("c"))
  expect_identical(unique(shape("b")$area), 1:2)
  widths <- tapply(bars$x, paste(bars$label, bars$area), function(x) diff(range(x)))
  expect_equal(as.vector(widths), rep(4, 3))
  # The higher bar of a row fills it, the other is a third as high.
  heights <- tapply(shape("b")$y, shape("b")$area, max)
  expect_equal(as.vector(heights), 1 + 0.66 * c(1, 1 / 3))
  expect_identical(data$xlim, c(-2, 42))
})

test_that("the policies of one rollout have a row each, with their names", {
  env <- fake_vector_env(4, reward = function(seed, step, action) action)
  zero <- function(observation) rep(0L, nrow(observation))
  one <- function(observation) rep(1L, nrow(observation))
  played <- rollout(env, list(zero = zero, one = one), 6, seed = 1)
  data <- comparison_plot_data(list(played = played))
  expect_identical(data$rows$label, c("zero", "one"))
  expect_identical(data$rows$median, c(0, 3))
  unnamed <- rollout(env, list(zero, one), 6, seed = 1)
  expect_identical(comparison_plot_data(list(played = unnamed))$rows$label, c("1", "2"))
  both <- comparison_plot_data(list(first = played, second = unnamed))
  expect_identical(both$rows$label, c("first zero", "first one", "second 1", "second 2"))
})

test_that("of many policies those with the highest mean returns are shown, and the title says so", {
  rollouts <- lapply(c(1:6, 12:7), function(value) played_with(c(value, value + 1)))
  data <- comparison_plot_data(stats::setNames(rollouts, letters[1:12]))
  expect_identical(data$rows$label, c("g", "h", "i", "j", "k", "l", "f", "e", "d", "c"))
  expect_identical(data$title, "Fake-v0, the 10 of 12 policies with the highest mean returns")
})

test_that("the title names every environment", {
  data <- comparison_plot_data(list(a = played_with(1:3), b = played_with(1:3, id = "Other-v0")))
  expect_identical(data$title, "Fake-v0, Other-v0, 2 policies")
})

test_that("comparisons plot, return the first rollout and leave the session alone", {
  local_device()
  random <- played_with(many)
  other <- played_with(c(3, 3, 3))
  env <- fake_vector_env(4)
  one <- rollout(env, list(policy_random()), 5, seed = 1)
  candidates <- policy_candidates(policy_network(c(4, 1)), matrix(sin(1:80), 20))
  population <- rollout(env, candidates, 5, seed = 1)
  expect_leaves_session_alone({
    expect_identical(expect_invisible(plot(random = random, network = other)), random)
    expect_identical(expect_invisible(plot(random, other, main = "two", xlim = c(0, 50))), random)
    plot(a = random, b = random, xaxt = "n", yaxt = "n", ylab = "policy")
    plot(one)
    plot(population)
    plot(`a policy with a name that is much longer than there is room for in the margin` = random,
         b = other)
  })
})

test_that("ggplot2 compares the same data", {
  skip_if_not_installed("ggplot2")
  autoplot <- ggplot2::autoplot
  plot <- autoplot(upper = played_with(many), lower = played_with(c(3, 3)))
  built <- ggplot2::ggplot_build(plot)
  expect_identical(plot$labels$title, "Fake-v0, 2 policies")
  expect_equal(built$data[[4]]$label, c("median 15.5 (n = 8)", "median 3 (n = 2)"))
  expect_setequal(built$data[[2]]$x, c(many, 3))
})

test_that("what cannot be compared is refused", {
  local_device()
  played <- played_with(1:3)
  expect_error(plot(played, "trajectory"),
               "need names, such as `type = \"trajectory\"`, which \"trajectory\" has not",
               class = "gym_error_argument")
  expect_error(plot(a = played, b = played, type = "trajectory"),
               "A trajectory shows one rollout, not 2", class = "gym_error_argument")
  expect_error(plot(played, played, type = "filmstrip"), "A filmstrip shows one rollout, not 2",
               class = "gym_error_argument")
  skip_if_not_installed("ggplot2")
  expect_error(ggplot2::autoplot(played, played, type = "trajectory"),
               "A trajectory shows one rollout, not 2", class = "gym_error_argument")
  expect_error(ggplot2::autoplot(played, xlim = 1:2), "no argument for `xlim`",
               class = "gym_error_argument")
})

test_that("a rollout that was interrupted before it had an episode is refused", {
  interrupted <- function(observation) rlang::interrupt()
  none <- suppressMessages(rollout(fake_environment(), interrupted, episodes = 2))
  some <- rollout(fake_environment(), policy_random(), episodes = 2)
  expect_error(plot(none), "has no episode to plot", class = "gym_error_argument")
  expect_error(plot(some, none), "has no episode to plot", class = "gym_error_argument")
})
