# Two candidates, each with episodes of different lengths.
two_candidates <- function(n = 3L, ...) {
  env <- fake_vector_env(n, ends = function(seed, step, action) step == 1L + (seed + action) %% 3L)
  right <- function(observation) rep(1L, nrow(observation))
  left <- function(observation) rep(0L, nrow(observation))
  rollout(env, list(left, right), 4, seed = 1, ...)
}

test_that("a table of several candidates tells their episodes and steps apart", {
  played <- two_candidates(steps = TRUE)
  episodes <- played$episodes
  expect_identical(episodes$candidate, rep(1:2, each = 4))
  expect_identical(episodes$episode, rep(1:4, 2))
  steps <- as.data.frame(played)
  expect_identical(names(steps)[1:3], c("candidate", "episode", "step"))
  expect_identical(steps$action, steps$candidate - 1L)
  for (i in seq_len(8)) {
    own <- steps$candidate == episodes$candidate[i] & steps$episode == episodes$episode[i]
    expect_identical(steps$step[own], seq_len(episodes$length[i]))
    expect_identical(sum(steps$reward[own]), episodes$return[i])
    expect_identical(steps$terminated[own], seq_len(episodes$length[i]) == episodes$length[i])
  }
  expect_false(is.unsorted(order(steps$candidate, steps$episode, steps$step)))
})

test_that("tables come back from a CSV file as they were", {
  played <- two_candidates(steps = TRUE, next_observation = TRUE)
  file <- withr::local_tempfile(fileext = ".csv")
  for (table in list(played$episodes, as.data.frame(played))) {
    write.csv(table, file, row.names = FALSE)
    expect_equal(read.csv(file), table)
  }
})

test_that("the observation after a step is the one that the next step begins with", {
  played <- two_candidates(steps = TRUE, next_observation = TRUE)
  steps <- played$steps
  goes_on <- which(!(steps$terminated | steps$truncated))
  numbers <- paste0("obs_", 1:4)
  after <- steps[goes_on, paste0("next_", numbers)]
  expect_identical(unlist(after, use.names = FALSE),
                   unlist(steps[goes_on + 1L, numbers], use.names = FALSE))
  # The last one of each episode, which begins no step, is of the sub-environment as it was.
  last <- steps[!seq_len(nrow(steps)) %in% goes_on, ]
  episodes <- played$episodes
  space <- box_space(rep(-1, 4), rep(1, 4))
  expected <- t(mapply(fake_observation, seed = episodes$seed, at = episodes$length,
                       MoreArgs = list(space = space)))
  expect_equal(unname(as.matrix(last[paste0("next_", numbers)])), expected, ignore_attr = TRUE)
})

test_that("CartPole: the observation after the last step of an episode is the fallen pole's", {
  played <- rollout("CartPole-v1", policy_random(), 20, seed = 1, steps = TRUE,
                    next_observation = TRUE, client = test_client())
  last <- played$steps[played$steps$terminated, ]
  expect_identical(nrow(last), 20L)
  limit <- episode_limits$CartPole$pole_angle$at[[2L]]
  expect_true(all(abs(last$next_pole_angle) > limit))
  expect_true(all(abs(last$pole_angle) <= limit))
})

test_that("policies see the names of what is observed, alone and side by side", {
  client <- test_client()
  follow <- function(observation) as.integer(observation[, "pole_angle"] > 0)
  by_number <- function(observation) as.integer(observation[, 3] > 0)
  play <- function(env, policy) {
    rollout(env, policy, 3, seed = 1, steps = TRUE, client = client)$steps
  }
  for (env in list("CartPole-v1", local_env("CartPole-v1"))) {
    expect_identical(play(env, follow), play(env, by_number))
  }
  for (env in list("Blackjack-v1", local_env("Blackjack-v1"))) {
    steps <- play(env, function(hand) as.integer(hand$player_sum < 17))
    expect_named(steps[3:5], c("player_sum", "dealer_card", "usable_ace"))
    expect_identical(steps$action, as.integer(steps$player_sum < 17))
  }
})

test_that("a plot shows the episode of the candidate that it was asked for", {
  played <- two_candidates(steps = TRUE)
  for (candidate in 1:2) {
    data <- trajectory_plot_data(played, 3, candidate = candidate)
    own <- played$steps$candidate == candidate & played$steps$episode == 3
    expect_identical(data$values$value[data$values$name == "obs_2"], played$steps$obs_2[own])
    length <- played$episodes$length[[4L * candidate - 1L]]
    expect_identical(data$length, length)
    expect_match(data$subtitle, paste0("^candidate ", candidate, ", episode 3: return ", length))
  }
  expect_identical(names(data$titles), c(paste0("obs_", 1:4), "action"))
  local_device()
  plot(played, type = "trajectory", candidate = 2, episode = 3)
  refuse <- function(..., what) {
    cnd <- expect_error(plot(played, type = "trajectory", ...), class = "gym_error_argument")
    expect_identical(cnd$argument, what)
  }
  refuse(candidate = 3, what = "candidate")
  refuse(candidate = 0, what = "candidate")
  refuse(episode = 5, candidate = 2, what = "episode")
  one <- rollout(fake_environment(), policy_random(), steps = TRUE)
  expect_error(plot(one, type = "trajectory", candidate = 2), "`candidate` must be",
               class = "gym_error_argument")
})

test_that("frames are those of the candidate that was asked for", {
  played <- list(
    episodes = data.frame(candidate = rep(1:2, each = 2), episode = c(1:2, 1:2)),
    frames = list("a", "b", "c", "d")
  )
  expect_identical(episode_frames(played, 2, 1), "b")
  expect_identical(episode_frames(played, 1, 2), "c")
  played$episodes$candidate <- NULL
  played$episodes$episode <- 1:4
  expect_identical(episode_frames(played, 3), "c")
})

test_that("the paths of candidates' episodes are apart", {
  played <- two_candidates(steps = TRUE)
  points <- path_points(played, c("obs_1", "obs_2"))
  expect_identical(rle(points$episode)$lengths, played$episodes$length)
  expect_identical(unique(points$episode), 1:8)
  # A user's table may have them in any order.
  mixed <- played$steps[rev(seq_len(nrow(played$steps))), ]
  mixed <- path_points(mixed[order(mixed$candidate, mixed$episode), ], c("obs_1", "obs_2"))
  expect_identical(as.list(mixed), as.list(points))
  mixed <- played$steps
  mixed$episode[[1]] <- NA
  expect_error(path_points(mixed, c("obs_1", "obs_2")), "`episode`", class = "gym_error_argument")
})

test_that("what is observed next is shown in a trajectory only when it is asked for", {
  played <- two_candidates(steps = TRUE, next_observation = TRUE)
  expect_identical(names(trajectory_plot_data(played)$titles), c(paste0("obs_", 1:4), "action"))
  chosen <- trajectory_plot_data(played, variables = c("obs_1", "next_obs_1"))
  expect_identical(names(chosen$titles), c("obs_1", "next_obs_1", "action"))
})
