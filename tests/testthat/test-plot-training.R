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
