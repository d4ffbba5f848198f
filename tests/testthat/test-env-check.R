# A walk along 5 places in which nothing is wrong. What it remembers is in `env`; a fault is planted
# by another `reset`, `step` or space.
walk <- function(reset = NULL, step = NULL, ...) {
  env <- new.env()
  env$observation_space <- space_discrete(5)
  env$action_space <- space_discrete(2)
  env$spec <- list(id = "Walk")
  env$reset <- reset %||% function(seed = NULL) {
    if (!is.null(seed)) env$noise <- seed
    env$noise <- (env$noise * 16807) %% 2147483647
    env$place <- env$noise %% 4
    env$place
  }
  env$step <- step %||% function(action) {
    env$place <- max(env$place + if (action == 1) 1 else -1, 0)
    result(env, env$place)
  }
  for (name in names(list(...))) env[[name]] <- list(...)[[name]]
  env
}

result <- function(env, place, reward = -1, terminated = place == 4, truncated = FALSE) {
  list(observation = place, reward = reward, terminated = terminated, truncated = truncated)
}

# Expects one finding, and that it says so.
expect_finding <- function(env, topic, text, severity = "wrong", ...) {
  check <- check_env(env, ...)
  expect_identical(check$topic, topic)
  expect_match(check$finding, text, fixed = TRUE)
  expect_identical(check$severity, severity)
}

# Like a walk, and something else happens in each step.
steps_with <- function(change) {
  env <- walk()
  step <- env$step
  env$step <- function(action) change(env, step(action))
  env
}

test_that("nothing is found in an environment in which nothing is wrong", {
  check <- check_env(walk())
  expect_s3_class(check, c("gym_check", "data.frame"), exact = TRUE)
  expect_identical(nrow(check), 0L)
  expect_named(check, c("topic", "severity", "finding"))
  expect_true(all(vapply(check, is.character, NA)))
})

test_that("nothing is found in Gymnasium's environments", {
  skip_unless_all()
  test_client()
  ids <- c("Blackjack-v1", "CliffWalking-v1", "FrozenLake-v1", "Taxi-v4", "CartPole-v1",
           "MountainCar-v0", "Pendulum-v1", "LunarLander-v3")
  for (id in ids) {
    check <- check_env(id)
    expect_identical(check$finding, character(), info = id)
  }
  expect_identical(nrow(check_env("FrozenLake-v1", num_envs = 3)), 0L)
  expect_identical(nrow(check_env("CartPole-v1" |>
    gym_wrap("TimeLimit", max_episode_steps = 5))), 0L)
  expect_identical(nrow(check_env(local_env("CartPole-v1"))), 0L)
  remembering <- check_env("CartPole-v1" |> gym_wrap("NormalizeObservation"))
  expect_match(remembering$finding, "NormalizeObservation remembers earlier episodes")
  expect_identical(remembering$severity, "note")
})

test_that("an environment that lacks what is needed to play it is found out at once", {
  expect_finding(list(), c("reset", "step", "spaces", "spaces", "spaces"), "", rep("wrong", 5))
  env <- walk(observation_space = 5)
  expect_finding(env, "spaces", "`observation_space` must be a space, such as")
  env <- walk()
  env$step <- NULL
  expect_finding(env, "step", "The environment has no function `step()`.")
  expect_finding(walk(spec = "Walk"), "spaces", "`spec` must be a list with the environment's name")
})

test_that("an observation that does not fit its space is found", {
  far <- walk()
  reset <- far$reset
  far$reset <- function(seed = NULL) reset(seed) + 7
  expect_finding(far, "reset", "The first observation, 10, does not fit the space <Discrete 5>")
  env <- steps_with(function(env, out) {
    out$observation <- c(out$observation, 1)
    out
  })
  expect_finding(env, "step", "The observation of step 1 of the episode with seed 1, c(")
  boxed <- walk(
    observation_space = space_box(c(place = 0, speed = 0), c(4, 1)),
    reset = function(seed = NULL) c(0, 0), step = function(action) result(NULL, c(0, 2), 1, TRUE)
  )
  expect_finding(boxed, "step", "<Box float64 [2]> at `$[1]` (speed): there is a number outside")
})

test_that("what a step must not return is found", {
  check <- check_env(steps_with(function(env, out) "far"), max_steps = 5)
  expect_identical(check$severity, c("wrong", "note"))
  expect_match(check$finding[[1]], "must return a list, but returned \"far\" in step 1 of the")
  for (name in c("observation", "reward", "terminated", "truncated")) {
    env <- steps_with(function(env, out) out[names(out) != name])
    check <- check_env(env, max_steps = 5)
    expect_identical(check$finding[check$severity == "wrong"], paste0(
      "`step()` must return a list with an element `", name,
      "`, which is missing in step 1 of the episode with seed 1."
    ))
  }
  changed <- function(...) steps_with(function(env, out) utils::modifyList(out, list(...)))
  expect_finding(changed(reward = NaN), "step", "`reward` must be one finite number, and is NaN in")
  expect_finding(changed(reward = 1:2), "step", "and is 1:2 in step 1")
  expect_finding(changed(reward = "1"), "step", "`reward` must be one finite number, and is \"1\"")
  expect_finding(changed(truncated = 0), "step", "`truncated` must be TRUE or FALSE, and is 0 in")
  expect_finding(changed(truncated = NA), "step", "`truncated` must be TRUE or FALSE, and is NA in")
  expect_finding(changed(info = 5), "step", "`info` must be a list, and is 5 in step 1")
})

test_that("several mistakes are all found", {
  env <- steps_with(function(env, out) {
    list(observation = 9, reward = NA, terminated = out$terminated, truncated = 0)
  })
  check <- check_env(env)
  expect_identical(check$topic, c("step", "step", "step"))
  expect_identical(regmatches(check$finding, regexpr("^`[a-z]+`|^The obs", check$finding)),
                   c("`reward`", "`truncated`", "The obs"))
})

test_that("an error of the environment's own is a finding that says where", {
  expect_finding(walk(reset = function(seed = NULL) stop("no map")), "reset",
                 "`reset(seed = 1)` raised an error: no map.")
  expect_finding(walk(reset = function() 0), "reset", "`reset(seed = 1)` raised an error: unused")
  env <- steps_with(function(env, out) if (env$place == 2) stop("a hole") else out)
  expect_finding(env, "step", "`step()` in step ", max_steps = 50)
  expect_match(check_env(env)$finding, "raised an error: a hole.", fixed = TRUE)
})

test_that("seeds that do not fix the episode are found", {
  count <- 0
  env <- walk(reset = function(seed = NULL) {
    count <<- count + 1
    env$place <- count %% 4
  })
  expect_finding(env, "seeds", "The same seed, 1, and the same actions gave different first obs")
  steps <- 0
  env <- steps_with(function(env, out) {
    steps <<- steps + 1
    out$reward <- steps
    out
  })
  expect_finding(env, "seeds", "different values of `reward` in step 1: 1 and ")
  close <- steps_with(function(env, out) {
    steps <<- steps + 1
    out$reward <- 1 + steps * 1e-10
    out
  })
  expect_finding(close, "seeds", "different values of `reward` in step 1: 1.0000", "note")
})

test_that("a `reset()` that does not go on from the seed is found", {
  count <- 0
  env <- walk()
  reset <- env$reset
  env$reset <- function(seed = NULL) {
    if (is.null(seed)) count <<- count + 1
    reset(seed %||% count)
  }
  expect_finding(env, "seeds", "`reset(seed = 1)` followed by `reset()` gave different first")
})

test_that("drawing from the session's generator is found, which stays as it was", {
  env <- walk(reset = function(seed = NULL) env$place <- sample.int(3, 1))
  set.seed(5)
  expected <- runif(1)
  set.seed(5)
  check <- check_env(env)
  expect_identical(runif(1), expected)
  expect_match(check$finding[[1]], "`reset()` uses the session's random generator", fixed = TRUE)
  set_seed <- steps_with(function(env, out) {
    set.seed(1)
    out
  })
  expect_finding(set_seed, "seeds", "`step()` uses the session's random generator")
})

test_that("an environment that never ends is a note, and no mistake", {
  env <- steps_with(function(env, out) result(env, min(env$place, 4), terminated = FALSE))
  env$observation_space <- space_discrete(1000)
  expect_finding(env, "end", "No episode ended within 20 steps: an environment that never ends",
                 "note", max_steps = 20)
})

test_that("a limit of steps that is not kept to is found", {
  env <- steps_with(function(env, out) result(env, min(env$place, 4), terminated = FALSE))
  env$spec$max_episode_steps <- 7
  env$observation_space <- space_discrete(1000)
  for (max_steps in c(5, 20)) {
    expect_finding(env, "end", "`spec$max_episode_steps` is 7, but step 7 of an episode was not",
                   max_steps = max_steps)
  }
})

test_that("a picture that cannot be drawn is found", {
  expect_finding(walk(render = function() stop("no ink")), "render",
                 "`render()` raised an error: no ink.")
  before <- grDevices::dev.list()
  expect_identical(nrow(check_env(walk(render = function() plot(1)))), 0L)
  expect_identical(grDevices::dev.list(), before)
})

test_that("odd spaces are notes", {
  env <- walk(action_space = space_box(-Inf, 1), step = function(action) result(env, 4))
  expect_finding(env, "spaces", "The actions of `$action_space` have no bounds", "note")
  env <- walk(action_space = space_dict(a = space_tuple(), b = space_box(c(0, 1), 1)),
              step = function(action) result(env, 4))
  expect_finding(
    env, c("spaces", "spaces"), "`$action_space$", c("note", "note")
  )
})

test_that("what is no environment is an error, and arguments that cannot be used", {
  for (bad in list(3, NULL, "", NA_character_)) {
    expect_error(check_env(bad), "`env` must be the id", class = "gym_error_argument")
  }
  expect_error(check_env(walk(), size = 3), "`size`", class = "gym_error_argument")
  expect_error(check_env(walk(), max_steps = 0), "`max_steps`", class = "gym_error_argument")
  expect_error(check_env(walk(), seed = -1), "`seed`", class = "gym_error_argument")
})

# Environments written in R, which check themselves what they return ----------------------

corridor <- function(reset = NULL, step = NULL, ...) {
  gym_env(
    reset %||% function(self) self$position <- sample.int(3, 1),
    step %||% function(self, action) {
      self$position <- self$position + sample.int(2, 1) - 1
      list(observation = self$position, reward = -1, terminated = self$position == 4)
    },
    observation_space = space_discrete(5), action_space = space_discrete(2), id = "Corridor", ...
  )
}

test_that("nothing is found in an environment written in R in which nothing is wrong", {
  expect_identical(nrow(check_env(corridor())), 0L)
  expect_identical(nrow(check_env(corridor(render = function(self) plot(self$position)))), 0L)
  limited <- corridor(max_episode_steps = 2)
  expect_identical(nrow(check_env(limited)), 0L)
  expect_identical(max(attr(check_env(limited), "lengths")), 2L)
})

test_that("all mistakes of an environment written in R are found, not only the first", {
  env <- corridor(
    reset = function(self) self$position <- 17,
    step = function(self, action) {
      list(observation = 9, reward = NA, terminated = 0, truncated = TRUE, info = 1)
    },
    render = function(self) stop("no ink")
  )
  check <- check_env(env)
  expect_identical(check$topic, c("reset", "step", "step", "step", "step", "render"))
  expect_match(check$finding[[6]], "`render()` of Corridor raised an error: no ink.", fixed = TRUE)
})

test_that("an environment written in R must be reset after it was checked", {
  env <- corridor()
  check_env(env)
  expect_error(env$step(1), "reset", class = "gym_error_argument")
})

test_that("an environment in R that remembers over episodes is found out", {
  count <- 0
  env <- corridor(reset = function(self) {
    count <<- count + 1
    self$position <- count %% 4
  })
  expect_finding(env, "seeds", "The same seed, 1, and the same actions gave different first")
})

test_that("the mistakes of vectorised functions are found", {
  moves <- function(reward) {
    gym_env(
      function(self) self$at <- matrix(runif(2 * self$num_envs), ncol = 2),
      function(self, action) {
        self$at <- pmin(self$at + 0.1, 1)
        list(observation = self$at, reward = reward(self$num_envs), terminated = self$at[, 1] == 1)
      },
      observation_space = space_box(0, 1, 2), action_space = space_discrete(2),
      vectorized = TRUE, num_envs = 3
    )
  }
  expect_identical(nrow(check_env(moves(function(n) rep(1, n)))), 0L)
  expect_finding(moves(function(n) 1), "step", "`reward` must be one finite number for each")
})

test_that("an environment that sets a seed of its own is found", {
  drawing <- function(reset = function(self) runif(1), first = function() NULL) {
    gym_env(
      reset,
      function(self, action) {
        first()
        list(observation = runif(1), reward = 1, terminated = runif(1) < 0.2)
      },
      space_box(0, 1, shape = 1), space_discrete(2), max_episode_steps = 50
    )
  }
  expect_identical(nrow(check_env(drawing())), 0L)
  seeded_step <- check_env(drawing(first = function() set.seed(1)))
  expect_match(seeded_step$finding, "^`step\\(\\)` sets the state of the random generator",
               all = FALSE)
  seeded_reset <- check_env(drawing(reset = function(self) {
    set.seed(1)
    runif(1)
  }))
  expect_match(seeded_reset$finding, "^`reset\\(\\)` sets the state", all = FALSE)
})

# A walk with a model, which is true where nothing else is given.
modelled <- function(model, reset = function(self) self$at <- 1, slips = 0, ends = c(0, 3)) {
  gym_env(
    reset,
    function(self, action) {
      right <- xor(action == 1, runif(1) < slips)
      self$at <- max(self$at + if (right) 1 else -1, 0)
      list(observation = self$at, reward = as.numeric(self$at == 3), terminated = self$at %in% ends)
    },
    observation_space = space_discrete(4), action_space = space_discrete(2), id = "Walk",
    model = model, max_episode_steps = 50
  )
}

test_that("a model that says what is played is found to be right", {
  skip_unless_all()
  expect_identical(nrow(check_env(modelled(walk_table()))), 0L)
  slippery <- merge(walk_table(), data.frame(slip = c(FALSE, TRUE), probability = c(0.7, 0.3)))
  slippery$next_state <- with(slippery, ifelse(xor(action == 1, slip), state + 1, state - 1))
  slippery$reward <- as.numeric(slippery$next_state == 3)
  slippery$terminated <- slippery$next_state %in% c(0, 3)
  expect_identical(nrow(check_env(modelled(gym_model(slippery, start = 1), slips = 0.3))), 0L)
  expect_identical(nrow(check_env(model_env(gym_model(slippery), num_envs = 4))), 0L)
  expect_finding(modelled(walk_model(), slips = 0.3), "model",
                 "in play, which has the probability 0 in the model.")
})

test_that("starts, rewards and ends that a model does not have are found", {
  skip_unless_all()
  table <- walk_table()
  expect_finding(modelled(gym_model(table, start = 2)), "model", "started in state 1")
  table$reward <- 5 * table$reward
  expect_finding(modelled(gym_model(table, start = 1)), "model",
                 "state 3 in play for the reward 1, which by the model is 5.")
  expect_finding(modelled(walk_model(), ends = 3, reset = function(self) self$at <- 1), "model",
                 "Action 0 led from state 1 to state 0 in play and the episode went on")
  table$next_state[[4]] <- 4
  expect_finding(modelled(table), "model", "has the number 4, which its observation space")
  expect_finding(modelled(function(env) stop("no table")), "model", "no table")
})
