test_that("an integer64 becomes the doubles that it stands for", {
  numbers <- c(0, 1, -1, 5, 2^31 - 1, -2^31 + 1)
  expect_identical(plain_numbers(int64(numbers)), numbers)
  expect_identical(plain_numbers(int64(c(a = 1, b = 2))), c(a = 1, b = 2))
  expect_identical(plain_numbers(int64(rbind(1:2, 3:4))), rbind(c(1, 2), c(3, 4)))
  expect_identical(plain_numbers(structure(-0, class = "integer64")), NA_real_)
  expect_identical(plain_numbers(1:3), 1:3)
  expect_null(plain_numbers(NULL))
  parts <- list(a = int64(5), b = list("text", NULL, int64(6)))
  expect_identical(narrow_values(parts), list(a = 5, b = list("text", NULL, 6)))
  table <- data.frame(n = 1:2)
  table$n <- int64(1:2)
  expect_identical(narrow_values(table), data.frame(n = c(1, 2)))
})

test_that("an integer64 is written by its digits", {
  expect_identical(whole_text(int64(c(5, -7))), c("5", "-7"))
  expect_identical(to_json(list(a = int64(5), b = int64(1:2))), '{"a":5,"b":[1,2]}')
  expect_identical(to_json(structure(-0, class = "integer64")), "null")
  expect_identical(describe_argument(int64(5)), "the integer64 5")
})

test_that("an integer64 beyond 2^53 is refused where numbers are calculated with", {
  skip_if_not_installed("bit64")
  weights <- int64_beyond_double()
  error <- expect_error(plain_numbers(weights), class = "gym_error_argument")
  expect_match(conditionMessage(error), "`weights`.*9007199254740993.*2\\^53")
  # The values of a space may be as large.
  expect_identical(whole_text(narrow_integer64(weights)), "9007199254740993")
})

test_that("a setting that is an integer64 is refused with what to do", {
  skip_unless_all()
  step <- function(self, action) NULL
  unit <- space_discrete(1)
  expect_refused <- function(code) {
    error <- expect_error(code, class = "gym_error_argument")
    expect_match(conditionMessage(error), "the integer64 5.*as.numeric\\(\\)")
  }
  five <- int64(5)
  expect_refused(check_count(five))
  expect_refused(check_number(five))
  expect_refused(check_above_zero(five))
  expect_refused(check_seed(five))
  expect_refused(rollout("x", policy_random(), episodes = five))
  expect_refused(rollout("x", policy_random(), num_envs = five))
  expect_refused(rollout("x", policy_random(), max_steps = five))
  expect_refused(rollout("x", policy_random(), seed = five))
  expect_refused(space_discrete(five))
  expect_refused(space_box(0, five))
  expect_refused(space_multi_discrete(five))
  expect_refused(solve_mdp(gym_model(data.frame(
    state = 0, action = 0, next_state = 1, reward = 1
  )), discount = five))
  expect_refused(search_random("x", target = five))
  expect_refused(train_agent(agent_hill_climb(), "x", iterations = five))
  expect_refused(learn_q("FrozenLake-v1", learning_rate = five))
  expect_refused(tile_coding(bins = five))
})

test_that("seeds, tables and weights may be integer64", {
  table <- data.frame(state = c(0, 1), action = 0, next_state = c(1, 2), reward = c(5, -7))
  wide <- table
  wide[] <- lapply(table, int64)
  expect_identical(gym_model(wide, start = int64(0)), gym_model(table, start = 0))
  model <- gym_model(table)
  expect_identical(solve_mdp(model, int64(c(0, 0, 0)))$values,
                   solve_mdp(model, c(0, 0, 0))$values)
  bandit <- definition_of(bandit(mean = int64(c(3, 5))))$parameters$bandit
  expect_identical(bandit$mean, c(3, 5))
  w <- rbind(c(1, 2, -3, 4))
  expect_identical(policy_linear(weights = int64(w)), policy_linear(weights = w))
  network <- policy_linear(weights = w)
  expect_identical(policy_candidates(network, int64(w)), policy_candidates(network, w))
  expect_identical(policy_network(c(4, 1), weights = list(int64(w)))$weights, list(w))
  coef(network) <- int64(4:1)
  expect_identical(coef(network), c(4, 3, 2, 1))
  expect_identical(act(network, int64(c(1, 2, 3, 4))), act(network, c(1, 2, 3, 4)))
  rows <- data.frame(a = 1:2, b = 1, c = 1, d = 1)
  wide <- rows
  wide$a <- int64(1:2)
  expect_identical(predict(network, wide), predict(network, rows))
  q <- rbind(c(0, 1, 0), c(2, 0, 0))
  expect_identical(act(policy_table(int64(q)), int64(0:1)), c(1L, 0L))
  expect_identical(mask_in(list(mask = int64(c(0, 1))), "mask", 1L, space_discrete(2), NULL),
                   rbind(c(FALSE, TRUE)))
  expect_identical(encode_seed(int64(5)), "5")
  one_missing <- structure(c(unclass(int64(5)), -0), class = "integer64")
  expect_identical(encode_seed(one_missing, 2), "[5,null]")
  expect_identical(option_text(int64(c(5, 6))), c("5", "6"))
})

test_that("an action that is an integer64 is sent as its numbers", {
  for (dtype in c("float64", "float32", "float16", "int8", "int16", "int32", "int64", "uint8")) {
    space <- space_box(0, 9, 2, dtype)
    check_value(space, int64(c(1, 2)), "", NULL, bounds = TRUE)
    expect_identical(write_value(space, int64(c(1, 2))), "[1,2]")
    expect_identical(to_tensors(space, int64(c(1, 2)), "action", NULL),
                     to_tensors(space, c(1, 2), "action", NULL))
  }
  expect_error(check_value(space_box(-1, 9, 1), int64(-2), "", NULL, bounds = TRUE),
               "the integer64 -2", class = "gym_error_space")
  expect_error(check_value(space_discrete(3), structure(-0, class = "integer64"), "", NULL),
               class = "gym_error_space")
})

test_that("an environment in R may return integer64, and takes actions that are", {
  counter <- function(vectorized = FALSE) {
    gym_env(
      reset = function(self) int64(cbind(rep(3, self$num_envs %||% 1L))[, 1L]),
      step = function(self, action) {
        list(observation = int64(10 * action), reward = int64(-action),
             terminated = rep(TRUE, length(action)))
      },
      space_discrete(100), space_discrete(4), vectorized = vectorized
    )
  }
  env <- counter()
  expect_identical(env$reset(seed = int64(5)), 3L)
  out <- env$step(int64(2))
  expect_identical(out[c("observation", "reward")], list(observation = 20L, reward = -2))
  always_two <- function(observation) int64(rep(2, length(observation)))
  for (env in list(counter(), counter(vectorized = TRUE))) {
    played <- rollout(env, always_two, episodes = 3, steps = TRUE, seed = 1)
    expect_identical(played$steps$reward, c(-2, -2, -2))
    expect_identical(played$steps$action, c(2, 2, 2))
  }
  floats <- gym_env(
    function(self) int64(c(1, 2)),
    function(self, action) list(observation = int64(c(3, -4)), reward = action, terminated = TRUE),
    space_box(-9, 9, 2), space_box(-9, 9, 1)
  )
  expect_identical(floats$reset(seed = 1), c(1, 2))
  expect_identical(floats$step(int64(-6))[1:2], list(observation = c(3, -4), reward = -6))
})
