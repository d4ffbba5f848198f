test_that("each seed's row is the search with that seed", {
  env <- fake_environment(reward = first_action)
  searches <- search_repeat(env, rounds = 6, episodes = 3, target = 11, seeds = c(5, 1, 9, 12))
  expect_identical(as.data.frame(searches)$seed, c(5L, 1L, 9L, 12L))
  for (i in 1:4) {
    row <- searches$searches[i, ]
    search <- search_random(env, rounds = 6, episodes = 3, target = 11, seed = row$seed)
    expect_identical(row$solved, search$solved)
    expect_identical(row$round, if (search$solved) search$round else NA_integer_)
    expect_identical(row$rounds, nrow(search$rounds))
    expect_identical(row$mean_return, search$rounds$mean_return[[search$round]])
    expect_identical(row$steps, sum(search$rounds$steps))
  }
  expect_setequal(searches$searches$solved, c(TRUE, FALSE))
})

test_that("the chance of a round counts the rounds of searches that were given up", {
  env <- scripted_environment(c(9, 0, 0, 9, 0, 0, 0, 0, 9))
  searches <- search_repeat(env, rounds = 3, episodes = 1, target = 9, seeds = 1:4)
  expect_identical(searches$searches$round, c(1L, 3L, NA, 2L))
  expect_identical(searches$searches$rounds, c(1L, 3L, 3L, 2L))
  expect_identical(searches$chance, 3 / 9)
  expect_equal(searches$se, sqrt(1 / 3 * 2 / 3 / 9))
  # It is where the likelihood is greatest.
  likelihood <- function(p) {
    sum(stats::dgeom(c(0, 2, 1), p, log = TRUE)) + stats::pgeom(2, p, FALSE, log.p = TRUE)
  }
  best <- stats::optimize(likelihood, c(0, 1), maximum = TRUE)$maximum
  expect_equal(searches$chance, best, tolerance = 1e-4)
})

test_that("R's generator is left alone, and a session that drew nothing still has not", {
  env <- fake_environment(reward = first_action)
  set.seed(1)
  state <- .Random.seed
  search_repeat(env, rounds = 2, target = 99, seeds = 1:2)
  expect_identical(.Random.seed, state)
  withr::local_preserve_seed()
  rm(".Random.seed", envir = globalenv())
  search_repeat(env, rounds = 2, target = 99, seeds = 1:2)
  expect_false(exists(".Random.seed", globalenv(), inherits = FALSE))
})

test_that("it prints and sums up in a few lines", {
  env <- scripted_environment(c(9, 0, 0, 9, 0, 0, 0, 0, 9))
  searches <- search_repeat(env, rounds = 3, episodes = 1, target = 9, seeds = 1:4)
  shown <- paste(capture.output(print(searches)), collapse = "\n")
  expect_match(shown, "Random search in Fake-v0, repeated with 4 seeds", fixed = TRUE)
  expect_match(shown, "Solved within 3 rounds: 3 of 4 (75%), in round 2 on average", fixed = TRUE)
  expect_match(shown, "Chance of a round: 33% (standard error 16%), one in 3", fixed = TRUE)
  expect_match(shown, "Played 9 rounds, 9 episodes, 9 steps in", fixed = TRUE)
  sum <- summary(searches)
  expect_identical(sum$share, 0.75)
  expect_identical(sum$rounds[["Median"]], 2)
  expect_output(print(sum), "Median")
  none <- search_repeat(fake_environment(), rounds = 2, target = 99, seeds = 1)
  expect_identical(none$chance, 0)
  expect_identical(none$se, NA_real_)
  expect_output(print(summary(none)), "Solved within 2 rounds: 0 of 1 (0%)", fixed = TRUE)
})

test_that("an interrupt leaves the searches that were finished, with one message", {
  env <- scripted_environment(rep(1, 20))
  step <- env$step
  env$step <- function(action) if (length(env$seeds) == 8L) rlang::interrupt() else step(action)
  messages <- testthat::capture_messages(
    searches <- search_repeat(env, rounds = 3, episodes = 1, target = 9, seeds = 1:5)
  )
  expect_length(messages, 1)
  expect_match(messages, "after 2 of 5 seeds")
  expect_true(searches$interrupted)
  expect_identical(searches$searches$seed, 1:2)
  expect_output(print(searches), "Interrupted after 6 rounds")
})

test_that("an interrupt in the first search leaves a result that says it has nothing", {
  env <- fake_environment()
  env$step <- function(action) rlang::interrupt()
  suppressMessages(searches <- search_repeat(env, target = 9, seeds = 1:3))
  expect_identical(nrow(searches$searches), 0L)
  expect_identical(searches$chance, NA_real_)
  expect_output(print(summary(searches)), "before the first search")
  local_device()
  expect_error(plot(searches), "nothing to plot", class = "gym_error_argument")
})

test_that("an error in the middle carries the searches before it, with its own classes", {
  env <- scripted_environment(rep(1, 20))
  step <- env$step
  env$step <- function(action) {
    if (length(env$seeds) < 8L) return(step(action))
    gym_abort("lost", class = "gym_error_connection", url = "http://there")
  }
  cnd <- tryCatch(
    search_repeat(env, rounds = 3, episodes = 1, target = 9, seeds = 1:5),
    gym_error_search = identity
  )
  expect_s3_class(cnd, "gym_error_connection")
  expect_identical(cnd$url, "http://there")
  expect_s3_class(cnd$result, "gym_searches")
  expect_identical(cnd$result$searches$seed, 1:2)
  expect_match(conditionMessage(cnd), "after 2 seeds")
  expect_identical(conditionMessage(cnd$parent), "lost")
})

test_that("bad arguments are refused before anything is made, naming argument and value", {
  bad <- function(..., message) {
    expect_error(search_repeat(..., client = no_client()), message, fixed = TRUE,
                 class = "gym_error_argument")
  }
  bad(seeds = "a", message = "`seeds` must be one or more whole numbers, not \"a\".")
  bad(seeds = numeric(), message = "`seeds`")
  bad(seeds = c(1, 2.5), message = "`seeds[2]` must be a whole number")
  bad(seeds = c(1, NA), message = "`seeds[2]`")
  bad(seeds = c(3, 1, 3), message = "`seeds` must be different")
  bad(rounds = 0, message = "`rounds`")
  bad(env = NA, message = "`env`")
  bad(policy = policy_random(), message = "must be a policy with weights")
  expect_error(search_repeat(fake_environment(), seeds = 1), "has no reward threshold",
               class = "gym_error_argument")
})

test_that("a progress bar is shown when asked for and nothing is said otherwise", {
  env <- function() scripted_environment(rep(1, 60))
  # R goes on to warn when an option that was not set is taken away: it is set to FALSE first.
  withr::local_options(warnPartialMatchDollar = FALSE)
  withr::local_options(warnPartialMatchDollar = TRUE)
  expect_silent(search_repeat(env(), rounds = 1, target = 9, seeds = 1:2, progress = FALSE))
  withr::local_options(cli.progress_show_after = 0, cli.dynamic = FALSE, cli.num_colors = 1)
  slow <- env()
  step <- slow$step
  slow$step <- function(action) {
    Sys.sleep(0.01)
    step(action)
  }
  shown <- capture.output(
    searches <- search_repeat(
      slow, rounds = 1, episodes = 1, target = 9, seeds = 1:40, progress = TRUE
    ),
    type = "message"
  )
  expect_match(paste(shown, collapse = " "), "Seed [0-9]+ of 40 .*0 reached the target")
})

test_that("CartPole: each seed's row is the search with that seed, and nothing stays open", {
  skip_unless_all()
  client <- local_server()
  searches <- search_repeat(seeds = c(1, 4, 2), client = client)
  expect_length(env_list_all(client), 0)
  for (i in 1:3) {
    row <- searches$searches[i, ]
    search <- search_random(seed = row$seed, client = client)
    expect_identical(row$solved, search$solved)
    expect_identical(row$rounds, nrow(search$rounds))
    expect_identical(row$mean_return, search$rounds$mean_return[[search$round]])
    expect_identical(row$steps, sum(search$rounds$steps))
  }
})

test_that("an environment that remembers earlier episodes is made anew for each seed", {
  skip_unless_all()
  client <- local_server()
  wrapped <- gym_wrap("CartPole-v0", "NormalizeObservation")
  play <- function(seeds) {
    messages <- testthat::capture_messages(
      searches <- search_repeat(wrapped, rounds = 2, target = 1e4, seeds = seeds, client = client)
    )
    expect_length(messages, 1)
    searches$searches[c("seed", "mean_return", "steps")]
  }
  expect_equal(play(1:3)[3, ], play(3), ignore_attr = "row.names")
  expect_length(env_list_all(client), 0)
})
