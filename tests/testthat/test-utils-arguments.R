test_that("a message names the argument and the value", {
  f <- function(rounds) check_count(rounds)
  expect_error(f(0), "`rounds` must be a whole number of at least 1, not 0.", fixed = TRUE,
               class = "gym_error_argument")
  cnd <- tryCatch(f(2.5), gym_error = identity)
  expect_identical(cnd$argument, "rounds")
  expect_identical(cnd$value, 2.5)
  expect_identical(conditionCall(cnd)[[1]], quote(f))
})

test_that("a count is one whole number, whatever its type", {
  expect_identical(check_count(3), 3)
  expect_identical(check_count(3L), 3L)
  expect_identical(check_count(0, min = 0), 0)
  for (bad in list(0, -1, 1.5, NA, NA_real_, NaN, Inf, "3", TRUE, NULL, 1:2, list(1), 1e10)) {
    expect_error(check_count(bad), class = "gym_error_argument")
  }
})

test_that("NULL is a count only where it is allowed", {
  expect_null(check_count(NULL, allow_null = TRUE))
  expect_error(check_count("a", allow_null = TRUE), "of at least 1 or NULL, not \"a\"",
               class = "gym_error_argument")
})

test_that("a seed may be negative or zero but not a fraction", {
  expect_identical(check_seed(0), 0)
  expect_identical(check_seed(-5L), -5L)
  expect_null(check_seed(NULL))
  seed <- 0.5
  expect_error(check_seed(seed), "`seed` must be a whole number or NULL, not 0.5.", fixed = TRUE)
  for (bad in list(NA, "1", 1:2, -2^31, 2^53 + 2, Inf)) {
    expect_error(check_seed(bad), class = "gym_error_argument")
  }
  seed <- 2^60
  expect_error(check_seed(seed), "of at most 9007199254740992 or NULL", fixed = TRUE)
})

test_that("a large seed is one everywhere", {
  large <- 2^40
  # As it goes to a server.
  expect_identical(encode_seed(large), "1099511627776")
  env <- gym_env(
    reset = function(self) runif(1),
    step = function(self, action) list(observation = runif(1), reward = 1, terminated = TRUE),
    observation_space = space_box(0, 1), action_space = space_discrete(2)
  )
  expect_identical(env$reset(seed = large), env$reset(seed = large))
  gym_register("Large-v0", env)
  withr::defer(gym_unregister("Large-v0"))
  expect_identical(gym_make("Large-v0", seed = large)$reset(), env$reset(seed = large))
  expect_identical(sum(check_env(env, seed = large)$severity == "wrong"), 0L)
  play <- function(seed) rollout(env, policy_random(), episodes = 2, seed = seed, steps = TRUE)
  expect_identical(play(large)$seed, large)
  expect_identical(play(large)$steps, play(large)$steps)
  expect_false(identical(play(large)$steps, play(large + 1)$steps))
  repeated <- search_random(env, policy_network(c(1, 1)), rounds = 1, episodes = 1, target = 9,
                            seeds = c(1, large))
  expect_identical(as.data.frame(repeated)$seed, c(1, large))
  trained <- train_agent(agent_cem(4, 2), env, iterations = 1, seeds = c(1, large), target = 9,
                         eval_episodes = 2)
  expect_identical(as.data.frame(trained)$seed, c(1, large))
  expect_identical(as.data.frame(trained[["trainings"]][["1"]])$iteration, 1L)
})

test_that("a number may be infinite but not missing, and has its bounds named", {
  expect_identical(check_number(Inf), Inf)
  x <- -1
  expect_error(check_number(x, min = 0, max = 1), "a number from 0 to 1, not -1.", fixed = TRUE)
  for (bad in list(NA, NaN, "1", c(1, 2), TRUE, matrix(1))) {
    expect_error(check_number(bad), class = "gym_error_argument")
  }
})

test_that("flags, strings and choices take nothing else", {
  expect_true(check_flag(TRUE))
  expect_identical(check_string("a"), "a")
  expect_null(check_string(NULL, allow_null = TRUE))
  expect_identical(check_choice("a", c("a", "b")), "a")
  for (bad in list(NA, 1, "TRUE", NULL, c(TRUE, FALSE))) {
    expect_error(check_flag(bad), class = "gym_error_argument")
  }
  for (bad in list(NA_character_, "", 1, NULL, c("a", "b"))) {
    expect_error(check_string(bad), class = "gym_error_argument")
  }
  type <- "c"
  expect_error(check_choice(type, c("a", "b")), "`type` must be one of \"a\", \"b\", not \"c\".",
               fixed = TRUE)
})

test_that("what is long or odd is described, not printed", {
  x <- rnorm
  expect_error(check_count(x), "not a function.", fixed = TRUE)
  x <- 1:100
  expect_error(check_count(x), "not an integer vector of length 100.", fixed = TRUE)
  x <- data.frame(a = 1)
  expect_error(check_count(x), "not a data frame with 1 row", fixed = TRUE)
})

test_that("a missing package is named", {
  expect_error(check_suggested("notthere", "draw"), "install.packages(\"notthere\")", fixed = TRUE,
               class = "gym_error_argument")
  expect_silent(check_suggested("stats", "draw"))
})

test_that("the name of an environment's argument is never completed to another's", {
  ends_after <- function(p = 9, s = 1, ...) {
    gym_env(
      function(self) self$taken <- 0,
      function(self, action) {
        self$taken <- self$taken + self$s
        list(observation = 0, reward = 1, terminated = self$taken >= self$p)
      },
      space_box(0, 9, shape = 1), space_discrete(1), s = s, p = p, r = NULL, ...
    )
  }
  length_of <- function(...) rollout(..., seed = 1)$episodes$length
  expect_identical(length_of(ends_after(p = 4), policy_random()), 4L)
  # By dots, by do.call(), registered, and through each function that passes names on.
  expect_invisible(gym_register("Short-v0", ends_after, e = NULL, p = 3))
  on.exit(gym_unregister("Short-v0"))
  expect_identical(length_of("Short-v0", policy_random()), 3L)
  expect_identical(length_of("Short-v0", policy_random(), p = 2, s = 1), 2L)
  expect_identical(do.call(length_of, list("Short-v0", policy_random(), p = 2, f = 1)), 2L)
  expect_identical(evaluate_policy("Short-v0", policy_random(), 2, 1, p = 2, f = 1)$steps, 4L)
  expect_identical(attr(check_env("Short-v0", p = 2, e = 1), "lengths"), c(2L, 2L, 2L))
  objective <- gym_objective("Short-v0", episodes = 1, seed = 1, p = 2)
  expect_identical(objective(0), -2)
  trained <- search_ars("Short-v0", p = 2, iterations = 1, seed = 1, progress = FALSE)
  expect_identical(trained$evaluation$mean_return, 2)
})

test_that("a factor is shown as its values", {
  expect_identical(describe_argument(factor(c("b", "a"))), "the factor c(\"b\", \"a\")")
  expect_identical(describe_value(factor("left")), "the factor \"left\"")
})
