# Steps as a rollout in CartPole has them. Here the action is 1 where the pole leans to the right.
made_up_steps <- function(n = 200) {
  withr::local_seed(1)
  steps <- data.frame(
    cart_position = rnorm(n), cart_velocity = rnorm(n), pole_angle = rnorm(n),
    pole_angular_velocity = rnorm(n)
  )
  steps$action <- as.integer(steps$pole_angle + rnorm(n, sd = 0.7) > 0)
  steps
}

four_numbers <- function(names = NULL) {
  space <- box_space(rep(-9, 4), rep(9, 4))
  space$names <- names
  space
}

bound <- function(model, action_space = discrete_space(2L), ..., id = "CartPole-v1",
                  observation_space = four_numbers(observation_parts$CartPole)) {
  policy <- if (inherits(model, "told")) {
    as_policy(model, predict = predict_told, ...)
  } else {
    as_policy(model, ...)
  }
  policy_bind(policy, list(
    spec = list(id = id), observation_space = observation_space, action_space = action_space
  ))
}

# Plays as any number of observations at once.
leaning <- rbind(c(0, 0, 2, 0), c(0, 0, -2, 0), c(1, 1, 3, 1))
expect_follows <- function(policy) {
  expect_identical(act(policy, leaning), c(1L, 0L, 1L))
  expect_identical(act(policy, leaning[2, ]), 0L)
  expect_identical(act(policy, leaning[1, , drop = FALSE]), 1L)
}

# The warning when a model is bound, or NULL.
warned_of <- function(...) {
  withr::local_options(rlib_warning_verbosity = "verbose")
  tryCatch({
    bound(...)
    NULL
  }, warning = identity)
}

# A model whose predictions are what it is told.
predicting <- function(value) structure(list(value = value), class = "told")
predict_told <- function(model, newdata, ...) {
  if (is.function(model$value)) model$value(newdata, ...) else model$value
}

test_that("regressions act by the nearest action, a probability above one half is 1", {
  steps <- made_up_steps()
  expect_follows(bound(glm(action ~ pole_angle + cart_position, binomial, steps)))
  expect_follows(bound(glm(action == 1 ~ pole_angle, binomial, steps)))
  expect_follows(bound(glm(action ~ pole_angle, gaussian, steps)))
  expect_follows(bound(lm(action ~ ., steps)))
  space <- discrete_space(3L, start = -1L)
  expect_identical(nearest_actions(space, c(-5.5, -1, -0.5, -0.4, 0, 0.5, 0.51, 1, 7.2)),
                   c(-1L, -1L, -1L, 0L, 0L, 0L, 1L, 1L, 1L))
  expect_identical(nearest_actions(space, c(2, -2, NA, NaN, Inf)), rep(NA_integer_, 5))
})

test_that("a binomial model of a factor acts by the factor's labels", {
  steps <- made_up_steps()
  expect_follows(bound(glm(factor(action) ~ pole_angle, binomial, steps)))
  reversed <- glm(factor(action, levels = c("1", "0")) ~ pole_angle, binomial, steps)
  expect_follows(bound(reversed))
  steps$push <- factor(c("push left", "push right")[steps$action + 1L])
  expect_follows(bound(glm(push ~ pole_angle, binomial, steps)))
  steps$many <- factor(rep(1:4, 50))
  expect_error(as_policy(suppressWarnings(glm(many ~ pole_angle, binomial, steps))),
               "tells two actions apart, but its response has 4 levels",
               class = "gym_error_argument")
})

test_that("trees act, by class and by regression", {
  skip_if_not_installed("rpart")
  steps <- made_up_steps()
  expect_follows(bound(rpart::rpart(factor(action) ~ pole_angle, steps)))
  expect_follows(bound(rpart::rpart(action ~ pole_angle, steps, method = "anova")))
})

test_that("networks of nnet act, with a formula and with a matrix", {
  skip_if_not_installed("nnet")
  steps <- made_up_steps()
  fit <- function(...) withr::with_seed(1, nnet::nnet(..., size = 2, trace = FALSE))
  x <- as.matrix(steps[1:4])
  expect_follows(bound(fit(action ~ pole_angle, steps)))
  expect_follows(bound(fit(factor(action) ~ pole_angle, steps)))
  expect_follows(bound(fit(x, steps$action)))
  expect_follows(bound(fit(x, nnet::class.ind(steps$action), softmax = TRUE)))
  turned <- nnet::class.ind(steps$action)[, 2:1]
  expect_follows(bound(fit(x, turned, softmax = TRUE)))
  expect_follows(bound(nnet::multinom(factor(action) ~ pole_angle, steps, trace = FALSE)))
})

test_that("further arguments go to predict()", {
  told <- predicting(function(newdata, ...) rep(list(...)$answer, nrow(newdata)))
  expect_identical(act(bound(told, answer = 1), rbind(1:4)), 1L)
  expect_error(as_policy(told, 1, predict = predict_told), "need names",
               class = "gym_error_argument")
  fit <- glm(action ~ pole_angle, binomial, made_up_steps())
  # Where the linear predictor is 0.3, and so the probability 0.57.
  angle <- (0.3 - coef(fit)[[1]]) / coef(fit)[[2]]
  expect_identical(act(bound(fit), c(0, 0, angle, 0)), 1L)
  expect_identical(act(bound(fit, type = "link"), c(0, 0, angle, 0)), 0L)
})

test_that("`predict` gets a data frame with the names of the steps' table", {
  seen <- NULL
  told <- predicting(function(newdata, ...) {
    seen <<- newdata
    integer(nrow(newdata))
  })
  act(bound(told), leaning)
  expect_equal(seen, as.data.frame(`colnames<-`(leaning, observation_parts$CartPole)))
  act(bound(told, observation_space = four_numbers()), leaning)
  expect_named(seen, paste0("obs_", 1:4))
  field <- discrete_space(16L)
  field$names <- "position"
  act(bound(told, observation_space = field), 3:5)
  expect_identical(seen, data.frame(position = 3:5))
})

test_that("observations of several parts have a column for each", {
  parts <- new_space(describe_dict(
    at = list(name = "Discrete", n = 5L, start = 0L, dtype = "int64"), speed = describe_box(0, 1)
  ))
  fit <- lm(y ~ obs_at, data.frame(y = c(0, 1), obs_at = c(0, 1)))
  policy <- bound(fit, observation_space = parts, id = "Mine-v0")
  expect_identical(act(policy, list(at = 0:1, speed = c(0, 0))), 0:1)
})

test_that("strings and factors act by label, logical ones as 0 and 1", {
  for (value in list(c("0", "1"), factor(c("0", "1"), levels = c("1", "0")), c(FALSE, TRUE),
                     c("push left", "push right"), data.frame(class = c("0", "1")),
                     cbind(c(0.2, 0.9)))) {
    expect_identical(act(bound(predicting(value)), leaning[1:2, ]), 0:1)
  }
})

test_that("predictions are the actions where those are a Box", {
  one <- box_space(-2, 2)
  expect_identical(act(bound(predicting(c(0.5, -3)), one), leaning[1:2, ]), cbind(c(0.5, -3)))
  expect_identical(act(bound(predicting(0.5), one), leaning[1, ]), 0.5)
  two <- box_space(c(-2, -2), c(2, 2))
  steps <- made_up_steps()
  fit <- lm(cbind(2 * pole_angle, cart_position) ~ pole_angle + cart_position, steps)
  expect_equal(act(bound(fit, two), leaning), leaning[, c(3, 1)] %*% diag(2:1))
  expect_equal(act(bound(fit, two), leaning[3, ]), c(6, 1))
})

test_that("predictions that are no actions are refused in one sentence with the fix", {
  refused <- function(value, pattern, ..., space = discrete_space(2L), rows = 1:2) {
    cnd <- expect_error(act(bound(predicting(value), space), leaning[rows, , drop = FALSE]),
                        pattern, fixed = TRUE, class = "gym_error_argument", ...)
    conditionMessage(cnd)
  }
  expect_match(refused(c(1, NA), "gave NA, which is no action of <Discrete 2>"),
               "missing in the data of the model")
  expect_match(refused(c(1, 2), "gave 2, which is no action of <Discrete 2>"),
               "The actions are 0: push left, 1: push right.", fixed = TRUE)
  refused(c("1", "left"), "gave \"left\", which is no action")
  refused(factor(c("1", "2")), "gave \"2\", which is no action")
  expect_match(refused(c(1, 0, 1), "one action for each observation, not 3 for 2 observations"),
               "Fit the model by the columns' names")
  refused(1, "not 1 for 2 observations")
  expect_match(refused(cbind(c(0.4, 0.6), c(0.6, 0.4)), "not an array of 2 x 2"),
               "`as_policy(model, type = \"class\")`", fixed = TRUE)
  refused(list(1, 2), "not a list of length 2")
  box <- box_space(-2, 2)
  refused(c(1, NaN), "gave NaN, which is no action", space = box)
  refused(c(1, Inf), "gave Inf, which is no action", space = box)
  refused(c("1", "2"), "one action for each observation, not", space = box)
  expect_match(refused(c(1, 2), "not c(1, 2)", space = box_space(c(0, 0), c(1, 1))),
               "has 2 numbers")
  skip_if_not_installed("rpart")
  tree <- rpart::rpart(factor(action) ~ pole_angle, made_up_steps())
  expect_error(act(bound(tree, type = "prob"), leaning), "not an array of 3 x 2",
               class = "gym_error_argument")
})

test_that("a model that cannot predict for the observations says which columns there are", {
  fit <- lm(action ~ angle, data.frame(action = 0:1, angle = 0:1))
  cnd <- expect_error(act(bound(fit), leaning),
                      "lm model, action ~ angle failed:.*'angle' not found",
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`pole_angle`", fixed = TRUE)
  steps <- made_up_steps()
  by_position <- lm(steps$action ~ steps$pole_angle)
  suppressWarnings(expect_error(act(bound(by_position), leaning), "not 200 for 3 observations",
                                class = "gym_error_argument"))
})

test_that("policies and functions stay, and results give theirs", {
  follow <- function(observation) 1L
  network <- policy_network()
  expect_identical(as_policy(follow), follow)
  expect_identical(as_policy(network), network)
  played <- rollout(fake_environment(), network, seed = 1)
  expect_identical(as_policy(played), played$policy)
  search <- search_random(fake_environment(), rounds = 1, seed = 1)
  expect_identical(as_policy(search), search$policy)
  trained <- train_agent(
    agent_hill_climb(), fake_environment(), iterations = 1, seed = 1, eval_episodes = 2
  )
  expect_identical(as_policy(trained), trained$policy)
  expect_error(as_policy(network, type = "class"), "no argument for `type`",
               class = "gym_error_argument")
})

test_that("what is no model is refused", {
  expect_error(as_policy("left"), "must be a file that exists, not \"left\"", fixed = TRUE,
               class = "gym_error_argument")
  expect_error(as_policy(3), "or `nnet::nnet()`, not 3", fixed = TRUE, class = "gym_error_argument")
  cnd <- expect_error(as_policy(data.frame(a = 1)), "not a data frame with 1 row",
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`predict = function(model, newdata) ...`", fixed = TRUE)
  expect_error(as_policy(predicting(1), predict = "told"), "`predict` must be a function",
               class = "gym_error_argument")
  expect_error(as_policy(function() 1), "this one has no argument", class = "gym_error_argument")
})

test_that("a model given for a policy names as_policy()", {
  cnd <- expect_error(rollout("CartPole-v1", lm(action ~ 1, made_up_steps()), client = no_client()),
                      "`policy` must be a policy", class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "`as_policy()` makes a policy of a model", fixed = TRUE)
})

test_that("a model must know the environment, whose actions it can predict", {
  policy <- as_policy(lm(action ~ pole_angle, made_up_steps()))
  expect_error(act(policy, 1:4), "does not know the observations", class = "gym_error_argument")
  expect_error(act(policy, data.frame(pole_angle = 1)), "does not know the observations",
               class = "gym_error_argument")
  several <- new_space(list(
    name = "MultiDiscrete", shape = list(2L), dtype = "int64", nvec = list(2L, 3L),
    start = list(0L, 0L)
  ))
  expect_error(bound(predicting(1), several), "A model cannot choose from <MultiDiscrete",
               class = "gym_error_argument")
})

test_that("a model of a hand of cards plays Blackjack", {
  client <- test_client()
  careful <- function(observation) as.integer(observation$player_sum < 15)
  played <- rollout("Blackjack-v1", careful, 50, seed = 1, steps = TRUE, client = client)
  fit <- lm(action ~ I(player_sum < 15), as.data.frame(played))
  learned <- rollout("Blackjack-v1", as_policy(fit), 50, seed = 1, steps = TRUE, client = client)
  expect_identical(learned$steps, played$steps)
  env <- local_env("Blackjack-v1", seed = 1)
  observation <- env$reset()
  expect_identical(as.integer(act(learned$policy, observation)), careful(observation))
})

test_that("a model plays, predicts, prints and is mapped", {
  client <- test_client()
  steps <- made_up_steps()
  fit <- glm(action ~ pole_angle + pole_angular_velocity, binomial, steps)
  played <- rollout("CartPole-v1", as_policy(fit), 5, seed = 1, steps = TRUE, client = client)
  by_hand <- function(observation) {
    newdata <- data.frame(pole_angle = observation[, 3], pole_angular_velocity = observation[, 4])
    as.integer(predict(fit, newdata, type = "response") > 0.5)
  }
  expected <- rollout("CartPole-v1", by_hand, 5, seed = 1, steps = TRUE, client = client)
  expect_identical(played$steps, expected$steps)
  expect_identical(predict(played, played$steps), played$steps$action)
  expect_equal(predict(played$policy, played$steps, type = "output"),
               predict(fit, played$steps, type = "response"))
  map <- decision_map(policy = played$policy, x = "pole_angle", y = "cart_position", size = 3,
                      xlim = c(-1, 1))
  expect_identical(map$grid$action, rep(c(0L, predict(played, rbind(c(0, 0, 0, 0))), 1L), 3))
  expect_no_error({
    local_device()
    plot(map)
  })
})

test_that("levels that are no actions are refused before the first step, with the actions", {
  steps <- made_up_steps()
  steps$side <- factor(c("left", "right")[steps$action + 1L])
  cnd <- expect_error(bound(glm(side ~ pole_angle, binomial, steps)),
                      "`left`, `right`, must be actions; `left`, `right` are none",
                      class = "gym_error_argument")
  expect_match(conditionMessage(cnd), "0: push left, 1: push right", fixed = TRUE)
})

test_that("numbers that are no actions, as a factor's codes, are warned of once, with the fix", {
  steps <- made_up_steps()
  steps$push <- factor(c("push left", "push right")[steps$action + 1L])
  codes <- list(
    suppressWarnings(lm(push ~ pole_angle, steps)),
    lm(as.integer(push) ~ pole_angle, steps),
    glm(as.integer(push) ~ pole_angle, gaussian, steps)
  )
  for (fit in codes) {
    cnd <- warned_of(fit)
    expect_match(conditionMessage(cnd), "was fitted to 2, which is no action of <Discrete 2>")
    expect_match(conditionMessage(cnd), "`glm(factor(action) ~ ..., binomial)`", fixed = TRUE)
  }
  expect_null(warned_of(codes[[1]], discrete_space(2L, start = 1L)))
  for (fit in list(lm(action ~ pole_angle, steps), lm(action == 1 ~ pole_angle, steps),
                   glm(push ~ pole_angle, binomial, steps), lm(0.6 * action ~ pole_angle, steps),
                   lm(cbind(push, push) ~ pole_angle, steps))) {
    expect_null(warned_of(fit))
  }
  expect_null(warned_of(codes[[2]], box_space(-2, 2)))
  withr::local_options(rlib_warning_verbosity = "default")
  rlang::reset_warning_verbosity(paste("gym_response", format(as_policy(codes[[2]]))))
  expect_warning(bound(codes[[2]]), class = "gym_warning_response")
  expect_no_warning(bound(codes[[2]]))
})

test_that("a regression on more than two actions is told of the models that choose", {
  steps <- made_up_steps()
  steps$action <- rep_len(0:2, 200)
  three <- discrete_space(3L)
  cnd <- warned_of(lm(action ~ pole_angle, steps), three)
  expect_match(conditionMessage(cnd), "`rpart::rpart(factor(action) ~ ...)`", fixed = TRUE)
  skip_if_not_installed("rpart")
  expect_s3_class(warned_of(rpart::rpart(action ~ pole_angle, steps), three),
                  "gym_warning_response")
  expect_null(warned_of(rpart::rpart(factor(action) ~ pole_angle, steps), three))
  skip_if_not_installed("nnet")
  numbers <- nnet::nnet(action ~ pole_angle, steps, size = 1, linout = TRUE, trace = FALSE)
  expect_s3_class(warned_of(numbers, three), "gym_warning_response")
  expect_null(warned_of(nnet::multinom(factor(action) ~ pole_angle, steps, trace = FALSE), three))
})

test_that("a model of another kind plays by `predict`", {
  fit <- loess(action ~ pole_angle, made_up_steps())
  expect_error(as_policy(fit), "give `predict = function", class = "gym_error_argument")
  policy <- bound(fit, predict = function(model, newdata) predict(model, newdata) > 0.5)
  expect_identical(act(policy, leaning / 2), c(1L, 0L, 1L))
})
