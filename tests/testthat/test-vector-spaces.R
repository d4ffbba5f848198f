# Values of sub-environments from Python to R and back, of every kind of space; see
# mirror_environments.py. The sub-environments begin with different values, so that none can be
# taken for another.

# Sends back what the sub-environments show. Returns that, and what a mirror found different.
play_sub_envs <- function(env, values, tensors) {
  instance <- known_instance(env$client, env$instance_id)
  # Calls were prepared for the other way.
  instance$resets[] <- instance$steps[] <- list(NULL)
  instance$sends_tensors <- instance$sends_tensors && tensors
  n <- env$num_envs
  observation <- env$reset(seed = seq_len(n))
  seen <- list(observation)
  problems <- character()
  for (i in seq_len(values - 1L)) {
    out <- env$step(observation)
    problems <- c(problems, out$info$problem)
    seen <- c(seen, list(out$observation))
    observation <- out$observation
  }
  # Only some of them, the last step of an episode.
  sub_envs <- which(seq_len(n) != 2L)
  some <- env$step(batch_rows(env$single_action_space, observation, sub_envs), which = sub_envs)
  expect_identical(some$terminated, rep(TRUE, length(sub_envs)))
  list(seen = c(seen, list(some$observation)), problems = c(problems, some$info$problem))
}

# NULL where there is an empty Tuple or Dict in the space: Gymnasium cannot take its
# sub-environments apart, and the server says so.
make_mirrors <- function(server, ...) {
  tryCatch(
    gym_make("mirror_environments:Mirror-v0", ..., client = server),
    gym_error_http_400 = function(cnd) if (cnd$code != "unsupported_space") rlang::cnd_signal(cnd)
  )
}

test_that("values of random spaces reach Python in the sub-environment that they are for", {
  skip_unless_all()
  server <- odd_server()
  kinds <- character()
  problems <- character()
  played <- tensors <- 0L
  for (number in 1:50) {
    env <- make_mirrors(server, number = number, values = 4, num_envs = 3,
                        vectorization_mode = "sync")
    if (is.null(env)) next
    played <- played + 1L
    kinds <- union(kinds, all_kinds(env$single_observation_space))
    by_json <- play_sub_envs(env, 4L, tensors = FALSE)
    by_tensors <- play_sub_envs(env, 4L, tensors = TRUE)
    tensors <- tensors + has_tensors(env$single_observation_space)
    expect_identical(by_tensors, by_json, info = number)
    problems <- c(problems, by_json$problems)
    # Each sub-environment shows what a single environment shows that begins there.
    single <- gym_make("mirror_environments:Mirror-v0", number = number, values = 4,
                       client = server)
    space <- env$single_observation_space
    for (sub_env in 1:3) {
      # As text: an integer is a double where other sub-environments need one.
      expect_identical(
        write_value(space, batch_value(space, by_json$seen[[1L]], sub_env)),
        write_value(space, single$reset(seed = sub_env)), info = number
      )
    }
    single$close()
    env$close()
  }
  # Gymnasium's vector environments hand a sub-environment a NumPy scalar for an array of shape ().
  problems <- grep("^ndarray became [a-z0-9]+$", problems[!is.na(problems)], value = TRUE,
                   invert = TRUE)
  expect_identical(problems, character())
  expect_gt(played, 35L)
  expect_gt(tensors, 20L)
  expect_setequal(kinds, c("Box", "Discrete", "MultiDiscrete", "MultiBinary", "Text", "Tuple",
                           "Dict", "Sequence", "Graph", "OneOf"))
})

# As text: an integer is a double where other sub-environments need one.
expect_shows <- function(space, batch, i, value, number) {
  expect_identical(write_value(space, batch_value(space, batch, i)), write_value(space, value),
                   info = number)
}

test_that("the last observation of a sub-environment is kept for every kind of space", {
  skip_unless_all()
  server <- odd_server()
  for (number in 1:40) {
    env <- make_mirrors(server, number = number, values = 2, num_envs = 2,
                        autoreset_mode = "SameStep")
    if (is.null(env)) next
    space <- env$single_observation_space
    first <- env$reset(seed = 0:1)
    second <- env$step(first)$observation
    # The first sub-environment ends, the second does not step.
    out <- env$step(batch_rows(space, second, 1L), which = 1)
    expect_length(out$info$final_obs, 1)
    # After its last value a mirror shows its first again.
    expect_identical(out$info$final_obs[[1L]], batch_value(space, first, 1L), info = number)
    expect_shows(space, out$next_observation, 1L, batch_value(space, first, 1L), number)
    out <- env$step(batch_of(space, list(
      batch_value(space, out$observation, 1L), batch_value(space, second, 2L)
    )))
    expect_identical(out$terminated, c(FALSE, TRUE))
    expect_null(out$info$final_obs[[1L]])
    expect_identical(out$info$final_obs[[2L]], batch_value(space, first, 2L), info = number)
    expect_shows(space, out$next_observation, 1L, batch_value(space, out$observation, 1L), number)
    expect_shows(space, out$next_observation, 2L, batch_value(space, first, 2L), number)
    env$close()
  }
})

test_that("infos have an entry for each sub-environment, and pictures one dimension more", {
  skip_unless_all()
  server <- odd_server()
  env <- gym_make("odd_environments:Telling-v0", num_envs = 2, client = server)
  env$reset()
  out <- env$step(c(0, 0))
  expect_identical(out$reward, c(Inf, Inf))
  expect_identical(out$truncated, c(TRUE, TRUE))
  expect_identical(out$info$action_mask, rbind(c(1L, 0L, 1L), c(1L, 0L, 1L)))
  expect_identical(out$info$nested$x, c(0.5, 0.5))
  expect_identical(out$info$nan, c(NaN, NaN))
  expect_identical(dim(out$info$grid), c(2L, 2L, 3L))
  some <- env$step(0, which = 2)
  expect_length(some$reward, 1)
  picture <- gym_make("odd_environments:Image-v0", num_envs = 2, client = server)
  observation <- picture$reset()
  expect_identical(dim(observation), c(2L, 2L, 3L, 4L))
  expect_identical(observation[2, , , ], aperm(array(0:23, c(4, 3, 2))))
})

test_that("numbers of sub-environments keep their types, and what R cannot hold is an error", {
  skip_unless_all()
  server <- odd_server()
  make <- function(name) {
    gym_make(paste0("odd_environments:", name, "-v0"), num_envs = 2, client = server)
  }
  middling <- c(-2^31, 2^31, 2^53 - 1)
  expect_identical(make("MiddlingIntegers")$reset(), rbind(middling, middling, deparse.level = 0))
  odd <- c(NaN, Inf, -Inf, 1 / 3)
  expect_identical(make("NotFinite")$reset(), rbind(odd, odd, deparse.level = 0))
  expect_type(make("Shifted")$reset(), "integer")
  for (name in c("LargeIntegers", "SmallestInteger", "LargestNatural")) {
    expect_error(make(name)$reset(), class = "gym_error_space")
  }
})

test_that("the server draws actions of a vector environment in the form in which it takes them", {
  skip_unless_all()
  server <- odd_server()
  env <- gym_make("odd_environments:Nested-v0", num_envs = 3, client = server)
  env$reset()
  drawn <- env_action_space_sample(server, env$instance_id)
  expect_identical(dim(drawn$position), c(3L, 3L))
  expect_true(space_contains(env$action_space, drawn))
  expect_true(env_action_space_contains(server, env$instance_id, drawn))
  expect_identical(env$step(drawn)$reward, c(1, 1, 1))
  drawn$a.b[[2]] <- 2L
  expect_false(env_action_space_contains(server, env$instance_id, drawn))
})

test_that("an error about a nested action names the sub-environment", {
  skip_unless_all()
  server <- odd_server()
  env <- gym_make("odd_environments:Nested-v0", num_envs = 3, client = server)
  env$reset()
  good <- list(position = matrix(0, 3, 3), "a.b" = c(1, 0, 1))
  expect_identical(env$step(good)$reward, c(1, 1, 1))
  bad <- good
  bad$position[3, 2] <- NA
  expect_error(env$step(bad), "Sub-environment 3: .*\\$position\\[1\\]", class = "gym_error_space")
  bad$position[3, 2] <- Inf
  expect_error(env$step(bad), "position", class = "gym_error_space")
  expect_error(env$step(list(position = matrix(0, 3, 3), "a.b" = c(1, 0))), "\\$a.b",
               class = "gym_error_space")
})

test_that("an exception in one sub-environment is an error, and the server goes on", {
  skip_unless_all()
  server <- odd_server()
  env <- gym_make("odd_environments:Failing-v0", num_envs = 2, client = server)
  env$reset()
  expect_error(env$step(c(0, 1)), "the pole caught fire", class = "gym_error_http_500")
  env$reset()
  expect_identical(env$step(c(0, 0))$reward, c(1, 1))
})
