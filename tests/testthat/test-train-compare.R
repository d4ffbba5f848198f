# Trainings as they would be, each with a final evaluation after `steps`.
trainings_with <- function(scores, env_id = "A", target = Inf, steps = 100, interrupted = FALSE,
                           total_steps = 100, curve = NULL) {
  trainings <- Map(function(score, steps, interrupted, seed) {
    structure(
      list(
        history = data.frame(steps = c(steps / 2, steps)),
        evaluations = data.frame(
          iteration = 0:2, kind = c("curve", "curve", "final"),
          mean_return = c(0, curve %||% score, score), se = 0, lower = 0, upper = 0, episodes = 9L
        ),
        agent = agent_ars(), target = target, env_id = env_id, seed = seed, steps = steps,
        solved = !interrupted && score >= target, final = data.frame(mean_return = score),
        interrupted = interrupted,
        rules = list(total_steps = total_steps)
      ),
      class = "gym_training"
    )
  }, scores, steps, interrupted, seq_along(scores))
  structure(
    list(trainings = trainings, agent = agent_ars(), env_id = env_id, target = target),
    class = "gym_trainings"
  )
}

rliable <- function() {
  reference <- jsonlite::read_json(testthat::test_path("rliable.json"), simplifyVector = TRUE)
  reference$lists <- lapply(reference$scores, function(runs) asplit(runs, 2L))
  reference
}

test_that("point estimates are those of rliable", {
  reference <- rliable()
  scores <- lapply(reference$lists, as_columns)
  for (name in names(scores)) {
    point <- vapply(score_statistics, function(statistic) statistic(scores[[name]]), 0)
    expect_equal(unname(point), reference$points[[name]], tolerance = 1e-12)
  }
  expect_equal(improvement_probability(scores$x, scores$y), reference$improvement,
               tolerance = 1e-12)
  for (name in names(scores)) {
    all <- unlist(reference$lists[[name]])
    share <- vapply(reference$taus, function(tau) mean(all > tau), 0)
    expect_equal(share, reference$profiles[[name]], tolerance = 1e-12)
  }
})

test_that("interval ends are those of rliable within Monte Carlo error", {
  reference <- rliable()
  ids <- c("A", "B", "C")
  trainings <- unlist(lapply(c("x", "y"), function(name) {
    Map(function(scores, id) trainings_with(scores, id), reference$lists[[name]], ids)
  }), recursive = FALSE)
  names(trainings) <- rep(c("x", "y"), each = 3)
  unit <- data.frame(env_id = ids, low = 0, high = 1)
  compared <- rlang::exec(compare_trainings, !!!trainings, reference = unit, reps = 4000, seed = 1)
  for (name in c("x", "y")) {
    own <- compared$table[compared$table$training == name, ]
    expect_equal(own$value, reference$points[[name]], tolerance = 1e-12)
    ends <- rbind(own$lower, own$upper)
    width <- diff(reference$intervals[[name]])
    # The standard error of an end is about 0.02 of the width.
    expect_lt(max(abs(ends - reference$intervals[[name]]) / rep(width, each = 2)), 0.07)
  }
  pair <- compared$improvement
  expect_equal(pair$probability, reference$improvement, tolerance = 1e-12)
  expect_lt(max(abs(c(pair$lower, pair$upper) - reference$improvement_interval)), 0.02)
  profile <- compared$profile[compared$profile$training == "x", ]
  expect_true(all(profile$lower <= profile$share & profile$share <= profile$upper))
})

test_that("a comparison has a table and prints, and a seed fixes it", {
  a <- trainings_with(c(10, 12, 14, 16, 30))
  b <- trainings_with(c(1, 2, 3, 4, 5))
  compared <- compare_trainings(a, b, seed = 7)
  # In one environment the median of the means would be the mean.
  expect_identical(as.data.frame(compared)$statistic, rep(c("mean", "iqm"), 2))
  expect_identical(as.data.frame(compared)$value[1:2], c(16.4, 14))
  expect_identical(compared$improvement$probability, 1)
  expect_identical(compared$total_steps, 100)
  expect_identical(compare_trainings(a, b, seed = 7)$table, compared$table)
  set.seed(3)
  state <- .Random.seed
  compare_trainings(a, b, seed = 7)
  expect_identical(.Random.seed, state)
  expect_output(print(compared), "Scores in A at a budget of 100 steps, 5 seeds each", fixed = TRUE)
  expect_output(print(compared), "Steps taken: a 100; b 100", fixed = TRUE)
  expect_output(print(compared), "stratified bootstrap, 2,000 draws, repeated by `seed = 7`",
                fixed = TRUE)
  drawn <- compare_trainings(a, b)
  expect_output(print(drawn), paste0("`seed = ", drawn$seed, "`"), fixed = TRUE)
  expect_identical(compare_trainings(a, b, seed = drawn$seed)$table, drawn$table)
  expect_output(print(compared), "Probability that a scores higher than b: 1 [1, 1]", fixed = TRUE)
  expect_length(compared$notes, 0)
})

test_that("few seeds are warned of", {
  few <- trainings_with(1:4)
  expect_warning(compare_trainings(few, again = few, seed = 1), "4 seeds",
                 class = "gym_warning_seeds")
})

test_that("with other budgets scores are those of the curves at the common number of steps", {
  short <- trainings_with(rep(10, 5))
  long <- trainings_with(rep(20, 5), steps = 400, total_steps = 400, curve = 4)
  compared <- compare_trainings(short, long, seed = 1)
  expect_identical(compared$total_steps, 100)
  # From 0 to 4 in 200 steps.
  expect_identical(unique(compared$runs$score[compared$runs$training == "long"]), 2)
  expect_match(compared$notes, "learning curves after 100 steps", all = FALSE)
  expect_match(compared$notes, "budgets differ", all = FALSE)
  expect_error(
    compare_trainings(short, long, total_steps = 101), "100", class = "gym_error_argument"
  )
  # A budget that was used up by more or less: the final evaluations count.
  a <- trainings_with(1:5, steps = c(100, 120, 110, 100, 105), curve = 99)
  ended <- compare_trainings(a, seed = 1)
  expect_identical(ended$table$value[[1]], 3)
  expect_output(print(ended), "Steps taken: a 100 to 120", fixed = TRUE)
})

test_that("two trainings of one name and seed are not mixed", {
  a <- trainings_with(1:5)
  expect_error(compare_trainings(a = a, a = trainings_with(6:10)), "called \"a\" and have the seed",
               class = "gym_error_argument")
  expect_error(do.call(compare_trainings, list(a, a)), "Give each its own name",
               class = "gym_error_argument")
  other <- trainings_with(6:10)
  for (i in 1:5) other$trainings[[i]]$seed <- i + 5
  expect_identical(nrow(compare_trainings(a = a, a = other, seed = 1)$runs), 10L)
})

test_that("other arguments and wrappers of the environment are named", {
  plain <- trainings_with(1:5)
  with_one <- function(name, value) {
    trainings <- trainings_with(1:5)
    for (i in 1:5) trainings$trainings[[i]][[name]] <- value
    compare_trainings(plain, changed = trainings, seed = 1)$notes
  }
  expect_identical(
    with_one("kwargs", list(max_episode_steps = 100)),
    "environments differ: plain: no arguments; changed: arguments max_episode_steps = 100"
  )
  expect_identical(
    with_one("provenance", list(wrappers = "TransformReward")),
    "environments differ: plain: no wrappers; changed: wrappers TransformReward"
  )
  expect_null(with_one("kwargs", list()))
})

test_that("a table of curves is compared, and the environments must be the same", {
  curves <- data.frame(training = rep(c("p", "q"), each = 5), seed = 1:5, steps = 50,
                       mean_return = c(1:5, 2:6))
  compared <- compare_trainings(curves, seed = 1)
  expect_identical(compared$table$value[c(1, 4)], c(3, 4))
  expect_error(compare_trainings(curves[-3]), "column", class = "gym_error_argument")
  a <- trainings_with(1:5)
  expect_error(compare_trainings(a, other = trainings_with(1:5, "B")), "same environments",
               class = "gym_error_argument")
  expect_error(compare_trainings(), class = "gym_error_argument")
})

test_that("scores of several environments are between random policy and threshold", {
  a <- trainings_with(rep(3, 5), "Fake-v0")
  b <- trainings_with(rep(30, 5), "Pendulum-v1")
  envs <- list(`Fake-v0` = fake_environment(reward_threshold = 5), `Pendulum-v1` =
                 fake_environment(id = "Pendulum-v1"))
  with_env <- function(x) {
    x$trainings <- lapply(x$trainings, function(one) {
      one$env <- envs[[one$env_id]]
      one
    })
    x
  }
  compared <- compare_trainings(x = with_env(a), x = with_env(b), seed = 1)
  # A step earns 1, an episode has three.
  expect_identical(compared$reference,
                   data.frame(env_id = c("Fake-v0", "Pendulum-v1"), low = 3, high = c(5, -200)))
  expect_equal(compared$runs$score, rep(c(0, (30 - 3) / (-200 - 3)), each = 5))
  wrong <- data.frame(env_id = "Fake-v0", low = 1, high = 1)
  expect_error(compare_trainings(x = a, x = b, reference = wrong), "Fake-v0",
               class = "gym_error_argument")
})

test_that("trainings that stop at a target are compared by steps", {
  quick <- trainings_with(c(9, 9, 9, 5, 9, 5), target = 9, steps = c(10, 20, 30, 30, 50, 60))
  slow <- trainings_with(c(9, rep(5, 5)), target = 9, steps = c(40, 60, 60, 60, 60, 60))
  compared <- compare_trainings(quick, slow)
  expect_identical(compared$by, "steps")
  expect_identical(compared$table$reached, c(4L, 1L))
  expect_identical(compared$table$median, c(30, NA))
  expect_output(print(compared), "Steps to the target in A, 6 seeds each", fixed = TRUE)
  expect_output(print(compared), "4 of 6")
  # Wilson's intervals contain one half from the first number of steps to the second.
  expect_identical(compared$table$lower, c(10, 40))
  expect_identical(compared$table$upper, c(NA_real_, NA_real_))
  bounds <- compared$profile[compared$profile$steps == 30 & compared$profile$training == "quick", ]
  expect_equal(unlist(bounds[c("lower", "upper")], use.names = FALSE), wilson_interval(3, 6))
  inf <- trainings_with(1:5)
  expect_error(compare_trainings(quick, inf), "target = Inf", class = "gym_error_argument")
  other <- trainings_with(rep(9, 6), target = 8, steps = 10)
  expect_match(compare_trainings(quick, other)$notes, "targets differ: quick: 9; other: 8",
               all = FALSE)
})

test_that("a run that failed counts as one that never reaches the target, wherever it ended", {
  share_at_the_end <- function(steps, ...) {
    trained <- trainings_with(c(9, 9, 9, 5, 9, 9), target = 9, steps = steps, ...)
    compared <- compare_trainings(trained)
    expect_identical(compared$table$reached, 5L)
    line <- layers_of(drawn(ggplot2::autoplot(compared)), "GeomPath")[[1]]
    expect_identical(line$y, sort(line$y))
    max(line$y)
  }
  # The last runs overshoot the budget, so that the one that failed has fewer steps.
  expect_equal(share_at_the_end(c(10, 20, 30, 50, 55, 60)), 5 / 6)
  expect_equal(share_at_the_end(c(10, 20, 30, 70, 55, 60)), 5 / 6)
  # An interrupted run has not failed, it is left out.
  expect_equal(share_at_the_end(c(10, 20, 30, 50, 55, 60), interrupted = 1:6 == 4), 1)
})

test_that("a run whose last stopping evaluation was lucky has not reached the target", {
  skip_unless_all()
  # The final evaluation has the seeds above this.
  lucky <- function(seed, step, action) if (seed <= 2^30 + 2^29) 10 else 1
  trained <- train_agent(agent_hill_climb(), fake_environment(reward = lucky), iterations = 2,
                         seeds = 1:5, target = 20, eval_episodes = 4)
  compared <- compare_trainings(trained)
  expect_identical(compared$table$reached, 0L)
  expect_identical(compared$table$reached, sum(as.data.frame(trained)$reached))
})

test_that("what is no training is named, with what it was meant to be", {
  some <- trainings_with(1:5)
  refused <- function(code, text) {
    expect_error(code, text, fixed = TRUE, class = "gym_error_argument")
  }
  refused(compare_trainings(x = some, totalsteps = 3), "Did you mean `total_steps`?")
  refused(compare_trainings(x = some, steps = 3), "is the argument `total_steps`, not `steps`")
  refused(compare_trainings(x = some, y = 3), "`y` must be a training, not 3.")
  refused(compare_trainings(list(some, some)), "do.call(compare_trainings, x)")
  refused(compare_trainings(x = some, total_steps = 1e6), "have taken 1,000,000 steps")
})

test_that("many pairs are not printed", {
  all <- lapply(stats::setNames(nm = letters[1:5]), function(name) trainings_with(1:5))
  compared <- do.call(compare_trainings, all)
  expect_identical(nrow(compared$improvement), 10L)
  expect_output(print(compared), "Probabilities of 10 pairs")
  expect_lt(length(capture.output(print(compared))), 15)
})
