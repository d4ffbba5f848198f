found <- function(env = fake_environment(reward = weights_matter), ...) {
  search_random(env, rounds = 4, episodes = 2, target = Inf, seed = 1, ...)
}

weights_matter <- function(seed, step, action) action * step + seed %% 7

# Of an episode, played step by step.
return_of <- function(seed, env, policy) {
  observation <- env$reset(seed = seed)
  total <- 0
  repeat {
    out <- env$step(act(policy, observation))
    total <- total + out$reward
    observation <- out$observation
    if (out$terminated || out$truncated) return(total)
  }
}

test_that("the middle is the best policy, its mean return that in the same episodes", {
  env <- fake_environment(reward = weights_matter)
  search <- found(env)
  landscape <- search_landscape(search, size = 5, episodes = 3, seed = 2)
  expect_identical(nrow(landscape$grid), 25L)
  middle <- landscape$grid[13, ]
  expect_identical(c(middle$a, middle$b), c(0, 0))
  returns <- vapply(landscape$seeds, return_of, 0, env = env, policy = search$policy)
  expect_length(returns, 3)
  expect_identical(landscape$best, mean(returns))
  expect_identical(middle$mean_return, mean(returns))
})

test_that("all networks play the same episodes", {
  env <- fake_environment(reward = function(seed, step, action) seed %% 1000)
  landscape <- search_landscape(found(env), size = 3, episodes = 4, seed = 1)
  expect_true(landscape$common)
  expect_length(unique(landscape$grid$mean_return), 1)
  expect_identical(env$seeds[-(1:8)], rep(landscape$seeds, 9))
})

test_that("a point's return is that of its network", {
  env <- fake_environment(
    reward = function(seed, step, action) action * 2^step,
    ends = function(seed, step, action) step == 8L
  )
  search <- found(env)
  landscape <- search_landscape(search, size = 3, episodes = 2, span = 2, seed = 5)
  # The two directions differ, or it would not matter which is which.
  field <- matrix(landscape$grid$mean_return, 3)
  expect_false(identical(field, t(field)))
  for (i in 1:9) {
    point <- landscape$grid[i, ]
    policy <- search$policy
    policy$weights <- Map(
      function(layer, first, second) layer + point$a * first + point$b * second,
      policy$weights, landscape$directions[[1]], landscape$directions[[2]]
    )
    returns <- vapply(landscape$seeds, function(seed) {
      observation <- env$reset(seed = seed)
      sum(vapply(1:8, function(step) {
        out <- env$step(act(policy, observation))
        observation <<- out$observation
        out$reward
      }, 0))
    }, 0)
    expect_identical(point$mean_return, mean(returns))
  }
  expect_identical(range(landscape$grid$a), c(-2, 2))
})

test_that("each neuron's directions are as long as its weights, and at right angles", {
  set.seed(1)
  weights <- policy_network(c(4, 3, 1, 2))$weights
  directions <- draw_directions(weights)
  for (layer in seq_along(weights)) {
    for (direction in directions) {
      expect_equal(rowSums(direction[[layer]]^2), rowSums(weights[[layer]]^2))
    }
    if (ncol(weights[[layer]]) > 1L) {
      expect_equal(rowSums(directions[[1]][[layer]] * directions[[2]][[layer]]),
                   numeric(nrow(weights[[layer]])))
    }
  }
})

test_that("the seed fixes it and leaves R's generator alone", {
  search <- found()
  set.seed(3)
  beforehand <- search_landscape(search, size = 3, episodes = 2)
  set.seed(3)
  seeded <- search_landscape(search, size = 3, episodes = 2, seed = draw_seed())
  expect_identical(seeded$grid, beforehand$grid)
  state <- .Random.seed
  search_landscape(search, size = 3, episodes = 2, seed = 3)
  expect_identical(.Random.seed, state)
  other <- search_landscape(search, size = 3, episodes = 2, seed = 4)
  expect_false(identical(other$directions, seeded$directions))
})

test_that("where each sub-environment has a seed of its own it is the same landscape", {
  alone <- fake_environment(reward = weights_matter)
  search <- found(alone)
  single <- search_landscape(search, size = 5, episodes = 3, seed = 1)
  search$env <- fake_vector_env(7, "sync", reward = weights_matter)
  sub_envs <- search_landscape(search, size = 5, episodes = 3, seed = 1)
  expect_identical(sub_envs$grid, single$grid)
  expect_identical(sub_envs$seeds, single$seeds)
})

test_that("where sub-environments share a seed the result says that the episodes differ", {
  search <- found(fake_vector_env(6, "vector_entry_point", reward = weights_matter))
  landscape <- search_landscape(search, size = 3, episodes = 2, seed = 1)
  expect_false(landscape$common)
  expect_false(anyNA(landscape$grid$mean_return))
  expect_no_match(paste(capture.output(print(landscape)), collapse = ""), "the same for all")
})

test_that("an interrupt leaves the networks that were played, with a message", {
  env <- fake_environment(reward = weights_matter)
  search <- found(env)
  step <- env$step
  env$step <- function(action) if (length(env$seeds) == 13L) rlang::interrupt() else step(action)
  expect_message(
    landscape <- search_landscape(search, size = 3, episodes = 2, seed = 1),
    "after 2 of 9 networks", class = "gym_message_interrupted"
  )
  expect_true(landscape$interrupted)
  expect_identical(is.na(landscape$grid$mean_return), rep(c(FALSE, TRUE), c(2, 7)))
  expect_identical(landscape$best, NA_real_)
  expect_output(print(landscape), "Interrupted after")
  local_device()
  expect_silent(plot(landscape))
})

test_that("bad arguments are refused, naming argument and value", {
  search <- found()
  bad <- function(..., message) {
    expect_error(search_landscape(...), message, fixed = TRUE, class = "gym_error_argument")
  }
  bad(3, message = "`search` must be a search")
  bad(search, size = 4, message = "`size` must be odd")
  bad(search, size = 1, message = "`size`")
  bad(search, span = 0, message = "`span` must be a number above 0, not 0.")
  bad(search, episodes = 0, message = "`episodes`")
  bad(search, seed = 1.5, message = "`seed`")
  bad(search, progress = 1, message = "`progress`")
  search["policy"] <- list(NULL)
  bad(search, message = "no policy")
})

test_that("CartPole: the landscape's middle is the best policy, and nothing stays open", {
  skip_unless_all()
  client <- local_server()
  search <- search_random("CartPole-v0", rounds = 20, seed = 1, client = client)
  landscape <- search_landscape(search, size = 3, span = 0.5, episodes = 2, seed = 1)
  expect_true(landscape$common)
  expect_length(env_list_all(client), 0)
  wider <- search_landscape(search, size = 5, span = 1, episodes = 2, seed = 1)
  expect_identical(wider$seeds, landscape$seeds)
  expect_identical(wider$best, landscape$best)
})

test_that("each point of a Gaussian network has the standard deviations of the best policy", {
  policy <- policy_network(c(3, 2), output = "gaussian", log_std = c(-1, 2))
  plane <- new_plane(policy, draw_directions(policy$weights), 3, 1)
  expect_identical(unname(plane$policy$weights[, 7:8]), matrix(c(-1, 2), 9, 2, byrow = TRUE))
  expect_identical(plane$policy$weights[5, ], coef(policy))
})
