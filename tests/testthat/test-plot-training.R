autoplot <- ggplot2::autoplot

trained_in_fake <- function(...) {
  train_agent(agent_ars(directions = 3), fake_environment(reward = first_action), iterations = 7,
              seed = 1, eval_every = 2, eval_episodes = 4, ...)
}

test_that("the picture shows candidates, median, evaluations, target and final evaluation", {
  trained <- trained_in_fake(target = 30)
  picture <- drawn(autoplot(trained))
  expect_identical(layers_of(picture, "GeomRibbon")[[1]]$ymax, trained$history$max_return)
  expect_identical(layers_of(picture, "GeomLine")[[1]]$y, trained$history$median_return)
  points <- layers_of(picture, "GeomPoint")
  expect_identical(points[[1]]$x, c(36, 72, 108))
  expect_identical(points[[1]]$y, trained$evaluations$mean_return[1:3])
  expect_identical(points[[2]]$x, 126)
  expect_identical(points[[2]]$y, trained$final$mean_return)
  expect_identical(layers_of(picture, "GeomLinerange")[[1]]$ymax, trained$final$upper)
  expect_identical(layers_of(picture, "GeomHline")[[1]]$yintercept, 30)
  expect_identical(picture$labels$title, "ARS V2-t in Fake-v0")
  expect_identical(key_of(picture),
                   c("range of candidates", "their median", "the policy", "final evaluation",
                     "target 30"))
  # Hollow and filled circles.
  guide <- ggplot2::ggplot_build(picture)$plot$scales$get_scales("colour")$guide
  expect_identical(guide$override.aes$shape[3:4], c(1, 16))
})

test_that("a learner has no candidates, and no key has a target that is not there", {
  learned <- learn_q(walk_model(), iterations = 20, seed = 1)
  expect_identical(key_of(drawn(autoplot(learned))),
                   c("range of episodes", "their median", "the policy", "final evaluation"))
  expect_length(layers_of(autoplot(trained_in_fake(target = Inf)), "GeomHline"), 0)
  by_gradients <- train_agent(agent_reinforce(), fake_environment(), iterations = 2, seed = 1)
  expect_identical(key_of(autoplot(by_gradients))[[1]], "range of episodes")
})

test_that("a training without an iteration is refused", {
  env <- fake_environment()
  env$step <- function(action) rlang::interrupt()
  trained <- suppressMessages(train_agent(agent_ars(), env, iterations = 2, seed = 1))
  expect_error(plot(trained), "nothing to plot", class = "gym_error_argument")
})

search_of <- function(returns, rounds, ...) {
  search_random(
    scripted_environment(returns), rounds = rounds, episodes = length(returns) / rounds, ...
  )
}

test_that("the picture shows every episode, each round's mean and the target", {
  search <- search_of(c(1, 5, 9, 2, 2, 2), rounds = 2, target = 20)
  picture <- drawn(autoplot(search))
  points <- layers_of(picture, "GeomPoint")
  expect_identical(points[[1]]$y, c(1, 5, 9, 2, 2, 2))
  expect_identical(round(points[[1]]$x), rep(c(1, 2), each = 3))
  expect_identical(layers_of(picture, "GeomLine")[[1]]$y, c(5, 2))
  expect_identical(layers_of(picture, "GeomHline")[[1]]$yintercept, 20)
  expect_identical(key_of(picture), c("episode", "mean of the round", "target 20"))
})

test_that("a search of one round has its mean as a point, without a message", {
  picture <- drawn(autoplot(search_of(c(7, 9), rounds = 1, target = 5)))
  expect_identical(layers_of(picture, "GeomPoint")[[2]]$y, 8)
})

test_that("equal returns of a round lie side by side, and R's generator stays as it is", {
  search <- search_of(rep(7, 50), rounds = 1, seed = 1)
  set.seed(1)
  before <- .Random.seed
  points <- layers_of(drawn(autoplot(search)), "GeomPoint")[[1]]
  expect_length(unique(points$x), 50)
  expect_true(all(abs(points$x - 1) < 0.5 & points$y == 7))
  expect_identical(.Random.seed, before)
})

test_that("no target, or an infinite one, has neither a line nor a key", {
  for (target in list(NULL, Inf)) {
    picture <- drawn(autoplot(search_of(1:4, rounds = 2, target = target)))
    expect_length(layers_of(picture, "GeomHline"), 0)
    expect_identical(key_of(picture), c("episode", "mean of the round"))
  }
})

test_that("the subtitle says in which round a search was solved, or that it was not", {
  outcome <- function(...) autoplot(search_of(c(1, 9), rounds = 2, ...))$labels$subtitle
  expect_identical(outcome(target = 9), "solved in round 2")
  expect_identical(outcome(target = 10), "not solved in 2 rounds")
  expect_null(outcome())
})

test_that("a search shows its network", {
  search <- search_random(fake_environment(id = "CartPole-v1"), rounds = 2, seed = 1)
  expect_length(layers_of(drawn(autoplot(search, type = "network")), "GeomSegment"), 1)
  expect_error(plot(search, type = "tree"), "`type`", class = "gym_error_argument")
})
