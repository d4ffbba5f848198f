by_seed <- function(seed, step, action) seed %% 10 + step
of_some_length <- function(seed, step, action) step == 1L + seed %% 7L
by_action <- function(seed, step, action) seed %% 3 + 10 * action

test_that("the return sums the rewards of every step, the length counts them", {
  env <- fake_environment(reward = by_seed, ends = function(seed, step, action) step == 4L)
  played <- rollout(env, policy_random(), episodes = 6, seed = 1)
  expect_identical(played$episodes$length, rep(4L, 6))
  expect_identical(played$episodes$return, 4 * (played$episodes$seed %% 10) + 10)
})

test_that("the table of episodes has the promised columns and types", {
  played <- rollout(fake_environment(), policy_random(), episodes = 2, seed = 1)
  expect_s3_class(played, "gym_rollout")
  expect_identical(
    vapply(played$episodes, typeof, ""),
    c(episode = "integer", seed = "integer", sub_env = "integer", return = "double",
      length = "integer", terminated = "logical", truncated = "logical")
  )
  expect_identical(played$episodes$episode, 1:2)
  expect_identical(as.data.frame(played), played$episodes)
  expect_null(played$steps)
})

test_that("max_steps cuts an episode short, which counts as truncated", {
  env <- fake_environment(ends = function(seed, step, action) step == 4L)
  cut <- rollout(env, policy_random(), episodes = 2, max_steps = 3, steps = TRUE)
  expect_identical(cut$episodes$length, c(3L, 3L))
  expect_identical(cut$episodes$truncated, c(TRUE, TRUE))
  expect_identical(cut$episodes$terminated, c(FALSE, FALSE))
  expect_identical(cut$steps$truncated, rep(c(FALSE, FALSE, TRUE), 2))
  whole <- rollout(env, policy_random(), max_steps = 4)
  expect_true(whole$episodes$terminated)
  expect_false(whole$episodes$truncated)
})

test_that("max_steps beyond the environment's own limit is warned of, with what raises it", {
  env <- fake_environment(id = "MountainCar-v0")
  env$spec$max_episode_steps <- 200L
  network <- policy_network(c(4, 1))
  plays <- list(
    function(steps) rollout(env, policy_random(), max_steps = steps),
    function(steps) search_random(env, network, rounds = 1, max_steps = steps),
    function(steps) search_random(env, network, 1, target = 1, seeds = 1:3, max_steps = steps)
  )
  for (play in plays) {
    expect_silent(play(NULL))
    expect_silent(play(200))
    warning <- expect_warning(play(1000), class = "gym_warning_max_steps")
    expect_match(conditionMessage(warning), "a limit of its own, 200 steps.", fixed = TRUE)
    expect_match(conditionMessage(warning),
                 "`max_episode_steps = 1000` as a further argument of `gym_make()`", fixed = TRUE)
  }
})

test_that("what the warning of max_steps says raises the limit that is played", {
  env <- local_env("MountainCar-v0", max_episode_steps = 230)
  expect_identical(env$spec$max_episode_steps, 230L)
  expect_silent(played <- rollout(env, function(observation) 0L, max_steps = 230))
  expect_identical(played$episodes$length, 230L)
  wrapped <- gym_wrap("MountainCar-v0", "TimeLimit", max_episode_steps = 1000)
  expect_identical(local_env(wrapped)$spec$max_episode_steps, 200L)
})

test_that("a function is asked about the episodes that still play", {
  rows <- integer()
  count_rows <- function(observation) {
    rows <<- c(rows, nrow(observation))
    rep(0L, nrow(observation))
  }
  scripted <- scripted_vector_env(3, c(1, 1, 1), c(1L, 3L, 2L))
  rollout(scripted, count_rows, episodes = 3)
  expect_identical(utils::tail(rows, 3), 3:1)
})

test_that("a row of the steps has the observation that its action was taken on", {
  env <- fake_environment(id = "CartPole-v1", reward = by_seed)
  seen <- list()
  follow <- function(observation) {
    seen[[length(seen) + 1L]] <<- observation
    as.integer(observation[, 3] > 0)
  }
  played <- rollout(env, follow, episodes = 3, seed = 1, steps = TRUE)
  steps <- as.data.frame(played)
  names <- c("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")
  expect_identical(
    names(steps), c("episode", "step", names, "action", "reward", "terminated", "truncated")
  )
  expect_identical(unname(as.matrix(steps[names])), do.call(rbind, seen))
  # What the environment shows after the steps before this one, 0 of them at first.
  expect_identical(steps$cart_position, sin(rep(env$seeds, each = 3) %% 1000 + 0:2 + 1))
  expect_identical(steps$action, as.integer(steps$pole_angle > 0))
  expect_identical(steps$episode, rep(1:3, each = 3))
  expect_identical(steps$step, rep(1:3, 3))
  expect_identical(steps$reward, rep(env$seeds %% 10, each = 3) + steps$step)
  expect_identical(steps$terminated, steps$step == 3L)
  expect_identical(tapply(steps$reward, steps$episode, sum)[[2]], played$episodes$return[[2]])
})

test_that("observations and actions of other shapes have a column for each number", {
  env <- fake_environment(
    observation_space = box_space(rep(-1, 6), rep(1, 6), shape = c(2L, 3L)),
    action_space = box_space(c(-1, 9), c(1, 10))
  )
  seen <- NULL
  keep_first <- function(observation) {
    if (is.null(seen)) seen <<- observation
    rbind(c(0.5, 9.5))
  }
  steps <- rollout(env, keep_first, seed = 1, steps = TRUE)$steps
  expect_identical(names(steps)[3:10], c(paste0("obs_", 1:6), "action_1", "action_2"))
  expect_identical(unlist(steps[1, 3:8], use.names = FALSE), as.vector(t(seen[1, , ])))
  expect_identical(steps$action_2, rep(9.5, 3))
  one <- fake_environment(id = "FrozenLake-v1", observation_space = discrete_space(16L),
                          action_space = box_space(-2, 2))
  steps <- rollout(one, policy_random(), steps = TRUE)$steps
  expect_identical(names(steps)[3:4], c("position", "action"))
  expect_type(steps$position, "integer")
})

test_that("a network plays as it acts", {
  env <- fake_environment()
  set.seed(1)
  policy <- policy_network()
  steps <- rollout(env, policy, episodes = 20, steps = TRUE)$steps
  expect_identical(steps$action, act(policy, as.matrix(steps[3:6])))
})

test_that("a given environment is left open", {
  env <- fake_environment()
  rollout(env, policy_random())
  expect_identical(env$closed, 0L)
})

test_that("bad arguments are refused before anything is made, naming argument and value", {
  bad <- function(..., message) {
    expect_error(rollout(..., client = no_client()), message, fixed = TRUE,
                 class = "gym_error_argument")
  }
  bad("Fake-v0", policy_random(), episodes = 0,
      message = "`episodes` must be a whole number of at least 1, not 0.")
  bad("Fake-v0", policy_random(), episodes = 1.5, message = "`episodes`")
  bad("Fake-v0", policy_random(), max_steps = 0, message = "`max_steps`")
  bad("Fake-v0", policy_random(), seed = 0.5,
      message = "`seed` must be a whole number or NULL, not 0.5.")
  bad("Fake-v0", policy_random(), steps = NA, message = "`steps`")
  bad("Fake-v0", "random", message = "`policy`")
  bad(3, policy_random(), message = "`env`")
  bad(c("a", "b"), policy_random(), message = "`env`")
  bad(list(), policy_random(), message = "`env`")
})

test_that("a network that does not fit plays no step", {
  env <- fake_environment()
  expect_error(rollout(env, policy_network(c(3, 1))),
               "3 inputs, but an observation of Fake-v0 has 4 numbers")
  expect_length(env$seeds, 0)
})

test_that("the observation after a step is that before the next, and the last is the last", {
  for (make in list(fake_environment, function(...) fake_vector_env(4, ...),
                    function(...) fake_vector_env(4, "vector_entry_point", ...))) {
    env <- make(ends = of_some_length, id = "CartPole-v1")
    steps <- rollout(env, policy_random(), 6, steps = TRUE, next_observation = TRUE)$steps
    expect_true(all(c("next_cart_position", "next_pole_angle") %in% names(steps)))
    inner <- which(!steps$terminated)
    expect_identical(steps$next_pole_angle[inner], steps$pole_angle[inner + 1L])
  }
})

test_that("sub-environments and the environment's own arguments are for one named by its id", {
  client <- test_client()
  played <- rollout("FrozenLake-v1", policy_random(), 6, seed = 1, client = client, num_envs = 4,
                    is_slippery = FALSE, map_name = "8x8", steps = TRUE)
  expect_identical(played$episodes$sub_env, c(1:4, 1:2))
  expect_gt(max(played$steps$position), 0)
  expect_error(rollout(fake_environment(), policy_random(), num_envs = 2), "was made before",
               class = "gym_error_argument")
  expect_error(rollout(fake_environment(), policy_random(), is_slippery = FALSE),
               "`is_slippery`.*`gym_make\\(\\)`", class = "gym_error_argument")
  expect_error(rollout("CartPole-v1", policy_random(), num_envs = 0, client = no_client()),
               "`num_envs`", class = "gym_error_argument")
})

test_that("a rollout prints and sums up its returns", {
  env <- fake_environment(reward = by_seed)
  played <- rollout(env, policy_random(), episodes = 40, seed = 1)
  returns <- played$episodes$return
  expect_output(print(played), "Rollout in Fake-v0: 40 episodes, 120 steps", fixed = TRUE)
  expect_lt(length(capture.output(print(played))), 10)
  summary <- summary(played)
  expect_identical(summary$mean, mean(returns))
  expect_equal(summary$se, sd(returns) / sqrt(40))
  expect_equal(summary$returns[["Median"]], median(returns))
  expect_identical(c(summary$episodes, summary$steps), c(40L, 120L))
  expect_output(print(summary), "standard error")
  one <- rollout(env, policy_random())
  expect_output(print(one), "1 episode, 3 steps", fixed = TRUE)
  expect_output(print(one), paste0("Return: ", one$episodes$return, "$"))
  expect_identical(summary(one)$se, NA_real_)
})

test_that("vector environments of every mode are played as they are given", {
  for (mode in c("vector_entry_point", "sync", "async")) {
    env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = mode)
    played <- rollout(env, policy_random(), 7, seed = 1)
    expect_identical(played$episodes$sub_env, c(1:3, 1:3, 1L), info = mode)
    expect_identical(played$num_envs, if (mode == "vector_entry_point") 3L, info = mode)
  }
  same <- local_env("CartPole-v1", num_envs = 3, autoreset_mode = "SameStep")
  disabled <- local_env("CartPole-v1", num_envs = 3, autoreset_mode = "Disabled")
  played <- rollout(same, policy_random(), 7, seed = 1)
  expect_identical(played$episodes, rollout(disabled, policy_random(), 7, seed = 1)$episodes)
})

test_that("a vector implementation that plays another game is not taken for an id", {
  client <- test_client()
  skip_if_not(isTRUE(env_registry(client, "ALE/Pong-v5")$available[1]), "the extra atari")
  sub_envs <- as_vector_env("ALE/Pong-v5", max_envs = 1, client = client)
  withr::defer(sub_envs$close())
  expect_false(sub_envs$one_seed)
  expect_identical(sub_envs$observation_space$shape, c(210L, 160L, 3L))
})

test_that("an environment that was made is closed, a given one is not, also after an error", {
  skip_unless_all()
  client <- local_server()
  open <- function() names(env_list_all(client))
  rollout("CartPole-v1", policy_random(), client = client)
  expect_length(open(), 0)
  lost <- function(observation) stop("no idea")
  expect_error(rollout("CartPole-v1", lost, client = client), "no idea")
  expect_length(open(), 0)
  expect_error(rollout("CartPole-v1", policy_network(c(3, 1)), client = client),
               class = "gym_error_argument")
  expect_length(open(), 0)
  env <- gym_make("CartPole-v1", client = client)
  rollout(env, policy_random())
  expect_identical(open(), env$instance_id)
})

test_that("CartPole: 200 pushes at most in v0, and a policy's mistake is the environment's error", {
  client <- test_client()
  follow_pole <- function(observation) as.integer(observation[, 3] + observation[, 4] > 0)
  played <- rollout("CartPole-v0", follow_pole, 10, seed = 1, client = client)
  expect_identical(max(played$episodes$length), 200L)
  expect_identical(played$episodes$truncated, played$episodes$length == 200L)
  expect_error(rollout("CartPole-v0", function(observation) 2, client = client),
               class = "gym_error_space")
})

test_that("what was played survives an environment that cannot be closed", {
  env <- list(close = function() gym_abort("gone", class = "gym_error_connection"))
  expect_warning(close_or_warn(env), "could not be closed",
                 class = "gym_warning_close")
  # After an error nothing but that error is reported.
  expect_silent(close_quietly(env))
})

test_that("Blackjack: observations with several parts have named columns", {
  client <- test_client()
  skip_if_not("Blackjack-v1" %in% env_registry(client)$id, "the extra toy-text")
  stop_at_17 <- function(observation) as.integer(observation[[1]] < 17)
  steps <- rollout("Blackjack-v1", stop_at_17, 5, seed = 1, steps = TRUE, client = client)$steps
  expect_identical(names(steps)[3:6], c("player_sum", "dealer_card", "usable_ace", "action"))
  expect_identical(steps$action, as.integer(steps$player_sum < 17))
  expect_true(all(steps$usable_ace %in% 0:1))
  random <- rollout("Blackjack-v1", policy_random(), 5, seed = 1, client = client)
  expect_identical(nrow(random$episodes), 5L)
  expect_error(rollout("Blackjack-v1", policy_network(c(3, 1)), client = client),
               "cannot observe <Tuple", class = "gym_error_argument")
})

test_that("an environment of one's own whose step lacks something is refused at its first step", {
  skip_unless_all()
  making <- function(change) {
    env <- fake_environment()
    step <- env$step
    env$step <- function(action) {
      out <- step(action)
      change(out)
    }
    env
  }
  refusal <- function(change) {
    env <- making(change)
    cnd <- expect_error(rollout(env, policy_random()), class = "gym_error_argument")
    expect_identical(env$at, 1L)
    expect_identical(as.character(cnd$call[[1L]]), "rollout")
    conditionMessage(cnd)
  }
  without <- function(name) function(out) out[setdiff(names(out), name)]
  expect_match(refusal(without("truncated")),
               "lacks `truncated`; it has `observation`, `reward`, `done`, `info`, `terminated`.",
               fixed = TRUE)
  for (name in c("observation", "reward", "terminated")) {
    expect_match(refusal(without(name)), paste0("lacks `", name, "`"), fixed = TRUE)
  }
  expect_match(refusal(function(out) NULL), "must return a list, not NULL", fixed = TRUE)
  expect_match(refusal(function(out) unlist(out)), "must return a list", fixed = TRUE)
  with <- function(...) function(out) utils::modifyList(out, list(...))
  expect_match(refusal(with(truncated = NA)), "`truncated` .* must be TRUE or FALSE, not NA")
  expect_match(refusal(with(terminated = 0)), "`terminated` .* must be TRUE or FALSE, not 0")
  expect_match(refusal(with(reward = "1")), "`reward` .* must be a number, not \"1\"")
  expect_match(refusal(with(reward = numeric())), "`reward` .* must be a number")
})

test_that("a user's own vector environment must return flags for each of its episodes", {
  for (mode in c("sync", "vector_entry_point")) {
    env <- fake_vector_env(3, mode)
    step <- env$step
    env$step <- function(...) utils::modifyList(step(...), list(truncated = FALSE))
    expect_error(rollout(env, policy_random(), 3),
                 "`truncated` .* must be TRUE or FALSE for each of 3 sub-environments, not FALSE",
                 class = "gym_error_argument")
  }
})
