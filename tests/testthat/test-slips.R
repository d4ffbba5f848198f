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
