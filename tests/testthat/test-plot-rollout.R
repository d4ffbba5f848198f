rollout_of <- function(returns) {
  rollout(scripted_environment(returns), policy_random(), episodes = length(returns))
}

test_that("the plot shows the density of the returns and their median", {
  returns <- c(10, 12, 13, 15, 16, 18, 20, 40)
  data <- rollout_plot_data(rollout_of(returns))
  expect_identical(data$returns, returns)
  expect_identical(data$median, 15.5)
  whole <- density(returns, from = 10, to = 40)
  expect_identical(data$density, data.frame(x = whole$x, y = whole$y))
  expect_identical(range(data$density$x), c(10, 40))
  expect_gt(data$ylim[2], max(data$density$y))
})

test_that("equal returns, or a single one, have no density but a place", {
  for (returns in list(200, rep(200, 5), 0)) {
    data <- rollout_plot_data(rollout_of(returns))
    expect_null(data$density)
    expect_true(data$xlim[1] < returns[1] && returns[1] < data$xlim[2])
  }
})

test_that("any rollout plots, returns itself and leaves par and R's generator alone", {
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  graphics::plot.new()
  set.seed(1)
  played <- list(rollout_of(1), rollout_of(rep(-5, 3)), rollout_of(c(1, 2)), rollout_of(rexp(500)))
  before <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  state <- .Random.seed
  for (one in played) {
    expect_identical(expect_invisible(plot(one)), one)
  }
  expect_identical(.Random.seed, state)
  after <- graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd"))
  expect_identical(after, before)
})

test_that("the title names the environment and the policy", {
  expect_identical(played_title(rollout_of(1)), "Fake-v0, policy: random")
  env <- fake_environment(id = "CartPole-v1")
  expect_identical(
    played_title(rollout(env, policy_network())), "CartPole-v1, policy: network 4-2-1"
  )
})

test_that("a wrong type, or an argument of another type, is refused by name", {
  played <- rollout_of(1:3)
  expect_error(plot(played, type = "landscape"),
               "one of \"returns\", \"trajectory\", \"filmstrip\", not \"landscape\"",
               class = "gym_error_argument")
  expect_error(plot(played, type = "trajectory", xlim = 1:2), "`xlim`",
               class = "gym_error_argument")
})
