# CartPole against Gymnasium's ----------------------------------------------------------

lean <- function(observation) observation[, 3] + 0.3 * observation[, 4] > 0

# Gymnasium computes in float64 as R does, and returns float32: a unit in the last of its 24 bits.
float32_bound <- 2^-23

# Largest difference by Gymnasium's numbers, where they are at least 0.1, as a share of them.
difference <- function(ours, its) max(abs(ours - its) / pmax(abs(its), 0.1))

test_that("CartPole in R, scalar and vectorised, is Gymnasium's to the last bit of float32", {
  skip_unless_all()
  n <- 6L
  server <- local_env("CartPole-v1", num_envs = n, vectorization_mode = "sync",
                      autoreset_mode = "Disabled")
  its <- as_vector_env(server)
  start <- its$reset(seeds = seq_len(n), which = seq_len(n))
  ours <- as_vector_env(r_cartpole_vectorized(start = start), num_envs = n)
  singles <- lapply(seq_len(n), function(i) {
    as_vector_env(r_cartpole(start = start[i, , drop = FALSE]), num_envs = 1)
  })
  expect_equal(ours$reset(1L), start, tolerance = 0, ignore_attr = TRUE)
  for (env in singles) env$reset(1L)
  playing <- seq_len(n)
  taken <- 0
  largest <- 0
  while (length(playing) && taken < 500) {
    taken <- taken + 1
    # Pushes the poles over one after the other.
    action <- as.integer((taken + playing) %% (playing + 1) > 0)
    out <- its$step(action, playing)
    mine <- ours$step(action, playing)
    alone <- lapply(seq_along(playing), function(k) singles[[playing[k]]]$step(action[k], 1L))
    expect_identical(mine$terminated, out$terminated)
    expect_identical(mine$truncated, out$truncated)
    expect_identical(vapply(alone, function(one) one$terminated, NA), out$terminated)
    single <- do.call(rbind, lapply(alone, function(one) one$observation))
    expect_equal(single, mine$observation, tolerance = 1e-14, ignore_attr = TRUE)
    largest <- max(largest, difference(mine$observation, out$observation))
    playing <- playing[!(out$terminated | out$truncated)]
  }
  expect_gt(taken, 20)
  expect_lt(largest, float32_bound * taken)
})

# The same actions whatever is observed: with others, a rounding error may tip an action.
scripted <- function() {
  at <- 0
  function(observation) {
    at <<- at + 1
    rep(as.integer(sin(at) > 0), nrow(observation))
  }
}

test_that("rollout() plays CartPole in R as Gymnasium's, from the same start by the same actions", {
  its <- rollout(local_env("CartPole-v1"), scripted(), episodes = 1, seed = 3, steps = TRUE)
  start <- as.matrix(its$steps[1, 3:6])
  for (env in list(r_cartpole(start = start),
                   r_cartpole_vectorized(start = start[rep(1, 256), ]))) {
    ours <- rollout(env, scripted(), episodes = 1, seed = 1, steps = TRUE)
    expect_identical(names(ours$steps), names(its$steps))
    expect_identical(ours$steps$action, its$steps$action)
    columns <- c("return", "length", "terminated", "truncated")
    expect_identical(ours$episodes[columns], its$episodes[columns])
    expect_gt(nrow(ours$steps), 10)
    expect_lt(difference(as.matrix(ours$steps[3:6]), as.matrix(its$steps[3:6])),
              float32_bound * nrow(ours$steps))
  }
})

# Batches -------------------------------------------------------------------------------

test_that("an environment of functions is played in copies, and does not move itself", {
  env <- r_cartpole()
  env$reset(seed = 1)
  before <- env$step(1)$observation
  vector_env <- as_vector_env(env)
  expect_s3_class(vector_env, "gym_vector_env")
  expect_identical(vector_env[c("num_envs", "batch_size", "one_seed", "remembers", "client")],
                   list(num_envs = 16L, batch_size = 64L, one_seed = FALSE,
                        remembers = character(), client = NULL))
  expect_identical(as_vector_env(env, max_envs = 3)[c("num_envs", "batch_size")],
                   list(num_envs = 3L, batch_size = 64L))
  expect_identical(as_vector_env(env, num_envs = 5)[c("num_envs", "batch_size")],
                   list(num_envs = 5L, batch_size = 20L))
  rollout(env, policy_random(), 3, seed = 1)
  again <- r_cartpole()
  again$reset(seed = 1)
  again$step(1)
  expect_identical(env$step(0), again$step(0))
})

test_that("a vectorised environment has 256 sub-environments and one seed", {
  vector_env <- as_vector_env(r_cartpole_vectorized(), max_envs = 3)
  expect_identical(vector_env[c("num_envs", "batch_size", "one_seed")],
                   list(num_envs = 256L, batch_size = 256L, one_seed = TRUE))
  four <- as_vector_env(r_cartpole_vectorized(), num_envs = 4)
  expect_identical(dim(four$reset(1L)), c(4L, 4L))
  expect_identical(colnames(four$reset(1L)), r_cartpole()$observation_space$names)
  expect_identical(four$reset(7L), four$reset(7L))
})

test_that("an episode starts by its seed alone, whoever plays it", {
  env <- r_cartpole()
  by_seed <- function(num_envs) {
    played <- rollout(env, lean, 20, seed = 1, max_steps = 1, steps = TRUE, num_envs = num_envs)
    vapply(seq_len(20), function(i) {
      env$reset(seed = played$episodes$seed[[i]])[[1]] == played$steps$cart_position[[i]]
    }, NA)
  }
  expect_true(all(by_seed(1)))
  expect_true(all(by_seed(7)))
})

test_that("results are the same whatever RNGkind() the session has, and move it not at all", {
  play <- function() {
    list(
      rollout(r_cartpole(), policy_random(), 20, seed = 1)$episodes,
      rollout(r_cartpole_vectorized(), policy_random(), 20, seed = 1)$episodes
    )
  }
  first <- play()
  withr::local_seed(1, .rng_kind = "Knuth-TAOCP-2002", .rng_sample_kind = "Rejection")
  before <- .Random.seed
  expect_identical(play(), first)
  expect_identical(.Random.seed, before)
})

test_that("the steps of sub-environments that have ended are ignored, whatever comes of them", {
  # Each ends after as many steps as its number, and returns nonsense from then on.
  env <- gym_env(
    reset = function(self) {
      self$step <- 0
      seq_len(self$num_envs)
    },
    step = function(self, action) {
      self$step <- self$step + 1
      numbers <- seq_len(self$num_envs)
      over <- self$step > numbers
      list(
        observation = ifelse(over, NA, numbers), reward = ifelse(over, NaN, 1),
        terminated = ifelse(over, NA, self$step == numbers)
      )
    },
    observation_space = space_discrete(8, start = 1), action_space = space_discrete(1),
    vectorized = TRUE
  )
  played <- rollout(env, policy_random(), 16, seed = 1, num_envs = 8)
  expect_identical(played$episodes$length, rep(1:8, 2))
  expect_identical(played$episodes$return, rep(1:8, 2) + 0)
})

test_that("the time limit cuts off every episode of a batch, and max_steps plays what never ends", {
  for (env in list(r_cartpole(max_episode_steps = 3), r_cartpole_vectorized(3))) {
    played <- rollout(env, lean, 20, seed = 1)
    expect_identical(played$episodes$length, rep(3L, 20))
    expect_true(all(played$episodes$truncated))
  }
  endless <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = 0, reward = 1, terminated = FALSE),
    observation_space = space_discrete(1), action_space = space_discrete(1)
  )
  expect_identical(rollout(endless, policy_random(), 3, max_steps = 50)$episodes$return,
                   rep(50, 3))
})

test_that("every kind of space is played", {
  skip_unless_all()
  spaces <- list(
    space_box(0, 255, shape = c(4L, 3L, 2L), dtype = "uint8"), space_box(-1, 1),
    space_box(-1, 1, shape = integer()), space_multi_discrete(c(2, 3)),
    space_multi_binary(c(2, 2)), space_text(4),
    space_tuple(space_discrete(2), space_box(0, 1, shape = 2)),
    space_dict(a = space_text(3), b = space_discrete(3))
  )
  for (space in spaces) {
    env <- gym_env(
      reset = function(self) space_sample(space),
      step = function(self, action) {
        stopifnot(space_contains(space, action))
        list(observation = space_sample(space), reward = 0, terminated = runif(1) < 0.3)
      },
      observation_space = space, action_space = space
    )
    expect_identical(nrow(rollout(env, policy_random(), 20, seed = 1)$episodes), 20L)
    expect_identical(rollout(env, policy_random(), 5, seed = 1, steps = TRUE)$steps,
                     rollout(env, policy_random(), 5, seed = 1, steps = TRUE)$steps)
  }
})

# Bad input ---------------------------------------------------------------------------

test_that("what vectorised functions return is refused in its step, with the sub-environment", {
  refused <- function(change, words, class = "gym_error_argument", from = 2) {
    env <- gym_env(
      reset = function(self) {
        self$step <- 0
        matrix(0, self$num_envs, 2)
      },
      step = function(self, action) {
        self$step <- self$step + 1
        n <- self$num_envs
        out <- list(
          observation = matrix(0, n, 2), reward = numeric(n), terminated = seq_len(n) == 1
        )
        if (self$step == 2) change(out) else out
      },
      observation_space = space_box(-1, 1, shape = 2), action_space = space_discrete(2),
      vectorized = TRUE, id = "Many"
    )
    cnd <- expect_error(rollout(env, policy_random(), 4, seed = 1, max_steps = 5, num_envs = 4),
                        class = class)
    expect_match(conditionMessage(cnd), words, fixed = TRUE)
    expect_match(conditionMessage(cnd), "`step()` of Many in step 2 of the episode", fixed = TRUE)
  }
  with <- function(...) function(out) utils::modifyList(out, list(...), keep.null = TRUE)
  refused(function(out) NULL, "must return a list, not NULL")
  refused(function(out) out[-3], "lacks `terminated`")
  refused(with(reward = 1), "must be a number for each of 4 sub-environments, not 1")
  refused(with(reward = c(0, 1, NA, 1)), "a number for each")
  refused(with(terminated = FALSE), "TRUE or FALSE for each of 4 sub-environments")
  refused(with(truncated = c(NA, NA, NA, NA)), "TRUE or FALSE")
  refused(with(observation = NULL), "does not fit the space", "gym_error_space")
  refused(with(observation = matrix(0, 3, 2)), "4, not 3", "gym_error_space")
  refused(with(observation = matrix(0, 4, 3)), "does not fit the space", "gym_error_space")
  refused(with(observation = rbind(0, 0, c(0, 9), 0)[, 1:2]), "Sub-environment 3",
          "gym_error_space")
})

test_that("num_envs, arguments and seeds that an environment cannot have are refused", {
  env <- r_cartpole()
  expect_error(as_vector_env(env, num_envs = 0), "whole number", class = "gym_error_argument")
  expect_error(as_vector_env(env, size = 3), "was made before", class = "gym_error_argument")
  expect_error(as_vector_env(env, num_envs = 2)$step(c(0, 1), 1:2), "has not been reset",
               class = "gym_error_argument")
  expect_error(env$reset(seed = -1), "whole number of at least 0", class = "gym_error_argument")
})

test_that("a vectorised environment is played by hand with a row for each sub-environment", {
  env <- r_cartpole_vectorized(num_envs = 3, max_episode_steps = 2)
  expect_identical(env$num_envs, 3L)
  expect_identical(env$observation_space$shape, c(3L, 4L))
  expect_identical(env$single_observation_space, cartpole_space())
  expect_identical(dim(env$reset(seed = 1)), c(3L, 4L))
  out <- env$step(c(1, 0, 1))
  expect_identical(out$done, logical(3))
  expect_identical(env$step(c(1, 0, 1))$truncated, rep(TRUE, 3))
  expect_warning(env$step(c(1, 0, 1)), class = "gym_warning_step_after_done")
  expect_error(env$step(1), "3, not 1", class = "gym_error_space")
  expect_error(env$step(c(0, 2, 1)), "Sub-environment 2", class = "gym_error_space")
})
