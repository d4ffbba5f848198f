# As play_batches(), but the batches are played in another order than they were drawn.
shuffled_batches <- function(vector_env, history, policy_of, report = function(ended) NULL, ...) {
  batches <- draw_batches(vector_env, history)
  order <- sample(length(batches))
  counted$batches <- max(counted$batches, length(batches))
  counted$shuffled <- counted$shuffled + is.unsorted(order)
  played <- list()
  for (i in order) {
    batch <- batches[[i]]
    policy <- policy_of(unique(batch$episodes$candidate))
    played[[i]] <- play_batch(
      vector_env, policy, batch$episodes, batch$stream, each = batch$each, report = report, ...
    )
  }
  for (one in played) enter_batch(history, one)
}
counted <- rlang::env(batches = 0, shuffled = 0)

test_that("results are the same in whatever order batches are played", {
  skip_unless_all()
  # A thousand by `make soak`.
  orders <- as.integer(Sys.getenv("GYM_TEST_ORDERS", "8"))
  reward <- function(seed, step, action) seed %% 7 * 0.1 + action * sin(seed + step)
  play <- function() {
    trained <- train_agent(
      agent_ars(6, 3, step_size = 0.5, noise = 1), fake_vector_env(2, "sync", reward = reward),
      iterations = 3, episodes = 3, target = Inf, eval_every = 2, eval_episodes = 20, seed = 1
    )
    trained$history$elapsed <- NULL
    trained[c("policy", "agent", "history", "evaluations", "steps")]
  }
  in_order <- play()
  expect_gt(stats::sd(in_order$history$mean_return), 0)
  withr::local_seed(1)
  local_functions(play_batches = shuffled_batches)
  same <- vapply(seq_len(orders), function(i) identical(play(), in_order), NA)
  expect_identical(sum(same), orders)
  expect_gt(counted$batches, 3)
  expect_gt(counted$shuffled, orders)
})
