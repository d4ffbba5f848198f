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
