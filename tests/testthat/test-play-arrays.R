# Sub-environments whose episodes take 2 and 3 steps, or 1 step, in turn.
short_envs <- function(n, ...) {
  fake_vector_env(n, ends = function(seed, step, action) step == 1L + seed %% 3L, ...)
}

test_that("arrays have the steps of the table, in time and by sub-environment", {
  skip_unless_all()
  for (env in list(short_envs(3L), short_envs(4L, "vector_entry_point"), fake_environment())) {
    keep <- function(steps) {
      rollout(env, policy_random(), 7, seed = 1, steps = steps, next_observation = TRUE)
    }
    table <- keep(TRUE)
    arrays <- keep("arrays")
    expect_identical(arrays$episodes, table$episodes)
    arrays <- arrays$steps
    for (i in seq_len(max(table$episodes$sub_env))) {
      own <- table$episodes[table$episodes$sub_env == i, ]
      # One episode after the other, then nothing.
      rows <- unlist(lapply(own$episode, function(episode) which(table$steps$episode == episode)))
      time <- seq_along(rows)
      steps <- table$steps[rows, ]
      expect_identical(unname(arrays$episode[time, i]), steps$episode)
      expect_identical(unname(arrays$reward[time, i]), steps$reward)
      expect_identical(unname(arrays$action[time, i]), steps$action)
      expect_identical(unname(arrays$terminated[time, i]), steps$terminated)
      expect_identical(unname(arrays$truncated[time, i]), steps$truncated)
      for (number in 1:4) {
        expect_identical(unname(arrays$observation[time, i, number]),
                         steps[[paste0("obs_", number)]])
        expect_identical(unname(arrays$next_observation[time, i, number]),
                         steps[[paste0("next_obs_", number)]])
      }
      rest <- setdiff(seq_len(dim(arrays$reward)[[1L]]), time)
      for (x in arrays[c("reward", "action", "terminated", "truncated", "episode")]) {
        expect_true(all(is.na(x[rest, i])))
      }
      expect_true(all(is.na(arrays$observation[rest, i, ])))
    }
  }
})

test_that("arrays have named dimensions, and the names of the numbers", {
  env <- fake_vector_env(2L, id = "CartPole-v1")
  arrays <- rollout(env, policy_random(), 4, seed = 1, steps = "arrays")$steps
  expect_identical(names(dimnames(arrays$observation)), c("time", "sub_env", ""))
  expect_identical(dimnames(arrays$observation)[[3]], observation_parts$CartPole)
  expect_identical(dim(arrays$observation), c(6L, 2L, 4L))
  expect_identical(dim(arrays$action), c(6L, 2L))
  expect_identical(names(dimnames(arrays$reward)), c("time", "sub_env"))
  expect_null(arrays$next_observation)
  expect_null(arrays$candidate)
  expect_type(arrays$action, "integer")
})

test_that("an episode that `max_steps` cuts short is truncated in its last step", {
  env <- fake_vector_env(2L, ends = function(seed, step, action) FALSE)
  arrays <- rollout(env, policy_random(), 4, max_steps = 3, seed = 1, steps = "arrays")$steps
  cut <- c(FALSE, FALSE, TRUE)
  expect_identical(unname(arrays$truncated), cbind(c(cut, cut), c(cut, cut)), ignore_attr = TRUE)
  expect_false(any(arrays$terminated))
})

test_that("arrays of several candidates say whose step it is", {
  played <- rollout(short_envs(2L), list(policy_random(), policy_random()), 3, seed = 1,
                    steps = "arrays")
  arrays <- played$steps
  steps <- tapply(played$episodes$length, played$episodes$candidate, sum)
  expect_identical(c(table(arrays$candidate)), c(steps))
  expect_identical(sum(!is.na(arrays$episode)), sum(played$episodes$length))
})

test_that("arrays of arrays, parts and texts have the dimensions of the space", {
  image <- box_space(rep(0, 6), rep(1, 6), shape = c(2L, 3L))
  arrays <- rollout(fake_vector_env(2L, observation_space = image), policy_random(), 2, seed = 1,
                    steps = "arrays")
  expect_identical(dim(arrays$steps$observation), c(3L, 2L, 2L, 3L))
  second <- arrays$episodes[2, ]
  expect_identical(unname(arrays$steps$observation[1, 2, , ]),
                   fake_observation(image, second$seed, 0L), ignore_attr = TRUE)
  space <- new_space(describe_dict(
    place = describe_box(c(0, 0), c(1, 1)), word = list(name = "Text", min_length = 0L,
                                                       max_length = 9L, characters = "ab"),
    hand = list(name = "Tuple", spaces = list(
      list(name = "Discrete", n = 3L), list(name = "MultiBinary", shape = list(1L), dtype = "int8")
    ))
  ))
  values <- list(
    list(place = cbind(1:2, 3:4) / 9, word = c("a", "b"), hand = list(0:1, cbind(c(1L, 0L)))),
    list(place = cbind(0.5, 1), word = "ab", hand = list(2L, cbind(1L)))
  )
  episodes <- data.frame(sub_env = 1:2, length = c(2L, 1L))
  cells <- cells_in_time(c(1L, 2L, 1L), episodes, 2:1)
  arrays <- array_in_time(space, values, cells)
  expect_identical(lapply(arrays[1:2], dim), list(place = c(2L, 2L, 2L), word = c(2L, 2L)))
  expect_identical(unname(arrays$word), rbind(c("a", "b"), c("ab", NA)), ignore_attr = TRUE)
  expect_identical(unname(arrays$place[, 1, 2]), c(3 / 9, 1))
  expect_identical(unname(arrays$hand[[1]][, 1]), c(0L, 2L))
  expect_identical(dim(arrays$hand[[2]]), c(2L, 2L, 1L))
})

test_that("values without one shape are refused before anything is played", {
  sequence <- new_space(list(name = "Sequence", space = list(name = "Discrete", n = 3L),
                             stack = FALSE))
  parts <- new_space(describe_dict(a = describe_box(0, 1), s = list(
    name = "Sequence", space = list(name = "Discrete", n = 3L), stack = FALSE
  )))
  for (space in list(sequence, parts)) {
    env <- fake_environment(observation_space = space)
    cnd <- expect_error(rollout(env, function(observation) 1L, steps = "arrays"), "Sequence",
                        class = "gym_error_argument")
    expect_identical(cnd$argument, "steps")
    expect_match(conditionMessage(cnd), "`steps = TRUE` keeps them", fixed = TRUE)
    expect_identical(env$seeds, integer())
  }
})

test_that("a rollout with arrays is tabulated by episodes, and says what a plot of steps needs", {
  played <- rollout(fake_environment(id = "CartPole-v1"), policy_random(), 2, steps = "arrays")
  expect_identical(as.data.frame(played), played$episodes)
  expect_error(plot(played, type = "trajectory"), "`rollout(..., steps = TRUE)`", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(
    decision_map(NULL, policy_network(), 1, 2, path = played), "`rollout(steps = TRUE)`",
    fixed = TRUE, class = "gym_error_argument"
  )
})

test_that("what to keep is TRUE, FALSE or \"arrays\", and the next observation is of kept steps", {
  for (bad in list("array", NA, 1, c(TRUE, FALSE), NULL)) {
    expect_error(rollout("CartPole-v1", policy_random(), steps = bad, client = no_client()),
                 "`steps` must be TRUE, FALSE or \"arrays\"", class = "gym_error_argument")
  }
  error <- expect_error(
    rollout("CartPole-v1", policy_random(), next_observation = TRUE, client = no_client()),
    "needs the steps to be kept", class = "gym_error_argument"
  )
  expect_match(conditionMessage(error), "`steps = TRUE`", fixed = TRUE)
})
