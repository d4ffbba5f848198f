logged <- function(episodes, seed = 1, ...) {
  policy <- policy_table(log(behaves), temperature = 1)
  steps_data(rollout(small_model(), policy, episodes = episodes, seed = seed, steps = TRUE, ...))
}

test_that("all methods estimate the exact value, with and without a horizon", {
  steps <- logged(3000)
  for (horizon in list(NULL, 5)) {
    exact <- solve_mdp(small_model(), wanted, discount = 0.9, horizon = horizon)$start_value
    found <- evaluate_offline(
      steps, by_table(wanted), behavior = by_table(behaves), discount = 0.9, horizon = horizon,
      replicates = 50, seed = 1
    )$estimates
    expect_lt(max(abs(found$estimate - exact) / found$se), 3.5)
    expect_lt(max(found$se[c(1, 5, 6)]), 0.1)
  }
})

test_that("weighted estimates are those of their papers", {
  steps <- steps_of(logged(40))
  act <- list(here = by_table(wanted)(steps$state))
  chosen <- by_table(behaves)(steps$state)[cbind(seq_along(steps$step), steps$action)]
  q <- list(taken = sin(seq_along(chosen)), state = cos(seq_along(chosen)))
  design <- list(steps = steps, act = act, discount = 0.9, horizon = NULL, call = NULL)
  parts <- weighted_parts(design, q, chosen)
  methods <- c("is", "wis", "pdis", "dr", "wdr")
  found <- weighted_estimates(parts, rep(1L, 40), matrix(1, 40, 1), methods)[1, ]
  # Step by step, as they are written down.
  ratio <- act$here[cbind(seq_along(chosen), steps$action)] / chosen
  longest <- max(steps$step)
  rho <- matrix(1, 40, longest + 1)
  is <- pdis <- dr <- wdr <- numeric(40)
  for (i in 1:40) {
    rows <- which(steps$episode == i)
    for (t in seq_len(longest)) {
      rho[i, t + 1] <- rho[i, t] * if (t <= length(rows)) ratio[rows[t]] else 1
    }
  }
  share <- sweep(rho, 2, colSums(rho), "/")
  for (i in 1:40) {
    rows <- which(steps$episode == i)
    shrink <- 0.9^(seq_along(rows) - 1)
    at <- seq_along(rows)
    is[i] <- rho[i, longest + 1] * sum(shrink * steps$reward[rows])
    pdis[i] <- sum(shrink * rho[i, at + 1] * steps$reward[rows])
    # Jiang and Li's recursion, from the last step.
    value <- 0
    for (t in rev(at)) {
      row <- rows[t]
      value <- q$state[row] + ratio[row] * (steps$reward[row] + 0.9 * value - q$taken[row])
    }
    dr[i] <- value
    wdr[i] <- sum(shrink * (share[i, at + 1] * (steps$reward[rows] - q$taken[rows]) +
                              share[i, at] * q$state[rows]))
  }
  wis <- sum(is) / sum(rho[, longest + 1])
  expect_equal(found, c(is = mean(is), wis = wis, pdis = mean(pdis), dr = mean(dr),
                        wdr = sum(wdr)), tolerance = 1e-12)
})

test_that("a policy that behaves as the data has its observed value", {
  steps <- logged(100)
  found <- evaluate_offline(steps, by_table(behaves), c("is", "wis", "pdis"), seed = 1,
                            behavior = by_table(behaves), replicates = 20)
  expect_equal(found$estimates$estimate, rep(found$observed$estimate, 3))
  expect_equal(found$effective, 100)
})

test_that("fitted Q evaluation of a table is the value in the model of the steps", {
  steps <- logged(200)
  estimated <- estimate_model(steps)
  linear <- ~ action * factor(obs_1)
  for (horizon in list(NULL, 6)) {
    exact <- solve_mdp(estimated, wanted[1:3, ], discount = 0.95, horizon = horizon)$start_value
    by <- function(formula, model = NULL) {
      evaluate_offline(steps, by_table(wanted), "fqe", formula = formula, model = model,
                       discount = 0.95, horizon = horizon, seed = 1, replicates = 2)
    }
    expect_equal(by(NULL)$estimates$estimate, exact, tolerance = 1e-10)
    expect_equal(by(linear)$estimates$estimate, exact, tolerance = 1e-8)
    by_lm <- function(formula, data) lm(formula, data)
    expect_equal(by(linear, by_lm)$estimates$estimate, exact, tolerance = 1e-8)
  }
})

test_that("cut episodes need a horizon, except for fitted Q evaluation", {
  cut <- logged(300, max_steps = 4)
  expect_error(
    evaluate_offline(cut, by_table(wanted), discount = 0.9), "cut off, the first after 4 steps"
  )
  exact <- solve_mdp(small_model(), wanted, discount = 0.9)$start_value
  found <- evaluate_offline(cut, by_table(wanted), "fqe", discount = 0.9, seed = 1, replicates = 30)
  expect_lt(abs(found$estimates$estimate - exact) / found$estimates$se, 3.5)
  expect_true(is.na(found$observed$estimate))
  expect_silent(evaluate_offline(
    cut, by_table(wanted), "wis", horizon = 4, replicates = 10, seed = 1
  ))
})

test_that("a rule that was learned from the same episodes needs folds", {
  steps <- logged(200)
  rule <- learn_q(steps, discount = 0.9)
  expect_error(evaluate_offline(steps, rule), "learned from the same data")
  found <- evaluate_offline(steps, rule, c("fqe", "dr"), folds = 4, discount = 0.9, seed = 1,
                            replicates = 20)
  expect_output(print(found), "Mean value of 4 rules")
  fresh <- logged(200, seed = 2)
  expect_s3_class(
    evaluate_offline(fresh, rule, "fqe", discount = 0.9, replicates = 2), "gym_offline"
  )
})

test_that("behavior is estimated again in each replicate", {
  steps <- logged(200)
  known <- evaluate_offline(steps, by_table(wanted), c("is", "dr"), behavior = by_table(behaves),
                            seed = 1, replicates = 100, discount = 0.9)
  by <- function(behavior) {
    evaluate_offline(steps, by_table(wanted), c("is", "dr"), behavior = behavior, seed = 1,
                     replicates = 100, discount = 0.9)$estimates
  }
  shares <- by(NULL)
  # A logistic regression on all states has the same probabilities.
  expect_equal(by(~ factor(obs_1)), shares, tolerance = 1e-5)
  # Estimated probabilities make importance sampling more precise.
  expect_lt(shares$se[[1L]], known$estimates$se[[1L]])
})

test_that("t intervals are those of a mean", {
  found <- evaluate_offline(logged(50), by_table(wanted), "pdis", behavior = by_table(behaves),
                            interval = "t", seed = 1, discount = 0.9)
  scores <- episode_scores(weighted_parts(
    list(steps = steps_of(logged(50)), act = list(here = by_table(wanted)(logged(50)["obs_1"])),
         discount = 0.9, horizon = NULL, call = NULL), NULL,
    by_table(behaves)(logged(50)["obs_1"])[cbind(seq_len(nrow(logged(50))), logged(50)$action + 1)]
  ), "pdis")
  expect_equal(unlist(found$estimates[c("lower", "upper")]), t.test(scores)$conf.int,
               ignore_attr = TRUE)
})

test_that("bootstrap intervals of few episodes are as long as those by t", {
  set.seed(1)
  few <- data.frame(episode = 1:12, s = "a", action = rep(0:1, 6), reward = stats::rnorm(12))
  by <- function(interval) {
    found <- evaluate_offline(few, policy_random(), "is", behavior = policy_random(), seed = 1,
                              interval = interval, replicates = 4000)$estimates
    found$upper - found$lower
  }
  expect_equal(by("bootstrap"), by("t"), tolerance = 0.05)
})

test_that("a seed fixes folds and replicates and leaves the session's generator", {
  steps <- logged(50)
  set.seed(1)
  estimate <- function() {
    evaluate_offline(steps, 0, "dr", behavior = by_table(behaves), seed = 2, replicates = 20,
                     discount = 0.9)$estimates
  }
  first <- suppressWarnings(estimate())
  drawn <- runif(1)
  set.seed(1)
  expect_equal(runif(1), drawn)
  expect_identical(suppressWarnings(estimate()), first)
})

test_that("invalid arguments are errors that say what to do", {
  steps <- logged(20)
  wrong <- function(...) {
    expect_error(evaluate_offline(steps, ...), class = "gym_error_argument")$message
  }
  expect_match(wrong(2), "takes the action \"2\" in 100% of the steps, which the data never took")
  expect_match(wrong(0, horizon = 1000), "the longest episode of the data has")
  expect_match(wrong(function(s) 1:2), "an action, or one for each of")
  expect_match(wrong(function(s) matrix(1, nrow(s), 2)), "add up to 1 in each row")
  expect_match(wrong(0, behavior = 1), "has the probability 0, but it was taken")
  expect_match(wrong(0, interval = "t"), "use \"bootstrap\"")
  expect_match(wrong(0, formula = ~ action * obs_2), "Did you mean `obs_1`")
  expect_match(wrong(0, folds = 2), "a rule of `learn_fitted_q\\(\\)`")
  one <- steps[steps$episode == 1, ]
  expect_error(evaluate_offline(one, 0), "has 1 episode, but at least 2 are needed")
  # A state in which the data never took the action.
  never <- data.frame(episode = 1:40, s = rep(c("a", "b"), 20), action = c("x", "y"), reward = 1)
  expect_warning(evaluate_offline(never, "x", "fqe", replicates = 2, seed = 1),
                 class = "gym_warning_offline")
  long <- logged(20)
  expect_warning(evaluate_offline(long, 0, "is", behavior = by_table(behaves), replicates = 2,
                                  seed = 1), "depend on few episodes")
})

test_that("estimates print and plot", {
  found <- evaluate_offline(logged(100), by_table(wanted), behavior = by_table(behaves),
                            discount = 0.9, horizon = 3, seed = 1, replicates = 20)
  expect_output(print(found), "observed.*Effective episodes: .*largest weights")
  picture <- ggplot2::ggplot_build(ggplot2::autoplot(found))
  expect_equal(nrow(as.data.frame(found)), 6L)
  expect_setequal(picture$data[[4]]$x, found$estimates$estimate)
})

# See tools/offline-fixture.py.
offline_reference <- function() {
  jsonlite::read_json(testthat::test_path("offline.json"), simplifyVector = TRUE)
}

test_that("estimates from clicks are those of obp", {
  reference <- offline_reference()$open_bandit
  # A model that predicts what is stored.
  registerS3method("predict", "stored_rewards", function(object, newdata, ...) {
    reference$predicted[cbind(as.integer(as.character(newdata$action)), newdata$position) + 1]
  }, envir = asNamespace("stats"))
  steps <- steps_data(
    data.frame(episode = seq_along(reference$action), reference[c("position", "action", "reward")],
               pscore = reference$pscore),
    state = "position", probability = "pscore"
  )
  expected <- unlist(reference$estimates)
  found <- evaluate_offline(
    steps, function(states) t(reference$policy)[states$position + 1, ], names(expected),
    model = function(formula, data) structure(list(), class = "stored_rewards"), seed = 1,
    replicates = 2
  )
  estimates <- rlang::set_names(found$estimates$estimate, found$estimates$method)
  expect_equal(estimates[names(expected)], expected, tolerance = 1e-8)
})

test_that("fitted Q evaluation is that of a loop in NumPy", {
  reference <- offline_reference()$fitted_q
  steps <- steps_data(data.frame(
    episode = (seq_along(reference$x) - 1) %/% reference$length,
    reference[c("x", "action", "reward")]
  ))
  by <- function(horizon) {
    evaluate_offline(
      steps, function(states) {
        up <- pmin(pmax(0.5 + 0.4 * states$x, 0), 1)
        cbind(1 - up, up)
      }, "fqe", formula = ~ action * (x + I(x^2)), discount = 0.9, horizon = horizon, seed = 1,
      replicates = 2
    )$estimates$estimate
  }
  expect_equal(by(NULL), reference$value, tolerance = 1e-6)
  expect_equal(by(3), reference$value_in_3_steps, tolerance = 1e-6)
})

test_that("fitted Q evaluation of a large table is the value in the model of the steps", {
  skip_unless_all()
  set.seed(1)
  visits <- data.frame(
    episode = rep(1:400, each = 10), state = sample(0:79, 4000, TRUE), action = 0:1,
    reward = stats::rnorm(4000)
  )
  steps <- steps_data(visits)
  policy <- cbind(seq_len(80), 80:1) / 81
  found <- evaluate_offline(steps, by_table(policy), "fqe", seed = 1, replicates = 2)
  exact <- solve_mdp(estimate_model(steps), policy, discount = 1)$start_value
  expect_equal(found$estimates$estimate, exact, tolerance = 1e-10)
})

test_that("values that are infinite are an error", {
  # The policy goes round in circles; the data also has an end.
  round <- data.frame(
    episode = rep(1:10, each = 3), s = c("a", "b", "a"), action = c("on", "on", "stop"), reward = 1
  )
  expect_error(
    suppressWarnings(evaluate_offline(steps_data(round), "on", "fqe", replicates = 2)),
    "infinite: in the data some of its episodes never end"
  )
})

test_that("a level that few episodes have is an error that says so", {
  set.seed(1)
  visits <- data.frame(
    episode = 1:40, s = c("rare", rep(c("a", "b"), c(20, 19))), action = c("x", "y"), reward = 1
  )
  expect_error(
    evaluate_offline(visits, "x", "dr", behavior = policy_random(), seed = 1,
                     model = function(formula, data) lm(formula, data)),
    "cannot be fitted, or does not predict.*A level is only in few episodes"
  )
})
