# Values as Python finds them in Gymnasium's own table.
solved_by_python <- function(id, kwargs = list(), horizon = 0) {
  json <- if (length(kwargs)) jsonlite::toJSON(kwargs, auto_unbox = TRUE) else "{}"
  said <- processx::run(working_python(), c(test_path("solve_models.py"), id, json, horizon))
  jsonlite::fromJSON(said$stdout)
}

model_from <- function(id, kwargs = list()) {
  rlang::exec("env_model", id, !!!kwargs, client = test_client())
}

cases <- list(
  list("FrozenLake-v1"), list("FrozenLake8x8-v1"), list("FrozenLake-v1", list(is_slippery = FALSE)),
  list("CliffWalking-v1"), list("CliffWalkingSlippery-v1"), list("Taxi-v4"),
  list("Taxi-v4", list(is_rainy = TRUE))
)

test_that("values are those that Python finds in Gymnasium's own tables", {
  skip_unless_all()
  for (case in cases) {
    model <- rlang::exec(model_from, !!!case)
    theirs <- rlang::exec(solved_by_python, !!!case)
    solved <- solve_mdp(model)
    expect_equal(unname(solved$values), theirs$values, tolerance = 1e-9, info = case[[1]])
    expect_equal(solved$start_value, theirs$start, tolerance = 1e-9, info = case[[1]])
    iterated <- solve_mdp(model, method = "policy_iteration")
    expect_equal(iterated$values, solved$values, tolerance = 1e-9, info = case[[1]])
  }
})

test_that("values within the limit are those that Python finds", {
  skip_unless_all()
  for (case in list(list("FrozenLake-v1", 100), list("FrozenLake8x8-v1", 200),
                    list("Taxi-v4", 200))) {
    theirs <- solved_by_python(case[[1]], horizon = case[[2]])
    solved <- solve_mdp(model_from(case[[1]]), horizon = case[[2]])
    expect_equal(unname(solved$values), theirs$values, tolerance = 1e-12)
  }
})

test_that("the known values come out", {
  value <- function(id, ...) round(solve_mdp(model_from(id), ...)$start_value, 4)
  expect_identical(value("FrozenLake-v1"), 0.8235)
  expect_identical(value("FrozenLake8x8-v1"), 1)
  expect_identical(round(value("FrozenLake-v1", horizon = 100), 3), 0.744)
  expect_identical(round(value("FrozenLake8x8-v1", horizon = 200), 3), 0.913)
  expect_identical(value("CliffWalking-v1"), -13)
  expect_identical(round(value("CliffWalkingSlippery-v1"), 1), -64.7)
  expect_identical(value("Taxi-v4"), 7.93)
})

test_that("the best policy of each ends its episodes, and plays as it is valued", {
  skip_unless_all()
  for (case in cases) {
    model <- rlang::exec(model_from, !!!case)
    solved <- solve_mdp(model)
    exact <- evaluate_policy(model, solved$policy, max_steps = Inf)
    expect_equal(exact$mean_return, solved$start_value, tolerance = 1e-9)
    expect_true(is.finite(exact$mean_length))
  }
  lake <- model_from("FrozenLake-v1")
  policy <- solve_mdp(lake)$policy
  played <- evaluate_policy("FrozenLake-v1", policy, episodes = 2000, seed = 1,
                            client = test_client())
  exact <- evaluate_policy(lake, policy)
  expect_lt(abs(played$mean_return - exact$mean_return), 4 * played$se)
})

test_that("an environment that was made has its model, too, and is not moved", {
  env <- local_env("FrozenLake-v1", is_slippery = FALSE)
  env$reset(seed = 1)
  env$step(2)
  model <- env_model(env)
  expect_identical(nrow(as.data.frame(model)), 64L)
  expect_identical(model$spec$max_episode_steps, env$spec$max_episode_steps)
  expect_identical(env$step(2)$observation, 2L)
})

test_that("where there is no model it is said", {
  client <- test_client()
  expect_error(env_model("CartPole-v1", client = client), class = "gym_error_http")
  expect_error(env_model(local_env("FrozenLake-v1", num_envs = 2)), class = "gym_error_http")
  wrapped <- gym_wrap("FrozenLake-v1", "ClipReward", max_reward = 0.5)
  expect_error(env_model(wrapped, client = client), "ClipReward", class = "gym_error_http")
  expect_error(env_model(3), class = "gym_error_argument")
})

test_that("an environment in R has the model that it was given", {
  make <- function(model) {
    gym_env(
      reset = function(self) 1L, step = function(self, action) NULL, model = model,
      observation_space = space_discrete(4), action_space = space_discrete(2), id = "Walk-v0",
      max_episode_steps = 9
    )
  }
  for (model in list(walk_table(), gym_model(walk_table()), function(env) walk_table())) {
    found <- env_model(make(model))
    expect_identical(as.data.frame(found), as.data.frame(walk_model()))
    expect_identical(found$spec$id, "Walk-v0")
    expect_identical(found$spec$max_episode_steps, 9L)
  }
  expect_error(env_model(make(NULL)), "Walk-v0 has no model", class = "gym_error_no_model")
  expect_error(make(5), "`model` must be a model", class = "gym_error_argument")
  gym_register("OwnWalk-v0", make(walk_table()))
  withr::defer(gym_unregister("OwnWalk-v0"))
  expect_equal(solve_mdp("OwnWalk-v0", policy = policy_random())$values[["1"]], 1 / 3)
})

test_that("a model has all states and actions of its environment, used or not", {
  make <- function(model, observation_space, actions = 2) {
    gym_env(
      reset = function(self) 11, model = model,
      step = function(self, action) {
        list(observation = if (action == 1) 13 else 10, reward = action, terminated = TRUE)
      },
      observation_space = observation_space, action_space = space_discrete(actions), id = "Far-v0",
      max_episode_steps = 9
    )
  }
  far <- walk_table()
  far[c("state", "next_state")] <- far[c("state", "next_state")] + 10
  for (model in list(far, gym_model(far, start = 11))) {
    env <- make(model, space_discrete(3300), 3)
    found <- env_model(env)
    expect_length(found$start, 3300)
    expect_identical(which(found$start > 0), c("11" = 12L))
    expect_identical(dim(solve_mdp(found)$q), c(3300L, 3L))
    learned <- learn_q(env, iterations = 2, seed = 1)
    expect_identical(dim(learned$policy$q), c(3300L, 3L))
    expect_identical(learned$final$episodes, 0L)
  }
  expect_error(env_model(make(far, space_discrete(12))), "has the number 12, which its observation",
               class = "gym_error_argument")
  expect_error(env_model(make(far, space_discrete(14), 1)), "its action space",
               class = "gym_error_argument")
  expect_error(
    env_model(make(far, space_multi_discrete(c(55, 60)))),
    "Discrete for now, but Far-v0.*observation_space = space_discrete\\(3300\\)",
    class = "gym_error_argument"
  )
})

test_that("of a table that names no start episodes start where `reset()` does", {
  make <- function(reset, model = walk_table(), ...) {
    gym_env(
      reset = reset, step = function(self, action) NULL, model = model,
      observation_space = space_discrete(4), action_space = space_discrete(2), id = "Walk-v0", ...
    )
  }
  start_of <- function(...) env_model(make(...))$start
  at_two <- c("0" = 0, "1" = 0, "2" = 1, "3" = 0)
  expect_identical(start_of(function(self) 2), at_two)
  expect_identical(start_of(function(self) 2, function(env) walk_table()), at_two)
  expect_identical(start_of(function(self) rep(2, self$num_envs), vectorized = TRUE), at_two)
  # A model says where itself.
  expect_identical(start_of(function(self) 2, walk_model())[["1"]], 1)

  drawn <- function(self) sample(1:2, 1, prob = c(0.2, 0.8))
  before <- make(drawn)
  set.seed(1)
  expect_message(start <- env_model(before)$start, "1000 resets", class = "gym_message_model")
  expect_equal(unname(start), c(0, 0.2, 0.8, 0), tolerance = 0.1)
  expect_identical(suppressMessages(env_model(before))$start, start)
  after <- runif(1)
  set.seed(1)
  expect_identical(runif(1), after)
  expect_error(env_model(make(function(self) 3)), "starts in state 3", class = "gym_error_argument")
})

test_that("an environment in R with sub-environments has the model of one of them", {
  model <- walk_model()
  env <- model_env(model, num_envs = 4)
  expect_identical(env_model(env)$transitions, model$transitions)
  learned <- learn_q(env, iterations = 20, seed = 1)
  expect_identical(c(learned$final$mean_return, learned$final$episodes), c(1, 0))
})
