follow_pole <- function(observation) as.integer(observation[, 3] > 0)

test_that("a function is asked about a matrix, also when there is one observation", {
  expect_identical(act(follow_pole, c(0, 0, 0.1, 0)), 1L)
  expect_identical(act(follow_pole, rbind(c(0, 0, 0.1, 0), c(0, 0, -0.1, 0))), 1:0)
  expect_identical(act(function(observation) dim(observation), matrix(0, 2, 3)), 2:3)
  expect_identical(act(function(observation) 2 * observation, c(1, 2, 3)), c(2, 4, 6))
  into_array <- function(observation) array(observation, c(1, 2, 2))
  expect_identical(act(into_array, c(1, 2, 3, 4)), matrix(c(1, 2, 3, 4), 2))
  expect_error(act(function(observation) c(1, 2), c(1, 2, 3)),
               "one action for the one observation, not 2 actions", class = "gym_error_argument")
})

test_that("a rollout asks once for the actions of all sub-environments that are playing", {
  rows <- integer()
  count <- function(observation) {
    rows <<- c(rows, nrow(observation))
    follow_pole(observation)
  }
  lengths <- function(seed, step, action) step == 1L + seed %% 3L
  env <- fake_vector_env(5, ends = lengths)
  played <- rollout(env, count, episodes = 5, seed = 1)
  # First about one, to see whether it can.
  expect_identical(rows, c(1L, vapply(seq_len(max(played$episodes$length)), function(step) {
    sum(played$episodes$length >= step)
  }, 0L)))
  rows <- integer()
  rollout(fake_environment(), count, episodes = 2)
  expect_identical(rows, rep(1L, 6))
})

test_that("actions of one number may be a vector, a column or logical", {
  discrete <- list(
    function(observation) observation[, 3] > 0,
    function(observation) observation[, 3, drop = FALSE] > 0,
    function(observation) as.numeric(observation[, 3] > 0)
  )
  play <- function(policy, ...) {
    rollout(fake_vector_env(3, ...), policy, episodes = 5, seed = 1, steps = TRUE)$steps
  }
  wanted <- play(follow_pole)
  for (policy in discrete) {
    expect_equal(play(policy), wanted)
    expect_identical(play(policy)$episode, wanted$episode)
  }
  torque <- function(observation) observation[, 1]
  column <- function(observation) observation[, 1, drop = FALSE]
  box <- box_space(-1, 1)
  expect_identical(play(torque, action_space = box), play(column, action_space = box))
  steps <- rollout(fake_environment(action_space = box), torque, steps = TRUE)$steps
  expect_identical(steps$action, steps$obs_1)
})

test_that("one action for many observations is refused, saying what came and how to write it", {
  for_one <- function(observation) as.integer(observation[3] > 0)
  cnd <- expect_error(rollout(fake_vector_env(5), for_one, 5), class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "for each of 5 observations, not 1 action.", fixed = TRUE)
  expect_match(conditionMessage(cnd), "`observation[, 3]`", fixed = TRUE)
  expect_identical(as.character(cnd$call[[1]]), "rollout")
})

test_that("an action with several numbers is a row", {
  env <- fake_environment(action_space = box_space(c(-1, 9), c(1, 10)))
  cnd <- expect_error(rollout(env, function(observation) c(0.5, 9.5)),
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "for the one observation, not c(0.5, 9.5)", fixed = TRUE)
  expect_match(conditionMessage(cnd), "An action of <Box float32 [2]> is a row", fixed = TRUE)
})

test_that("observations and actions with parts have them batched, in any order of names", {
  space <- new_space(describe_dict(
    a = describe_box(c(-1, -1), c(1, 1)), b = list(name = "Discrete", n = 3L, dtype = "int64")
  ))
  sub_envs <- list(action_space = space, observation_space = space)
  actions <- list(b = c(1, 2), a = rbind(1:2, 3:4))
  expect_identical(batch_actions(actions, 2L, sub_envs), list(a = rbind(1:2, 3:4), b = c(1, 2)))
  expect_error(batch_actions(actions["a"], 2L, sub_envs),
               "each of 2 observations, not a list of length 1", class = "gym_error_argument")
  expect_error(batch_actions(actions, 3L, sub_envs), "each of 3 observations, not 2 actions",
               class = "gym_error_argument")
})

test_that("policies of other classes are asked by their own method, in vector environments too", {
  registerS3method("act", "follower", function(policy, observation, ...) follow_pole(observation),
                   envir = asNamespace("gym"))
  for (follower in list(
    structure(list(), class = "follower"),
    structure(list(), class = c("follower", "gym_policy")),
    # One that is a function as well is not called as one.
    structure(function(observation) stop(), class = c("follower", "function"))
  )) {
    played <- rollout(fake_vector_env(3), follower, episodes = 5, steps = TRUE)
    expect_identical(played$steps$action, as.integer(played$steps$obs_3 > 0))
  }
  follower <- structure(list(), class = "follower")
  played <- rollout(fake_environment(), follower)
  expect_output(print(played), "Policy: an object of class follower")
  map <- decision_map(fake_environment(), follower, x = 3, y = 4)
  expect_output(print(map), "Policy: an object of class follower")
  expect_error(search_random(fake_environment(), follower),
               "policy with weights, not an object of class follower", class = "gym_error_argument")
  expect_error(rollout(fake_environment(), structure(list(), class = "stranger")),
               "must be a policy or a function", class = "gym_error_argument")
})

test_that("a function of a class without a method of its own is a function", {
  kept <- structure(follow_pole, class = c("kept", "function"))
  expect_identical(rollout(fake_vector_env(3), kept, 5, seed = 1)$episodes,
                   rollout(fake_vector_env(3), follow_pole, 5, seed = 1)$episodes)
})

test_that("a function without an argument is refused before anything is made", {
  expect_error(rollout("CartPole-v1", function() 1L, client = no_client()),
               "function of observations; this one has no argument", class = "gym_error_argument")
  # Primitives declare their arguments in another way, or not at all.
  env <- fake_environment(action_space = box_space(-1, 1))
  expect_identical(rollout(env, length)$episodes$length, 3L)
})

test_that("a function that cannot be asked about one observation fails before the first step", {
  # One row of a matrix is a vector here, which has no columns.
  drops <- function(observation) {
    as.integer(observation[seq_len(nrow(observation)), ][, 3] > 0)
  }
  env <- fake_vector_env(3, ends = function(seed, step, action) step == 1L + seed %% 3L)
  cnd <- expect_error(rollout(env, drops, 3, seed = 1), class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "failed for a single observation, before the first step")
  expect_match(conditionMessage(cnd$parent), "number of dimensions")
  own <- function(observation) rlang::abort("no", class = "my_stop")
  expect_error(rollout(env, own, 3), class = "my_stop")
  expect_identical(env$sub_env_steps, 0L)
  all_same <- function(observation) rep(1L, max(nrow(observation), 2L))
  expect_error(rollout(env, all_same, 3), "for the one observation, not 2 actions",
               class = "gym_error_argument")
  expect_identical(env$sub_env_steps, 0L)
})

test_that("asking a function beforehand moves no generator and is done once a rollout", {
  draws <- function(observation) {
    asked <<- asked + 1L
    sample(0:1, nrow(observation), replace = TRUE)
  }
  asked <- 0L
  env <- fake_vector_env(2, "vector_entry_point")
  played <- rollout(env, draws, 6, seed = 1, steps = TRUE)
  expect_identical(asked, 3L * 3L + 1L)
  # Each batch draws from a stream of its own.
  streams <- new_streams(1)
  drawn <- lapply(1:3, function(batch) {
    generator <- new_generator(stream = take_stream(streams))
    with_generator(generator, t(replicate(3, sample(0:1, 2, replace = TRUE))))
  })
  expect_identical(played$steps$action, unlist(drawn))
})

test_that("the hint for a function of a single observation names a part that there is", {
  hint <- function(id, n) {
    for_one <- function(observation) as.integer(observation[[1]] > 0)
    env <- fake_vector_env(3, id = id, observation_space = box_space(rep(-1, n), rep(1, n)))
    conditionMessage(expect_error(rollout(env, for_one, 3), class = "gym_error_argument"))
  }
  expect_match(hint("CartPole-v1", 4), "`observation[, \"pole_angle\"]`", fixed = TRUE)
  expect_match(hint("MountainCar-v0", 2), "`observation[, \"velocity\"]`", fixed = TRUE)
  expect_match(hint("Other-v0", 4), "`observation[, 3]`", fixed = TRUE)
})

test_that("the hint for a function that misspells a name lists the names", {
  hint <- function(policy, ...) {
    env <- fake_vector_env(3, ...)
    conditionMessage(expect_error(rollout(env, policy, 3), class = "gym_error_argument"))
  }
  expect_match(
    hint(function(observation) observation[, "pole_angl"] > 0, id = "CartPole-v1"),
    "`cart_position`, `cart_velocity`, `pole_angle`, `pole_angular_velocity`", fixed = TRUE
  )
  parts <- space_dict(near = discrete_space(2L), far = discrete_space(2L))
  expect_match(observations_hint(parts), "`near`, `far`", fixed = TRUE)
})

test_that("if () for many observations is told how to decide for each", {
  skip_if(getRversion() < "4.2", "if () takes the first of several")
  one <- function(observation) if (observation[, 3] > 0) 1 else 0
  vector_env <- list(observation_space = box_space(rep(-9, 4), rep(9, 4)), call = quote(rollout()))
  cnd <- expect_error(naming_call(one(matrix(0, 2, 4)), vector_env), "failed for several",
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`ifelse()` and `&` work for each", fixed = TRUE)
  expect_match(conditionMessage(cnd), "`observation[, 3]`", fixed = TRUE)
})

# Remembers the sum of what it observed, and returns it as its action.
summing <- policy_memory(
  function(observation, memory) {
    sum <- memory[, "sum"] + observation[, 1]
    list(action = sum, memory = cbind(sum = sum))
  },
  initial = c(sum = 0)
)

box <- box_space(-Inf, Inf)
ends <- function(seed, step, action) step == 2L + seed %% 3L

test_that("every episode has a memory of its own, whatever plays beside it and before it", {
  sums <- function(num_envs) {
    steps <- rollout(
      fake_vector_env(num_envs, ends = ends, action_space = box), summing, episodes = 6, seed = 1,
      steps = TRUE
    )$steps
    for (episode in split(steps, steps$episode)) {
      expect_equal(episode$action, cumsum(episode$obs_1))
    }
    steps[order(steps$episode), ]
  }
  sums(3)
  sums(1)
})

test_that("a memory without names may come back with some", {
  named <- policy_memory(function(observation, memory) {
    last <- observation[, 1]
    list(action = memory[, 1], memory = cbind(last))
  }, 0)
  expect_identical(unname(act(named, c(2, 0), rbind(3))$action), 3)
})

test_that("by hand the memory goes from call to call, and begins with the initial one", {
  first <- act(summing, c(2, 0))
  expect_equal(first, list(action = 2, memory = cbind(sum = 2)), ignore_attr = TRUE)
  expect_equal(act(summing, c(3, 0), first$memory)$action, 5)
  expect_equal(act(summing, rbind(c(1, 0), c(2, 0)))$action, c(1, 2))
})

test_that("played by hand from the same seeds it has the same returns", {
  env <- local_env("CartPole-v1")
  pid <- policy_memory(
    function(observation, memory) {
      error <- observation[, 3]
      push <- error + 10 * (error - memory$error)
      list(action = as.integer(push > 0), memory = data.frame(error = error, n = memory$n + 1L))
    },
    initial = list(error = 0, n = 0L)
  )
  played <- rollout(env, pid, episodes = 2, seed = 4)$episodes
  returns <- vapply(played$seed, function(seed) {
    observation <- env$reset(seed = seed)
    memory <- NULL
    total <- 0
    repeat {
      said <- act(pid, observation, memory)
      memory <- said$memory
      step <- env$step(said$action)
      total <- total + step$reward
      if (step$terminated || step$truncated) break
      observation <- step$observation
    }
    total
  }, 0)
  expect_identical(played$return, returns)
})

test_that("it is compared with other policies, and is saved", {
  policies <- list(sum = summing, twice = function(observation) 2 * observation[, 1])
  steps <- rollout(
    fake_vector_env(3, ends = ends, action_space = box), policies, episodes = 4, seed = 1,
    steps = TRUE
  )$steps
  for (episode in split(steps, list(steps$candidate, steps$episode))) {
    wanted <- if (episode$candidate[[1]] == 1) cumsum(episode$obs_1) else 2 * episode$obs_1
    expect_equal(episode$action, wanted)
  }
  file <- withr::local_tempfile()
  saveRDS(summing, file)
  expect_identical(unname(act(readRDS(file), c(2, 0))$action), 2)
})

test_that("what has no memory to keep is refused in one sentence with an example", {
  refused <- function(code, text) {
    cnd <- expect_error(code, class = "gym_error_argument")
    expect_match(conditionMessage(cnd), text, fixed = TRUE)
  }
  refused(policy_memory(function(observation) 1, 0),
          "a function of `observation` and `memory`, not of `observation` alone")
  refused(policy_memory(summing$act), "`initial` is missing")
  refused(policy_memory(summing$act, list(a = 1:2)), "the memory of one episode")
  refused(policy_memory(summing$act, NULL), "the memory of one episode")
  play <- function(act) {
    rollout(fake_vector_env(2, action_space = box), policy_memory(act, c(a = 0)), episodes = 2)
  }
  refused(play(function(observation, memory) observation[, 1]), "a list of `action` and `memory`")
  refused(
    play(function(observation, memory) list(action = 0, memory = memory[1, , drop = FALSE])),
    "a `memory` of 2 rows and 1 column, as it was given (a), not 1 row and 1 column"
  )
  refused(
    decision_map("CartPole-v1", summing, x = 1, y = 2, client = test_client()),
    "The policy has a memory"
  )
})

test_that("a mistake in the function is found before the first step, with what a memory is", {
  counting <- function(initial) {
    policy_memory(function(observation, memory) {
      memory$n <- memory$n + 1
      list(action = memory$n, memory = memory)
    }, initial)
  }
  play <- function(policy) rollout(fake_vector_env(2, action_space = box), policy, episodes = 2)
  expect_identical(nrow(play(counting(list(n = 0)))$episodes), 2L)
  expect_error(play(counting(c(n = 0))), "memory\\[, \"n\"\\]", class = "gym_error_argument")
})

test_that("it prints what it remembers", {
  expect_identical(format(policy_memory(summing$act, c(a = 0, b = 0, c = 0))),
                   "a function with a memory of a, b and c")
  expect_identical(policy_label(summing), "a function with a memory")
  expect_error(predict(summing, c(1, 2)), "act(policy, observation, memory)", fixed = TRUE,
               class = "gym_error_argument")
})
