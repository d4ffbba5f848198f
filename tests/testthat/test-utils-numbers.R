expect_refused <- function(code, class = "gym_error_argument") {
  expect_error(code, "`bit64::as.double.integer64()`", fixed = TRUE, class = class)
}

five <- int64(5)

test_that("a setting that is an integer64 is refused with what to do", {
  unit <- space_discrete(1)
  expect_refused(check_count(five))
  expect_refused(check_number(five))
  expect_refused(check_above_zero(five))
  expect_refused(check_seed(five))
  expect_refused(rollout("x", policy_random(), episodes = five))
  expect_refused(rollout("x", policy_random(), seed = five))
  expect_refused(space_discrete(five))
  expect_refused(space_box(0, five))
  expect_refused(search_random("x", target = five))
  expect_refused(learn_q("FrozenLake-v1", learning_rate = five))
  expect_refused(tile_coding(bins = five))
})

test_that("tables, weights and observations that are integer64 are refused, in lists too", {
  table <- data.frame(state = c(0, 1), action = 0, next_state = c(1, 2), reward = 5)
  table$reward <- int64(c(5, -7))
  expect_refused(gym_model(table))
  expect_refused(bandit(mean = int64(c(3, 5))))
  w <- rbind(c(1, 2, -3, 4))
  network <- policy_linear(weights = w)
  expect_refused(policy_linear(weights = int64(w)))
  expect_refused(policy_candidates(network, int64(w)))
  expect_refused(policy_network(c(4, 1), weights = list(int64(w))))
  expect_refused(coef(network) <- int64(4:1))
  expect_refused(act(network, int64(c(1, 2, 3, 4))))
  rows <- data.frame(a = 1:2, b = 1, c = 1, d = 1)
  rows$a <- int64(1:2)
  expect_refused(predict(network, rows))
  expect_refused(policy_table(int64(rbind(0:1, 1:0))))
  expect_refused(mask_in(list(mask = int64(c(0, 1))), "mask", 1L, space_discrete(2), NULL))
  expect_refused(encode_seed(five))
  expect_refused(to_json(list(a = five)))
  expect_identical(plain_numbers(list(1:3, "a", NULL)), list(1:3, "a", NULL))
})

test_that("a value of a space that is an integer64 is refused", {
  for (dtype in c("float64", "int64", "uint8")) {
    expect_refused(check_value(space_box(0, 9, 2, dtype), int64(c(1, 2)), "", NULL),
                   "gym_error_space")
  }
  expect_refused(check_value(space_discrete(9), five, "", NULL), "gym_error_space")
  expect_refused(check_batch(space_discrete(9), batch_space(space_discrete(9), 2L), int64(1:2), 2L,
                             NULL), "gym_error_space")
})

test_that("an environment in R neither takes nor returns an integer64", {
  sent <- function(observation, reward = 1, vectorized = FALSE) {
    gym_env(
      function(self) numeric(if (vectorized) self$num_envs else 1),
      function(self, action) {
        list(observation = observation, reward = reward, terminated = 0 * action == 0)
      },
      space_discrete(9), space_discrete(4), vectorized = vectorized, num_envs = 2
    )
  }
  for (vectorized in c(FALSE, TRUE)) {
    numbers <- if (vectorized) 1:2 else 1
    env <- sent(int64(numbers), numbers, vectorized)
    env$reset()
    expect_error(env$step(numbers), class = "gym_error_space")
    expect_refused(env$step(int64(numbers)), "gym_error_space")
    env <- sent(numbers, int64(numbers), vectorized)
    env$reset()
    expect_error(env$step(numbers), "`reward`.* must be a number", class = "gym_error_argument")
  }
  env <- list(
    observation_space = space_discrete(9), action_space = space_discrete(2),
    spec = list(id = "Listed"), reset = function(seed = NULL) five, step = function(action) NULL
  )
  expect_refused(rollout(env, policy_random()))
})

# Decimal points --------------------------------------------------------------------------

expect_decimal_points <- function() {
  expect_identical(to_json(list(a = 0.5, b = 1e5)), '{"a":0.5,"b":100000}')
  expect_identical(from_json('{"a":[0.5,-1.25e3]}'), list(a = list(0.5, -1250)))
  expect_identical(option_text(c(0.5, 1e5)), c("0.5", "100000"))
  expect_identical(query_text(list(a = 0.5)), "?a=0.5")
  expect_identical(csv_lines(data.frame(a = 0.5, b = 1e5))[[2]], "0.5,100000")
  # For people they are as everywhere in the session.
  expect_identical(number_text(0.5), "0,5")
}

test_that("in a locale with a decimal comma programs get a decimal point", {
  local_locale("LC_NUMERIC", "de_DE", "ISO-8859-1")
  expect_identical(sprintf("%.1f", 0.5), "0,5")
  expect_decimal_points()
  expect_identical(sprintf("%.1f", 0.5), "0,5")
  expect_identical(getOption("OutDec"), ".")
})

test_that("with options(OutDec) programs get a decimal point", {
  withr::local_options(OutDec = ",")
  expect_decimal_points()
  expect_identical(getOption("OutDec"), ",")
})
