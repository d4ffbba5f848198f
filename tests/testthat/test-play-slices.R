# Slices are played side by side here and apart by workers: it must make no difference, to the last
# bit. Here without workers.

drawing <- function(observation) {
  as.integer(stats::runif(nrow(observation)) < stats::plogis(observation[, 1]))
}

# What comes of batches that are played in `workers` parts, in the opposite order.
play_in_parts <- function(vector_env, history, policy, workers, ...) {
  vector_env$call <- rlang::current_env()
  while (!is.null(batch <- next_batch(vector_env, history))) {
    shares <- share_slices(length(batch$streams), workers)
    parts <- lapply(unname(shares), slices_of, batch = batch)
    played <- lapply(rev(parts), function(part) {
      candidates <- unique(part$episodes$candidate)
      part$episodes$candidate <- match(part$episodes$candidate, candidates)
      one <- play_batch(
        vector_env, keep_candidates(policy, candidates), part$episodes, part$streams, part$slice,
        each = part$each, ...
      )
      one$candidate <- candidates[one$candidate]
      one
    })
    enter_batch(history, bind_parts(batch, parts, rev(played)))
  }
  history$batches
}

test_that("a batch has at most 16 slices, of whole candidates where these fit", {
  sub_envs <- function(n, one_seed = FALSE) list(num_envs = n, one_seed = one_seed)
  expect_identical(slice_sub_envs(sub_envs(100L), 64, 1), rep(1:16, each = 4))
  sizes <- function(...) tabulate(slice_sub_envs(...))
  expect_identical(sizes(sub_envs(100L), 99, 3), c(9L, rep(6L, 15)))
  expect_identical(sizes(sub_envs(100L), 512, 1), rep(c(7L, 6L, 6L, 6L), 4))
  expect_identical(slice_sub_envs(sub_envs(100L), 15, 5), 1:15)
  expect_identical(slice_sub_envs(sub_envs(8L), 32, 1), 1:8)
  expect_identical(max(slice_sub_envs(sub_envs(256L), 1024, 1)), 16L)
  expect_identical(slice_sub_envs(sub_envs(256L, one_seed = TRUE), 1024, 1), rep(1L, 256))
  expect_identical(lengths(unname(share_slices(16, 7))), c(3L, 3L, 2L, 2L, 2L, 2L, 2L))
  expect_identical(unlist(share_slices(16, 40), use.names = FALSE), 1:16)
})

test_that("slices that are played apart come to the same as side by side", {
  skip_unless_all()
  # Longer ones than the number of steps after which moments are added.
  ends <- function(seed, step, action) step == 1L + seed %% 7L + 70L * (seed %% 5L == 0L)
  reward <- function(seed, step, action) seed %% 3 + 10 * action
  make <- function() as_vector_env(fake_vector_env(20, "sync", ends = ends, reward = reward))
  policies <- list(
    drawing = drawing, random = policy_random(), both = policy_list(list(drawing, policy_random())),
    network = {
      network <- policy_bind(policy_linear(normalize = TRUE), make())
      policy_candidates(network, matrix(seq(-2, 2, length.out = 3 * length(coef(network))), 3))
    }
  )
  for (name in names(policies)) {
    play <- function(workers) {
      vector_env <- make()
      policy <- policy_bind(policies[[name]], vector_env)
      history <- new_history(count_candidates(policy) %||% 1L, 37L, new_streams(3))
      batches <- play_in_parts(
        vector_env, history, policy, workers, keep_steps = TRUE, keep_moments = TRUE
      )
      several <- !is.null(count_candidates(policy))
      episodes <- episodes_table(batches, several)
      list(
        episodes, steps_table(batches, episodes, vector_env, several),
        lapply(batches, function(batch) batch$moments)
      )
    }
    alone <- play(1)
    for (workers in c(2, 3, 7, 16)) {
      expect_identical(play(workers), alone, label = paste(name, "with", workers))
    }
  }
})

test_that("observations of many steps are added to the moments at once, unless they are large", {
  expect_identical(steps_together(8L), 64L)
  expect_identical(steps_together(376L), 21L)
  expect_identical(steps_together(84L * 84L * 4L), 1L)
})

test_that("moments of slices are those of their observations", {
  values <- matrix(stats::rnorm(60), 20)
  slice <- rep(1:4, each = 5)
  moments <- no_slice_moments(4L)
  for (rows in list(c(1:5, 6:10, 16:20), 11:15, integer())[1:2]) {
    moments <- add_slice_moments(moments, values[rows, , drop = FALSE], slice[rows])
  }
  moments <- add_slice_moments(moments, values[2:9, ], slice[2:9])
  split <- split_slice_moments(moments)
  expect_length(split, 4)
  expect_equal(split[[1]], moments_of(values[c(1:5, 2:5), ]))
  expect_equal(split[[2]], moments_of(values[c(6:10, 6:9), ]))
  expect_equal(split[[3]], moments_of(values[11:15, ]))
})

test_that("candidates after the first one that reached the target are left out", {
  episodes <- list(candidate = c(1L, 1L, 2L, 2L, 3L, 3L), return = c(1, 2, 5, 5, 9, 9))
  expect_identical(without_needless(episodes, 2L, 5)$candidate, c(1L, 1L, 2L, 2L))
  expect_identical(without_needless(episodes, 2L, 10), episodes)
  expect_identical(without_needless(episodes, 2L, NULL), episodes)
})

test_that("a batch leaves the session's matrix product as it was", {
  old <- options(matprod = "blas")
  on.exit(options(old))
  rollout(fake_environment(), policy_random(), seed = 1)
  expect_identical(getOption("matprod"), "blas")
})
