autoplot <- ggplot2::autoplot

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
