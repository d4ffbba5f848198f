# Episodes that last from 1 to 7 steps, by their seed.
of_some_length <- function(seed, step, action) step == 1L + seed %% 7L
by_seed_and_step <- function(seed, step, action) seed %% 10 + step / 10
by_action <- function(seed, step, action) seed %% 3 + 10 * action

every_kind <- function(num_envs, ...) {
  list(
    fake_vector_env(num_envs, "sync", ...), fake_vector_env(num_envs, "sync", "NextStep", ...),
    fake_vector_env(num_envs, "async", "SameStep", ...),
    fake_vector_env(num_envs, "vector_entry_point", ...)
  )
}

# What a single environment makes of these seeds.
one_by_one <- function(seeds, policy, ...) {
  env <- fake_environment(...)
  played <- lapply(seeds, function(seed) {
    observation <- env$reset(seed = seed)
    total <- 0
    repeat {
      out <- env$step(act(policy, observation))
      total <- total + out$reward
      if (out$done) break
      observation <- out$observation
    }
    list(return = total, length = env$at)
  })
  list(
    return = vapply(played, function(one) one$return, 0),
    length = vapply(played, function(one) one$length, 0L)
  )
}

test_that("sub-environment i of n plays the episodes i, i + n and so on, each to its end", {
  for (env in every_kind(4, ends = of_some_length)) {
    episodes <- rollout(env, policy_random(), episodes = 10, seed = 1)$episodes
    expect_identical(episodes$sub_env, c(1:4, 1:4, 1:2))
    expect_true(all(episodes$terminated))
    seeds <- if (env$vectorization_mode == "vector_entry_point") {
      episodes$seed %% 1e8 + 17L * episodes$sub_env
    } else {
      episodes$seed
    }
    expect_identical(episodes$length, as.integer(1 + seeds %% 7))
  }
})

test_that("an episode is the same in a vector environment and alone", {
  set.seed(1)
  policy <- policy_network()
  env <- fake_vector_env(5, ends = of_some_length, reward = by_action)
  episodes <- rollout(env, policy, episodes = 23, seed = 2)$episodes
  alone <- one_by_one(episodes$seed, policy, ends = of_some_length, reward = by_action)
  expect_identical(episodes$return, alone$return)
  expect_identical(episodes$length, alone$length)
})

test_that("vector environments of every mode play the same episodes from the same seeds", {
  play <- function(mode, autoreset) {
    env <- fake_vector_env(5, mode, autoreset, ends = of_some_length, reward = by_action)
    rollout(env, policy_random(), episodes = 23, seed = 2, steps = TRUE)
  }
  wanted <- play("sync", "Disabled")
  expect_identical(play("sync", "NextStep"), wanted)
  expect_identical(play("async", "NextStep"), wanted)
  expect_identical(play("async", "SameStep"), wanted)
  expect_identical(play("sync", "SameStep"), wanted)
})

test_that("episodes that the environment begins by itself are those that are reset one by one", {
  skip_unless_all()
  sampling <- function(observation) {
    as.integer(stats::runif(nrow(observation)) < stats::plogis(observation[, 1L]))
  }
  networks <- policy_candidates(policy_network(c(4, 1)), rbind(1:4, c(1, -1, 1, -1), 4:1))
  policies <- list(policy_random(), sampling, networks, list(sampling, policy_random()))
  for (policy in policies) {
    for (max_steps in list(NULL, 3)) {
      play <- function(autoreset) {
        env <- fake_vector_env(5, "sync", autoreset, ends = of_some_length, reward = by_action)
        rollout(env, policy, episodes = 33, seed = 2, steps = TRUE, max_steps = max_steps,
                next_observation = TRUE)
      }
      expect_identical(play("SameStep"), play("Disabled"))
    }
  }
})

test_that("the seeds of all episodes go along with the reset, and no message more is sent", {
  env <- fake_vector_env(3, "async", "SameStep", ends = of_some_length)
  played <- rollout(env, policy_random(), episodes = 11, seed = 1)$episodes
  expect_length(env$resets, 1)
  expect_identical(lapply(env$resets[[1]], as.integer),
                   unname(split(played$seed, played$sub_env)))
  busiest <- max(tapply(played$length, played$sub_env, sum))
  expect_identical(env$messages, 1L + busiest)
  # Nobody steps who has nothing to play.
  expect_identical(env$sub_env_steps, sum(played$length))
})

test_that("an episode that `max_steps` cuts short is followed by a reset with the other seeds", {
  env <- fake_vector_env(2, "sync", "SameStep", ends = of_some_length)
  played <- rollout(env, policy_random(), episodes = 8, seed = 1, max_steps = 3)$episodes
  cut <- played[played$truncated, ]
  followed <- cut[cut$episode <= 6, ]
  reset <- unlist(lapply(env$resets[-1L], function(seeds) Filter(Negate(anyNA), seeds)),
                  recursive = FALSE)
  wanted <- lapply(followed$episode, function(episode) {
    as.numeric(played$seed[seq(episode + 2L, 8L, by = 2L)])
  })
  by_first <- function(seeds) seeds[order(vapply(seeds, `[[`, 0, 1L))]
  expect_gt(nrow(followed), 1L)
  expect_identical(by_first(lapply(reset, as.numeric)), by_first(wanted))
})

test_that("a sub-environment that has ended takes no further step where it need not", {
  env <- fake_vector_env(4, ends = of_some_length)
  played <- rollout(env, policy_random(), episodes = 10, seed = 1)
  expect_identical(env$sub_env_steps, sum(played$episodes$length))
})

test_that("an episode in sub-environments that share a seed can begin again by seed and number", {
  env <- fake_vector_env(4, "vector_entry_point", ends = of_some_length)
  played <- rollout(env, policy_random(), episodes = 10, seed = 1, steps = TRUE)
  expect_identical(played$num_envs, 4L)
  first <- played$steps[played$steps$step == 1, 3:6]
  for (i in 1:10) {
    observation <- env$reset(seed = played$episodes$seed[i])
    row <- observation[played$episodes$sub_env[i], ]
    expect_identical(row, unlist(first[i, ], use.names = FALSE))
  }
  # Elsewhere the seed is enough.
  expect_null(rollout(fake_vector_env(4), policy_random())$num_envs)
})

test_that("the steps are those of one episode after the other", {
  for (env in every_kind(4, ends = of_some_length, reward = by_seed_and_step)) {
    played <- rollout(env, policy_network(), episodes = 10, seed = 1, steps = TRUE)
    steps <- played$steps
    expect_identical(steps$episode, rep(1:10, played$episodes$length))
    expect_identical(steps$step, sequence(played$episodes$length))
    expect_equal(as.vector(tapply(steps$reward, steps$episode, sum)), played$episodes$return)
    expect_identical(steps$terminated, steps$step == played$episodes$length[steps$episode])
    expect_identical(steps$action, act(played$policy, unname(as.matrix(steps[3:6]))))
    seed <- played$episodes$seed[steps$episode]
    if (env$vectorization_mode == "vector_entry_point") {
      seed <- seed %% 1e8 + 17L * played$episodes$sub_env[steps$episode]
    }
    expect_identical(steps$obs_1, sin(seed %% 1000 + steps$step))
  }
})

test_that("max_steps cuts short all episodes that have not ended", {
  for (env in every_kind(4, ends = of_some_length)) {
    whole <- rollout(env, policy_random(), episodes = 10, seed = 1)$episodes
    cut <- rollout(env, policy_random(), episodes = 10, seed = 1, max_steps = 3, steps = TRUE)
    expect_identical(cut$episodes$length, pmin(whole$length, 3L))
    expect_identical(cut$episodes$truncated, whole$length > 3L)
    expect_identical(cut$episodes$terminated, whole$length <= 3L)
    expect_identical(sum(cut$steps$truncated), sum(whole$length > 3L))
  }
})

test_that("fewer episodes are the beginning of more", {
  for (env in every_kind(4, ends = of_some_length, reward = by_action)) {
    policy <- policy_network()
    play <- function(n) rollout(env, policy, episodes = n, seed = 1)$episodes
    expect_identical(play(3), play(11)[1:3, ])
    expect_identical(play(6), play(11)[1:6, ])
  }
})

test_that("a seed begins the same episodes whatever policy plays them", {
  for (env in every_kind(4)) {
    random <- rollout(env, policy_random(), episodes = 10, seed = 1)$episodes
    fixed <- rollout(env, function(observation) integer(nrow(observation)), 10, seed = 1)$episodes
    expect_identical(random$seed, fixed$seed)
  }
})

test_that("observations and actions of every shape have a row for each episode that is playing", {
  array_space <- box_space(rep(-1, 6), rep(1, 6), shape = c(2L, 3L))
  for (env in every_kind(4, ends = of_some_length, observation_space = array_space,
                         action_space = array_space)) {
    seen <- list()
    negate <- function(observation) {
      seen[[length(seen) + 1L]] <<- observation
      -observation
    }
    steps <- rollout(env, negate, episodes = 5, seed = 1, steps = TRUE)$steps
    expect_true(all(vapply(seen, function(o) identical(dim(o)[2:3], 2:3), NA)))
    # Once more than there are steps: beforehand, about one.
    expect_identical(sum(vapply(seen, function(o) dim(o)[1], 0L)), nrow(steps) + 1L)
    expect_identical(names(steps)[3:14], c(paste0("obs_", 1:6), paste0("action_", 1:6)))
    expect_identical(unname(as.matrix(steps[9:14])), -unname(as.matrix(steps[3:8])))
  }
  for (env in every_kind(4, ends = of_some_length, observation_space = discrete_space(16L),
                         action_space = box_space(-2, 2))) {
    half <- function(observation) observation / 16
    steps <- rollout(env, half, episodes = 5, seed = 1, steps = TRUE)$steps
    expect_type(steps$obs_1, "integer")
    expect_identical(steps$action, steps$obs_1 / 16)
  }
})

test_that("sub-environments that must step together, but cannot once they ended, are refused", {
  env <- fake_vector_env(2, "vector_entry_point", "Disabled")
  expect_error(rollout(env, policy_random()), "\"Disabled\".*NextStep",
               class = "gym_error_argument")
  expect_length(env$resets, 0)
})

test_that("an error in the middle is the error", {
  env <- fake_vector_env(4)
  expect_error(rollout(env, function(observation) stop("no idea")), "no idea")
})
