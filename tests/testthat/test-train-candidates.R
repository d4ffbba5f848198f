modes <- c("sync", "vector_entry_point")

# What counts of a search, without how long it took and where.
figures <- function(search) search[c("policy", "solved", "round", "rounds", "episodes")]

test_that("of rounds played at once the first in order wins, not the first in time", {
  for (mode in modes) {
    env <- scripted_vector_env(
      8, returns = c(1, 2, 10, 30, 50, 50, 90, 90), lengths = c(4, 2, 9, 3, 1, 1, 20, 2), mode
    )
    search <- search_random(env, rounds = 4, episodes = 2, target = 20, seed = 1)
    expect_true(search$solved)
    expect_identical(search$round, 2L)
    expect_identical(
      search$rounds, data.frame(round = 1:2, mean_return = c(1.5, 20), steps = c(6L, 12L))
    )
    expect_identical(search$episodes$return, c(1, 2, 10, 30))
    expect_identical(search$episodes$length, c(4L, 2L, 9L, 3L))
    expect_identical(search$episodes$round, rep(1:2, each = 2))
    expect_identical(search$episodes$episode, rep(1:2, 2))
    expect_output(print(search), "2 rounds, 18 steps")
  }
})

test_that("an earlier round that fails after a later one has reached the target counts", {
  env <- scripted_vector_env(6, returns = c(1, 1, 50, 50, 90, 90), lengths = c(9, 9, 1, 1, 1, 1))
  search <- search_random(env, rounds = 3, episodes = 2, target = 20)
  expect_identical(search$round, 2L)
  expect_identical(search$rounds$mean_return, c(1, 50))
})

test_that("once the search is decided nothing more is played", {
  env <- scripted_vector_env(6, returns = c(1, 1, 50, 50, 90, 90), lengths = c(1, 1, 2, 2, 40, 40))
  search_random(env, rounds = 30, episodes = 2, target = 20)
  # The first round's sub-environments have begun the fourth round in between; no second batch.
  expect_identical(env$sub_env_steps, 6L + 6L)
  expect_length(env$resets, 1)
})

test_that("rounds after one that has reached the target are not waited for", {
  env <- scripted_vector_env(6, returns = c(1, 1, 50, 50, 90, 90), lengths = c(5, 5, 1, 1, 40, 40))
  search_random(env, rounds = 30, episodes = 2, target = 20)
  # After the first step only the first round plays, of which it is not yet known.
  expect_identical(env$sub_env_steps, 6L + 4L * 2L)
})

test_that("a round may begin in one batch and end in another", {
  # Each batch takes as many of these as it has room for, and plays the first of them.
  room <- list(vector_entry_point = 4, sync = 16)
  for (mode in modes) {
    end <- room[[mode]] + 1
    unused <- numeric(room[[mode]] - 1)
    returns <- c(1:end, unused, 21, rep(20, end - 3), 19, 20, unused, 90)
    lengths <- rep(c(3L, 1L), length.out = length(returns))
    env <- scripted_vector_env(4, returns, lengths, mode)
    search <- search_random(env, rounds = 4, episodes = end, target = 20)
    expect_identical(search$rounds$mean_return, c(mean(1:end), 20))
    expect_identical(search$episodes$return, returns[c(1:end, 2 * room[[mode]] + 1:end)])
    expect_identical(search$episodes$sub_env, rep(c(rep(1:4, length.out = end - 1), 1L), 2))
    expect_identical(search$round, 2L)
  }
})

test_that("without a target all rounds are played", {
  env <- scripted_vector_env(4, returns = 1:9, lengths = c(1:4, 1:4, 1L))
  search <- search_random(env, rounds = 3, episodes = 3)
  expect_identical(search$rounds$mean_return, c(2, 5, 8))
  expect_false(search$solved)
  expect_identical(search$round, 3L)
})

test_that("a shorter search is the beginning of a longer one, with the same policies", {
  skip_unless_all()
  for (mode in modes) {
    play <- function(rounds) {
      env <- fake_vector_env(16, mode, reward = first_action)
      search_random(env, rounds = rounds, target = Inf, seed = 1)
    }
    short <- play(20)
    long <- play(50)
    expect_identical(long$episodes[long$episodes$round <= 20, ], short$episodes)
    expect_identical(long$rounds[1:20, ], short$rounds)
    expect_identical(figures(play(50)), figures(long))
    expect_identical(short$policy, play(short$round)$policy)
  }
})

test_that("the policy returned is the one that was played in its round", {
  env <- fake_vector_env(16, reward = first_action)
  search <- search_random(env, rounds = 10, episodes = 3, target = Inf, seed = 1)
  played <- search$episodes[search$episodes$round == search$round, ]
  alone <- fake_environment(reward = first_action)
  again <- vapply(played$seed, function(seed) {
    action <- act(search$policy, alone$reset(seed = seed))
    alone$step(action)$reward
  }, 0)
  expect_identical(again, played$return)
})

test_that("an interrupt keeps the rounds of the batches that were finished", {
  play <- function(at) {
    env <- scripted_vector_env(4, returns = 1:8, lengths = c(1, 2, 2, 1, 9, 1, 1, 1),
                               "vector_entry_point")
    step <- env$step
    env$step <- function(...) {
      at <<- at - 1L
      if (at < 0L) rlang::interrupt()
      step(...)
    }
    suppressMessages(search_random(env, rounds = 9, episodes = 2, target = Inf))
  }
  # The first batch of two rounds takes two steps.
  search <- play(at = 3)
  expect_true(search$interrupted)
  expect_identical(search$rounds$mean_return, c(1.5, 3.5))
  expect_identical(search$round, 2L)
  none <- play(at = 1)
  expect_identical(nrow(none$rounds), 0L)
  expect_identical(nrow(none$episodes), 0L)
  expect_null(none$policy)
})

test_that("an error in the middle carries the rounds that were finished", {
  env <- scripted_vector_env(4, returns = 1:8, lengths = c(1, 2, 2, 1, 9, 1, 1, 1),
                             "vector_entry_point")
  step <- env$step
  env$step <- function(...) {
    if (env$sub_env_steps > 8L) gym_abort("lost", class = "gym_error_connection")
    step(...)
  }
  cnd <- tryCatch(search_random(env, episodes = 2, target = Inf), gym_error_search = identity)
  expect_s3_class(cnd, "gym_error_connection")
  expect_identical(cnd$result$rounds$mean_return, c(1.5, 3.5))
  expect_match(conditionMessage(cnd), "after 2 of 50 rounds")
})

test_that("the progress bar counts the rounds of a batch in their order, with the best so far", {
  env <- scripted_vector_env(4, returns = 1:8, lengths = c(3, 1, 2, 1, 1, 1, 1, 1),
                             "vector_entry_point")
  shown <- list()
  local_functions(
    progress_bar = function(...) {
      function(finished, note) shown[[length(shown) + 1L]] <<- list(as.numeric(finished), note)
    }
  )
  search_random(env, rounds = 4, episodes = 2, target = Inf, progress = TRUE)
  finished <- vapply(shown, function(one) one[[1L]], 0)
  expect_false(is.unsorted(finished))
  expect_identical(shown[[length(shown)]], list(4, "best mean return 7.5, "))
  expect_true(any(vapply(shown, identical, NA, list(2, "best mean return 3.5, "))))
})

test_that("there may be more rounds than R's integers count episodes", {
  search <- search_random("CartPole-v0", rounds = 1e9, target = 30, seed = 1,
                          client = test_client())
  expect_true(search$solved)
})
