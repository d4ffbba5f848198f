# The errors and hints that common slips get.

test_that("the error for an action that is none names those that there are", {
  env <- local_env()
  env$reset()
  cnd <- expect_error(env$step(2), "The action 2 is not in Discrete(2)", fixed = TRUE,
                      class = "gym_error_space")
  expect_match(conditionMessage(cnd), "Actions are 0 and 1, counted from 0.", fixed = TRUE)
  expect_identical(cnd$code, "action_not_in_space")
  sub_envs <- local_env(num_envs = 3)
  sub_envs$reset()
  expect_error(sub_envs$step(c(0, 2, 1)), "Actions are 0 and 1, counted from 0.", fixed = TRUE,
               class = "gym_error_space")
})

test_that("an argument of gym_make() that nearly is one is named", {
  client <- test_client()
  make <- function(...) gym_make("CartPole-v1", ..., client = client)
  cnd <- expect_error(make(num_env = 3), "has an argument `num_env`", fixed = TRUE,
                      class = "gym_error_http_400")
  expect_match(conditionMessage(cnd), "Did you mean `num_envs`?", fixed = TRUE)
  expect_no_match(conditionMessage(cnd), "__init__")
  expect_identical(cnd$code, "invalid_kwargs")
  expect_identical(as.character(cnd$call[[1L]]), "gym_make")
  meant <- function(...) {
    message <- conditionMessage(tryCatch(make(...), error = identity))
    if (grepl("Did you mean", message)) sub(".*Did you mean `([a-z_]+)`.*", "\\1", message)
  }
  expect_identical(meant(render.mode = "human"), "render_mode")
  expect_identical(meant(wrapper = list()), "wrappers")
  expect_identical(meant(autoreset = "NextStep"), "autoreset_mode")
  expect_identical(meant(max_episode_step = 3), "max_episode_steps")
  expect_identical(meant(max_steps = 3), "max_episode_steps")
  expect_null(meant(gravity = 3))
})

test_that("a name that an environment does not have is an error that names what there is", {
  env <- local_env()
  cnd <- expect_error(env$stpe(1), "no `$stpe`", fixed = TRUE, class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "Did you mean `$step`?", fixed = TRUE)
  expect_match(conditionMessage(cnd), "`$observation_space`", fixed = TRUE)
  expect_error(env$nothing, "no `$nothing`", fixed = TRUE, class = "gym_error_argument")
  expect_error(env$nothing <- 1, "locked")
  # What there is, and how else R asks.
  expect_null(env$num_envs)
  expect_true(env$is_open)
  expect_null(env[["nothing"]])
  expect_true(all(c("step", "reset", "spec") %in% names(env)))
  expect_identical(utils:::.DollarNames(env, "^ste"), "step")
  expect_identical(format(env), "<gym_env: CartPole-v1>")
  expect_output(print(env), "<gym_env: CartPole-v1>")
  expect_output(str(env), "gym_env")
})

test_that("an error names the function that was called, not one that this calls", {
  corridor <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = 0, reward = 1, terminated = TRUE),
    observation_space = space_discrete(1), action_space = space_discrete(2)
  )
  random <- policy_random()
  found <- search_random(corridor, policy_network(c(1, 1)), rounds = 1, episodes = 1)
  found$env <- 3
  objective <- gym_objective(corridor, episodes = 1, seed = 1)
  calls <- alist(
    rollout(corridor, random, size = 3),
    evaluate_policy(corridor, random, episodes = 0),
    evaluate_policy(corridor, random, size = 3),
    evaluate_policy(corridor, function(observation) "left"),
    summary(found),
    learn_q(corridor, iterations = 0),
    learn_q(corridor, iterations = 1, discount = 3),
    learn_sarsa(corridor, iterations = 1, n = 0),
    learn_td(corridor, random, iterations = 0),
    learn_monte_carlo(corridor, iterations = 1, size = 3),
    search_ars(corridor, iterations = 0),
    search_cem(corridor, iterations = 1, population = -1),
    search_hill_climb(corridor, iterations = 1, noise = 0),
    gym_objective(corridor, size = 3),
    objective(1:9),
    solve_mdp(corridor)
  )
  if (requireNamespace("magick", quietly = TRUE)) {
    calls <- c(calls, quote(animate(random, env = 3)), quote(animate(random, env = corridor)))
  }
  for (call in calls) {
    cnd <- expect_error(eval(call), class = "gym_error_argument")
    expect_identical(cnd$call[[1L]], call[[1L]], info = deparse1(call))
  }
  asked <- 0
  failing <- function(observation) {
    asked <<- asked + 1
    if (asked > 12) "left" else integer(length(observation))
  }
  cnd <- expect_error(
    evaluate_policy(corridor, failing, episodes = 300, seed = 1),
    class = "gym_error_rollout"
  )
  expect_identical(cnd$call[[1L]], quote(evaluate_policy))
  expect_identical(cnd$parent$call[[1L]], quote(evaluate_policy))
})

corridor <- gym_env(
  reset = function(self) 0,
  step = function(self, action) list(observation = 0, reward = 1, terminated = TRUE),
  observation_space = space_discrete(1), action_space = space_discrete(2)
)

test_that("an action that a policy returns and that is none is the policy's, not a step's", {
  none <- function(observation) rep(NA, NROW(observation))
  for (env in list(corridor, local_env("CartPole-v1"), local_env("CartPole-v1", num_envs = 2))) {
    cnd <- expect_error(rollout(env, none, 2),
                        "The value NA does not fit.*The policy returned this action",
                        class = "gym_error_space")
    expect_identical(cnd$call[[1L]], quote(rollout))
  }
})

test_that("a missing argument is named", {
  expect_error(rollout(corridor), "`policy` is missing", class = "gym_error_argument")
  cnd <- expect_error(evaluate_policy(corridor), "`policy` is missing",
                      class = "gym_error_argument")
  expect_identical(cnd$call[[1L]], quote(evaluate_policy))
  expect_error(local_env("CartPole-v1")$step(), "`action` is missing", class = "gym_error_argument")
})

test_that("an error of a picture names plot()", {
  trained <- train_agent(agent_hill_climb(), fake_environment(), iterations = 1, eval_episodes = 2,
                         target = Inf, seed = 1)
  cnd <- expect_error(plot(trained, type = "decision"), class = "gym_error_argument")
  expect_identical(cnd$call[[1L]], quote(plot))
})

test_that("a misspelt argument of the agent is named where the budget is missing", {
  expect_error(train_agent(agent_ars(), fake_environment(), stepsize = 0.1),
               "`stepsize`.*goes into its parentheses: `step_size`", class = "gym_error_argument")
})

test_that("the request stands in the error's parent, not in its text", {
  env <- local_env("CartPole-v1")
  env$reset()
  cnd <- expect_error(env$step(3), "not in Discrete(2)", fixed = TRUE)
  own <- paste(c(cnd$message, cnd$body), collapse = "\n")
  expect_false(grepl("POST", own))
  expect_match(conditionMessage(cnd$parent), "POST http.*/stream/.* \\[400 Bad Request\\]")
})

test_that("a table for observations that cannot be counted is refused by the call", {
  cnd <- expect_error(learn_q("CartPole-v1", total_steps = 10, client = test_client()),
                      "cannot", class = "gym_error_argument")
  expect_identical(cnd$call[[1L]], quote(learn_q))
})

test_that("hints are calls that help", {
  q <- learn_q(corridor, iterations = 1, seed = 1, target = Inf, eval_episodes = 2)
  expect_error(coef(q$policy), "state_values(training)", fixed = TRUE, class = "gym_error_argument")
  expect_error(plot(q$policy), "state_values(training)", fixed = TRUE, class = "gym_error_argument")
  expect_length(state_values(q), 1)
  folder <- file.path(withr::local_tempdir(), "runs")
  train <- function(...) {
    train_agent(agent_ars(), fake_environment(), iterations = 1, eval_episodes = 2, target = Inf,
                checkpoint = file.path(folder, "a.rds"))
  }
  cnd <- expect_error(train(), "dir.create(", fixed = TRUE, class = "gym_error_checkpoint")
  expect_no_match(conditionMessage(cnd), "resume")
  expect_error(evaluate_policy(corridor, policy_random(), seeds = 1), "Did you mean `seed`?",
               fixed = TRUE, class = "gym_error_argument")
})
