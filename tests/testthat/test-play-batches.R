# The rule as a table: for each batch "candidate:episode ...".
batches <- function(size, candidates, episodes) {
  candidate <- rep(seq_len(candidates), each = episodes)
  episode <- rep(seq_len(episodes), candidates)
  numbers <- batch_numbers(size, candidate, episode)
  each <- split(paste0(candidate, ":", episode), numbers)
  unname(vapply(each, paste, "", collapse = " "))
}

test_that("a batch has as many whole candidates as there is room for", {
  expect_identical(
    batches(5, candidates = 5, episodes = 2),
    c("1:1 1:2 2:1 2:2", "3:1 3:2 4:1 4:2", "5:1 5:2")
  )
  expect_identical(batches(16, candidates = 2, episodes = 1), "1:1 2:1")
})

test_that("a candidate with more episodes than a batch has is cut into batches of its own", {
  expect_identical(
    batches(2, candidates = 2, episodes = 3), c("1:1 1:2", "1:3", "2:1 2:2", "2:3")
  )
  expect_identical(batches(1, candidates = 1, episodes = 2), c("1:1", "1:2"))
})

test_that("what remembers is played in one batch", {
  vector_env <- as_vector_env(fake_environment())
  count <- function() length(draw_batches(vector_env, new_history(2L, 40L, new_streams(1))))
  expect_gt(count(), 1L)
  vector_env$remembers <- "NormalizeReward"
  expect_identical(count(), 1L)
})

test_that("the first batches are the same however many candidates there are", {
  few <- batches(7, candidates = 5, episodes = 3)
  many <- batches(7, candidates = 50, episodes = 3)
  expect_identical(many[seq_len(2)], few[seq_len(2)])
})

# What a list of batches is made of when each is played in this order, some of them twice.
play_in_order <- function(make, policy, order) {
  env <- make()
  vector_env <- as_vector_env(env)
  vector_env$call <- rlang::current_env()
  policy <- policy_bind(policy, vector_env)
  history <- new_history(1L, 5L * vector_env$batch_size, new_streams(1))
  tasks <- draw_batches(vector_env, history)
  played <- vector("list", length(tasks))
  for (i in order(rep(seq_along(tasks), length.out = length(tasks)))[order]) {
    played[[i]] <- play_batch(
      vector_env, policy, tasks[[i]]$episodes, tasks[[i]]$stream, keep_steps = TRUE
    )
  }
  played
}

drawing <- function(observation) {
  as.integer(stats::runif(nrow(observation)) < stats::plogis(observation[, 1]))
}

test_that("a batch is the same in any order of batches, and when it is played again", {
  ends <- function(seed, step, action) step == 1L + seed %% 7L
  reward <- function(seed, step, action) seed %% 3 + 10 * action
  for (mode in c("sync", "async", "vector_entry_point")) {
    make <- function() fake_vector_env(2, mode, ends = ends, reward = reward)
    wanted <- play_in_order(make, drawing, 1:5)
    expect_identical(play_in_order(make, drawing, 5:1), wanted)
    expect_identical(play_in_order(make, drawing, c(2, 2, 4, 1, 3, 4, 5, 1)), wanted)
  }
})

test_that("so it is in Gymnasium's environments", {
  skip_unless_all()
  client <- test_client()
  for (mode in c("vector_entry_point", "sync")) {
    env <- local_env("CartPole-v1", num_envs = 4, vectorization_mode = mode, client = client)
    make <- function() env
    wanted <- play_in_order(make, drawing, 1:5)
    expect_identical(play_in_order(make, drawing, c(5, 3, 3, 1, 2, 4)), wanted)
  }
})

test_that("a batch that was interrupted in the middle and played again is as if it had not been", {
  ends <- function(seed, step, action) step == 1L + seed %% 7L
  env <- fake_vector_env(4, ends = ends)
  whole <- rollout(env, drawing, 8, seed = 1, steps = TRUE)
  step <- env$step
  left <- 3L
  env$step <- function(...) {
    left <<- left - 1L
    if (left == 0L) rlang::interrupt() else step(...)
  }
  suppressMessages(rollout(env, drawing, 8, seed = 1, steps = TRUE))
  expect_identical(rollout(env, drawing, 8, seed = 1, steps = TRUE), whole)
})

test_that("the seeds of a candidate's episodes are the same however many there are", {
  vector_env <- as_vector_env(fake_environment())
  seeds <- function(candidates, episodes) {
    history <- new_history(candidates, episodes, new_streams(1), common_seeds = TRUE)
    batches <- draw_batches(vector_env, history)
    unlist(lapply(batches, function(batch) batch$episodes$seed))
  }
  expect_identical(seeds(1L, 10L)[1:3], seeds(1L, 3L))
  expect_identical(seeds(2L, 3L), rep(seeds(1L, 3L), 2))
})
