test_that("wrappers are written with a pipe and print in one line", {
  wrapped <- "CartPole-v1" |>
    gym_wrap("TimeLimit", max_episode_steps = 50) |>
    gym_wrap("NormalizeReward")
  expect_output(
    print(wrapped), "<CartPole-v1 |> TimeLimit(max_episode_steps = 50) |> NormalizeReward()>",
    fixed = TRUE
  )
  expect_identical(
    wrappers_json(wrapped$wrappers),
    paste0("[{\"name\":\"TimeLimit\",\"kwargs\":{\"max_episode_steps\":50}},",
           "{\"name\":\"NormalizeReward\"}]")
  )
})

test_that("what is no wrapper is refused before anything is sent", {
  for (bad in list(1, "TimeLimit", list("TimeLimit"), list(list(1)), list(list("a", 2)))) {
    expect_error(
      env_create(create_GymClient("http://127.0.0.1:1"), "CartPole-v1", wrappers = bad),
      "wrappers", class = "gym_error_argument"
    )
  }
  expect_error(gym_wrap("CartPole-v1", 3), class = "gym_error_argument")
  expect_error(gym_wrap("CartPole-v1", "TimeLimit", 3), class = "gym_error_argument")
})

length_of_episode <- function(env) {
  env$reset(seed = 1)
  for (step in 1:100) if (env$step(step %% 2)$done) break
  step
}

test_that("a wrapper is applied at creation, in each way to make an environment", {
  client <- test_client()
  limit <- list(list("TimeLimit", max_episode_steps = 7))
  expect_identical(length_of_episode(local_env("CartPole-v1", wrappers = limit)), 7L)
  wrapped <- gym_wrap("CartPole-v1", "TimeLimit", max_episode_steps = 7)
  expect_identical(length_of_episode(local_env(wrapped)), 7L)
  id <- env_create(client, "CartPole-v1", wrappers = limit)
  env_reset(client, id, seed = 1)
  done <- vapply(1:7, function(i) env_step(client, id, i %% 2)$truncated, NA)
  expect_identical(done, rep(c(FALSE, TRUE), c(6, 1)))
  env_close(client, id)
  balance <- function(observation) as.integer(observation[, 3] + observation[, 4] > 0)
  expect_identical(rollout(wrapped, balance, seed = 1, client = client)$episodes$length, 7L)
})

test_that("the spaces are those of the wrapped environment, in the order of the pipe", {
  env <- local_env(
    "CartPole-v1" |> gym_wrap("FrameStackObservation", stack_size = 3) |>
      gym_wrap("FlattenObservation")
  )
  expect_identical(env$observation_space$shape, 12L)
  expect_length(env$reset(), 12)
  pendulum <- local_env(gym_wrap("Pendulum-v1", "RescaleAction", min_action = -1, max_action = 1))
  expect_identical(pendulum$action_space$high, 1)
})

test_that("a wrapper that is not allowed, or has no such argument, is the server's error", {
  error <- expect_error(local_env(gym_wrap("CartPole-v1", "RecordVideo")),
                        class = "gym_error_http_400")
  expect_identical(error$code, "wrapper_not_allowed")
  expect_match(conditionMessage(error), "TimeLimit")
  error <- expect_error(local_env(gym_wrap("CartPole-v1", "TimeLimit", steps = 1)),
                        class = "gym_error_http_400")
  expect_identical(error$code, "invalid_kwargs")
})

# MountainCar's observations and their units, without its server.
slow_car <- function() {
  gym_env(
    function(self) c(self$position <- -0.5, 0),
    function(self, action) {
      self$position <- self$position + 0.1 * (action - 1)
      list(
        observation = c(self$position, 0), reward = -1, terminated = abs(self$position + 0.5) > 0.5
      )
    },
    space_box(c(position = -1.2, velocity = -0.07), c(0.6, 0.07)), space_discrete(3),
    id = "MountainCar-v0", max_episode_steps = 20
  )
}

test_that("titles and prints name the wrappers of what was played", {
  car <- slow_car() |> gym_wrap("TransformReward", func = function(reward) reward / 10)
  name <- "MountainCar-v0 |> TransformReward"
  policy <- policy_network(c(2, 3), weights = list(matrix(1:6 / 10, 3)))
  played <- rollout(car, policy, 3, seed = 1, steps = TRUE)
  map <- decision_map(car, policy)
  search <- search_random(car, policy, rounds = 2, episodes = 1, target = -100, seed = 1,
                          progress = FALSE)
  repeated <- search_random(car, policy, rounds = 2, episodes = 1, target = -100, seeds = 1:2,
                            progress = FALSE)
  train <- function(env) {
    train_agent(agent_hill_climb(), env, policy = policy, iterations = 2, eval_every = 1,
                eval_episodes = 2, target = Inf, seed = 1, progress = FALSE)
  }
  trained <- train(car)
  compared <- suppressWarnings(compare_trainings(trained, seed = 1))
  title <- function(...) gsub("\n", " ", ggplot2::autoplot(...)$labels$title)
  plotted <- list(
    title(played), title(played, type = "trajectory"), title(a = played, b = played), title(map),
    title(evaluate_policy(car, policy, 2, seed = 1)), title(search), title(repeated),
    title(search$policy), title(trained), title(compared),
    title(a = trained, b = trained)
  )
  for (shown in plotted) expect_match(shown, name, fixed = TRUE)
  objective <- gym_objective(car, policy, episodes = 1, seed = 1)
  for (result in list(played, map, search, repeated, trained, compared, objective)) {
    expect_output(print(result), name, fixed = TRUE)
  }
  # What differs by its wrapper alone stays in one panel.
  expect_identical(title(a = train(slow_car()), b = trained), paste0("MountainCar-v0, ", name))
})

test_that("values that a wrapper has changed have no units and no limits", {
  labels <- function(env) {
    played <- rollout(env, policy_random(), seed = 1, steps = TRUE)
    drawn <- trajectory_plot_data(played)
    list(names = names(drawn$titles), limits = nrow(drawn$limits))
  }
  car <- slow_car()
  kept <- list(names = c("position (m)", "velocity", "action"), limits = 1L)
  expect_identical(labels(car), kept)
  expect_identical(labels(gym_wrap(car, "TimeLimit", max_episode_steps = 3)), kept)
  changed <- list(names = c("position", "velocity", "action"), limits = 0L)
  tenth <- function(observation) observation / 10
  network <- policy_network(c(2, 3), weights = list(matrix(1:6 / 10, 3)))
  wrapped <- gym_wrap(car, "TransformObservation", func = tenth)
  expect_identical(labels(wrapped), changed)
  map <- decision_map(wrapped, network, xlim = 0:1, ylim = 0:1)
  expect_identical(ggplot2::autoplot(map)$labels$x, "position")
  own <- gym_wrap(car, "TransformObservation", func = tenth,
                  observation_space = space_box(-1, 1, shape = 2))
  expect_identical(labels(own)$names, c("obs_1", "obs_2", "action"))
  swapped <- gym_wrap(car, "TransformObservation", func = function(observation) observation[, 2:1])
  expect_error(rollout(swapped, policy_random(), 2, num_envs = 2),
               "returned `velocity`, `position` for", class = "gym_error_wrapper")
})

# Around environments written in R ---------------------------------------------------------

# Walks to the right, by what the action says.
steps_of <- function(vectorized = FALSE, ..., reward = function(x) x,
                     ends = function(x) x >= 3) {
  gym_env(
    function(self) {
      n <- if (vectorized) self$num_envs else 1
      self$x <- matrix(runif(2 * n), n)
      if (vectorized) self$x else self$x[1, ]
    },
    function(self, action) {
      self$x <- self$x + as.vector(action)
      list(
        observation = if (vectorized) self$x else self$x[1, ], reward = reward(self$x[, 1]),
        terminated = ends(self$x[, 1])
      )
    },
    observation_space = space_box(c(x = -10, y = -10), 10), action_space = space_box(0, 1),
    vectorized = vectorized, ...
  )
}

test_that("an id that is registered is wrapped when it is made, and played so", {
  gym_register("Steps-v0", steps_of())
  withr::defer(gym_unregister("Steps-v0"))
  wrapped <- "Steps-v0" |>
    gym_wrap("TimeLimit", max_episode_steps = 2) |>
    gym_wrap("TransformReward", func = function(reward) pmin(reward, 0.5))
  expect_s3_class(wrapped, "gym_wrapped")
  played <- rollout(wrapped, policy_random(), episodes = 20, seed = 1)
  expect_identical(played$episodes$length, rep(2L, 20))
  expect_true(all(played$episodes$return <= 1))
  env <- gym_make(wrapped)
  expect_identical(env$spec$max_episode_steps, 2L)
  also <- gym_make("Steps-v0", wrappers = list(list("TimeLimit", max_episode_steps = 2)))
  expect_identical(also$spec$max_episode_steps, 2L)
})

test_that("a wrapped environment is one in which nothing is wrong", {
  for (vectorized in c(FALSE, TRUE)) {
    env <- gym_wrap(steps_of(vectorized), "TimeLimit", max_episode_steps = 3)
    expect_identical(nrow(check_env(env)), 0L)
    env$reset()
    for (step in 1:3) out <- env$step(rep(0, env$num_envs %||% 1))
    expect_true(all(out$truncated))
  }
})

test_that("the time limit is Gymnasium's, and never above the environment's own", {
  env <- steps_of(max_episode_steps = 5)
  expect_identical(gym_wrap(env, "TimeLimit", max_episode_steps = 9)$spec$max_episode_steps, 5L)
  expect_identical(gym_wrap(env, "TimeLimit", max_episode_steps = 3)$spec$max_episode_steps, 3L)
})

test_that("a wrapper or an argument that there is not is an error that lists what there is", {
  env <- steps_of()
  wrong <- function(object, message) {
    expect_error(object, message, fixed = TRUE, class = "gym_error_argument")
  }
  wrong(gym_wrap(env, "FrameStack"), "There is no wrapper \"FrameStack\" for environments")
  wrong(gym_wrap(env, "FrameStack"), "There are TimeLimit, TransformReward, TransformObs")
  gym_register("Steps-v0", env)
  withr::defer(gym_unregister("Steps-v0"))
  wrong(gym_wrap("Steps-v0", "FrameStack"), "There is no wrapper \"FrameStack\"")
  wrong(gym_wrap(env, 3), "`wrapper` must be a string")
  wrong(gym_wrap(3, "TimeLimit"), "`env_id` must be")
  wrong(gym_wrap(list(), "TimeLimit"), "`env_id` must be the id of an environment, or one made by")
  wrong(gym_wrap(env, "TimeLimit", 3), "Further arguments need names")
  wrong(gym_wrap(env, "TimeLimit"),
        "TimeLimit needs the argument `max_episode_steps`: its arguments are `max_episode_steps`.")
  wrong(gym_wrap(env, "TimeLimit", steps = 3), "TimeLimit has no argument `steps`: its arguments")
  wrong(gym_wrap(env, "TimeLimit", max_episode_steps = 0), "`max_episode_steps` must be")
})

test_that("a wrapper that has ended names what replaces it", {
  gym_register("Steps-v0", steps_of())
  withr::defer(gym_unregister("Steps-v0"))
  for (env in list(steps_of(), "Steps-v0")) {
    expect_error(gym_wrap(env, "ClipReward", max_reward = 1), "wrapper \"TransformReward\"",
                 class = "gym_error_defunct")
  }
})
