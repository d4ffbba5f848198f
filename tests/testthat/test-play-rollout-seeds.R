# Seeds, interrupts and candidates of a rollout.

by_seed <- function(seed, step, action) seed %% 10 + step
of_some_length <- function(seed, step, action) step == 1L + seed %% 7L
by_action <- function(seed, step, action) seed %% 3 + 10 * action

test_that("each episode is reset with its own seed", {
  env <- fake_environment()
  played <- rollout(env, policy_random(), episodes = 5, seed = 1)
  expect_identical(env$seeds, played$episodes$seed)
  expect_length(unique(env$seeds), 5)
})

test_that("set.seed() alone fixes seeds and sampled actions", {
  play <- function() {
    env <- fake_environment()
    played <- rollout(env, policy_random(), episodes = 5)
    list(played$episodes, env$actions)
  }
  set.seed(1)
  first <- play()
  second <- play()
  set.seed(1)
  expect_identical(play(), first)
  expect_false(identical(first, second))
})

test_that("a rollout's seed gives it again and leaves the session's generator as it was", {
  set.seed(1)
  drawn <- rollout(fake_environment(), policy_random(), episodes = 3, steps = TRUE)
  state <- .Random.seed
  again <- rollout(fake_environment(), policy_random(), 3, seed = drawn$seed, steps = TRUE)
  expect_identical(.Random.seed, state)
  expect_identical(again, drawn)
})

test_that("without a seed a rollout draws one number from the session's generator, and no more", {
  set.seed(1)
  seed <- draw_seed()
  wanted <- .Random.seed
  set.seed(1)
  drawing <- function(observation) sample(0:1, nrow(observation), replace = TRUE)
  expect_identical(rollout(fake_environment(), drawing, episodes = 3)$seed, seed)
  expect_identical(.Random.seed, wanted)
})

test_that("a seed means one rollout under every RNGkind(), which stays as it is", {
  withr::local_preserve_seed()
  drawing <- function(observation) as.integer(stats::rnorm(nrow(observation)) > stats::runif(1))
  play <- function(...) {
    suppressWarnings(RNGkind(...))
    before <- RNGkind()
    played <- rollout(fake_vector_env(3), drawing, 7, seed = 1, steps = TRUE)
    expect_identical(RNGkind(), before)
    played
  }
  first <- play("Mersenne-Twister", "Inversion", "Rejection")
  expect_identical(play("Wichmann-Hill", "Box-Muller", "Rounding"), first)
  expect_identical(play("Knuth-TAOCP-2002", "Ahrens-Dieter", "Rejection"), first)
  # A session that has drawn nothing.
  RNGkind("Super-Duper", "Inversion", "Rejection")
  rm(".Random.seed", envir = globalenv())
  expect_identical(rollout(fake_vector_env(3), drawing, 7, seed = 1, steps = TRUE), first)
  expect_false(exists(".Random.seed", globalenv(), inherits = FALSE))
  expect_identical(RNGkind()[[1L]], "Super-Duper")
})

test_that("an interrupt leaves the batches that were finished, and the generator as it was", {
  set.seed(1)
  state <- .Random.seed
  env <- fake_vector_env(2, "sync", "SameStep", ends = of_some_length)
  interrupting <- function(observation) {
    if (length(env$resets) == 3L) rlang::interrupt()
    rep(0L, nrow(observation))
  }
  expect_message(
    played <- rollout(env, interrupting, 20, seed = 2, steps = TRUE),
    "after 16 of 20 episodes", class = "gym_message_interrupted"
  )
  expect_identical(.Random.seed, state)
  expect_true(played$interrupted)
  still <- function(observation) rep(0L, nrow(observation))
  whole <- rollout(env, still, 16, seed = 2, steps = TRUE)
  expect_identical(played[c("episodes", "steps")], whole[c("episodes", "steps")])
  expect_output(print(played), "16 episodes")
})

test_that("an interrupt in the first batch leaves an empty rollout that prints", {
  expect_message(
    played <- rollout(fake_environment(), function(observation) rlang::interrupt(), steps = TRUE),
    "after 0 of 1 episode", class = "gym_message_interrupted"
  )
  expect_identical(nrow(played$episodes), 0L)
  expect_output(print(played), "0 episodes")
  expect_output(print(summary(played)), "0 episodes")
})

test_that("an error in the middle carries the batches before it, with its own classes", {
  env <- fake_vector_env(3, "sync", "SameStep")
  failing <- function(observation) {
    if (length(env$resets) == 2L) gym_abort("lost", class = "gym_error_connection", url = "there")
    rep(0L, nrow(observation))
  }
  cnd <- expect_error(rollout(env, failing, 20), "after 12 episodes", class = "gym_error_rollout")
  expect_s3_class(cnd, "gym_error_connection")
  expect_identical(cnd$url, "there")
  expect_identical(nrow(cnd$result$episodes), 12L)
})

test_that("several policies are candidates, each with its own episodes from the same seeds", {
  env <- fake_vector_env(7, ends = of_some_length, reward = by_action)
  policies <- list(
    policy_random(), function(observation) rep(1L, nrow(observation)),
    policy_network(c(4, 1), weights = list(matrix(c(1, 2, 3, 4), 1)))
  )
  played <- rollout(env, policies, episodes = 3, seed = 1, steps = TRUE)
  episodes <- played$episodes
  expect_identical(episodes$candidate, rep(1:3, each = 3))
  expect_identical(episodes$episode, rep(1:3, 3))
  expect_identical(episodes$seed, rep(episodes$seed[1:3], 3))
  expect_identical(names(played$steps)[1:3], c("candidate", "episode", "step"))
  for (i in 2:3) {
    alone <- rollout(env, policies[[i]], episodes = 3, seed = 1, steps = TRUE)
    own <- episodes[episodes$candidate == i, ]
    expect_identical(own$return, alone$episodes$return)
    expect_identical(own$length, alone$episodes$length)
    steps <- played$steps[played$steps$candidate == i, -1L]
    expect_equal(steps, alone$steps, ignore_attr = "row.names")
  }
})

test_that("a progress bar counts the episodes", {
  withr::local_options(cli.progress_show_after = 0, cli.dynamic = FALSE, cli.num_colors = 1)
  slow <- function(observation) {
    Sys.sleep(0.02)
    rep(0L, nrow(observation))
  }
  shown <- capture.output(
    rollout(fake_vector_env(2), slow, 20, progress = TRUE), type = "message"
  )
  expect_match(paste(shown, collapse = " "), "Episode [0-9]+ of 20")
})

test_that("what remembers earlier episodes plays them in one batch, one after the other", {
  skip_unless_all()
  client <- test_client()
  wrapped <- gym_wrap("CartPole-v1", "NormalizeReward")
  play <- function(n) {
    expect_message(
      played <- rollout(wrapped, policy_network(c(4, 1), weights = list(matrix(1:4, 1))), n,
                        seed = 1, client = client),
      "NormalizeReward remembers", class = "gym_message_remembers"
    )
    played$episodes
  }
  six <- play(6)
  expect_identical(six$sub_env, rep(1L, 6))
  expect_identical(play(2), six[1:2, ])
})

test_that("CartPole: the same seed plays the same episodes, another does not", {
  client <- test_client()
  play <- function(seed) {
    as.data.frame(rollout("CartPole-v1", policy_random(), 5, seed = seed, steps = TRUE,
                          client = client))
  }
  first <- play(1)
  expect_identical(play(1), first)
  expect_false(identical(play(2), first))
  expect_true(all(abs(first$pole_angle) < 0.4189))
})

first_observations <- function(played) {
  first <- as.matrix(played$steps[played$steps$step == 1, 3:6])
  rownames(first) <- NULL
  first
}

test_that("CartPole: a seed begins an episode again, in a vector environment with its number", {
  env <- local_env("CartPole-v1")
  played <- rollout(env, policy_random(), 3, seed = 1, steps = TRUE)
  expect_identical(env$reset(seed = played$episodes$seed[2]), first_observations(played)[2, ])
  expect_null(played$num_envs)
  client <- test_client()
  played <- rollout("CartPole-v1", policy_random(), 300, seed = 1, steps = TRUE, client = client)
  env <- local_env("CartPole-v1", num_envs = played$num_envs)
  for (i in c(2, 299)) {
    episode <- played$episodes[i, ]
    expect_identical(
      env$reset(seed = episode$seed)[episode$sub_env, ], first_observations(played)[i, ]
    )
  }
})

test_that("where each sub-environment has a seed, a single environment plays an episode again", {
  skip_unless_all()
  client <- test_client()
  skip_if_not(env_registry(client, "LunarLander-v3")$available, "the extra box2d")
  set.seed(1)
  policy <- policy_network(c(8, 4, 4))
  played <- rollout("LunarLander-v3", policy, 20, seed = 1, client = client)
  expect_null(played$num_envs)
  expect_identical(played$episodes$sub_env, 1:20)
  env <- local_env("LunarLander-v3")
  alone <- rollout(env, policy, 20, seed = 1)
  expect_identical(alone$episodes$seed, played$episodes$seed)
  expect_identical(alone$episodes$return, played$episodes$return)
})

test_that("more episodes than an integer counts, in all candidates together, are refused", {
  policies <- list(policy_random(), policy_random())
  expect_error(rollout(fake_environment(), policies, episodes = .Machine$integer.max),
               "`episodes` must be at most 1073741823 for each of 2 candidates",
               class = "gym_error_argument")
})
