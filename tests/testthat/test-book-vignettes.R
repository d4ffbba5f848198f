# The companion to Sutton and Barto's book: vignettes/book-*.Rmd, a page for each of its chapters.

book_files <- function() page_files("^book-.*[.]Rmd$")

book_file <- function(name) {
  files <- book_files()
  skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
  file <- files[basename(files) == paste0(name, ".Rmd")]
  skip_if_not(length(file) == 1L, paste0("there is no ", name, ".Rmd"))
  file
}

is_evaluated <- function(chunk) !grepl("eval *= *(FALSE|F)\\b", chunk$header)

# Runs what knitr would run, and returns the environment with what was made.
run_book <- function(file) {
  skip_if_not_installed("knitr")
  withr::local_pdf(NULL)
  made <- new.env(parent = globalenv())
  chunks <- Filter(is_evaluated, page_chunks(file))
  # The first one sets up how pictures are made.
  is_of_page <- !grepl("^```[{]r setup", vapply(chunks, `[[`, "", "header"))
  code <- lapply(chunks[is_of_page], `[[`, "code")
  withr::with_preserve_seed(utils::capture.output(
    source(exprs = parse(text = unlist(code), keep.source = FALSE), local = made,
           print.eval = TRUE)
  ))
  made
}

# What must hold of the objects that a vignette makes: exact values where there are any, and what
# the book's figures show. A function of the environment with these objects for each vignette, under
# the file's name without ".Rmd".
book_facts <- list()

book_facts[["book-07-n-steps-and-traces"]] <- function(made) {
  expect_equal(unname(made$exact), seq(-0.9, 0.9, by = 0.1))
  # One episode, which ended on the right, at a learning rate of 0.4.
  expect_equal(unname(made$one[, 1]), c(rep(0, 18), 0.4))
  expect_equal(unname(made$one[, 2]), c(rep(0, 15), rep(0.4, 4)))
  away <- log(made$one[made$one[, 3] != 0, 3] / 0.4, base = 0.8)
  expect_equal(away, round(away))
  expect_identical(unname(which.max(made$one[, 3])), 19L)
  # Means of 300 repetitions of the book's algorithms, calculated without this package: n-step TD,
  # and TD(lambda) with replacing traces, and the standard deviations of single ones. The seeds of
  # the vignette are the first ones, and the means within four standard errors.
  expect_near <- function(runs, reference, sd) {
    error <- sd * sqrt(1 / nrow(runs) + 1 / 300)
    expect_lt(max(abs(colMeans(runs) - c(reference)) / c(error)), 4)
  }
  expect_near(made$runs_n, cbind(
    c(0.506, 0.471, 0.413, 0.346), c(0.470, 0.406, 0.311, 0.318), c(0.412, 0.322, 0.265, 0.390),
    c(0.347, 0.279, 0.319, 0.479), c(0.322, 0.327, 0.421, 0.570)
  ), cbind(
    c(0.001, 0.002, 0.006, 0.018), c(0.002, 0.006, 0.024, 0.041), c(0.007, 0.022, 0.053, 0.047),
    c(0.020, 0.044, 0.061, 0.053), c(0.039, 0.054, 0.052, 0.056)
  ))
  expect_near(made$runs_lambda, cbind(
    c(0.506, 0.471, 0.413, 0.346), c(0.485, 0.431, 0.344, 0.276), c(0.438, 0.354, 0.257, 0.307),
    c(0.415, 0.325, 0.257, 0.346), c(0.401, 0.316, 0.278, 0.393)
  ), cbind(
    c(0.001, 0.002, 0.006, 0.018), c(0.002, 0.005, 0.015, 0.042), c(0.006, 0.016, 0.048, 0.057),
    c(0.008, 0.027, 0.057, 0.058), c(0.011, 0.036, 0.063, 0.059)
  ))
  # Figure 7.2: the best n is in between, and a larger one needs a smaller learning rate.
  expect_identical(colnames(made$by_n)[[which.min(apply(made$by_n, 2, min))]], "4")
  expect_true(all(diff(apply(made$by_n, 2, which.min)) <= 0))
  # Figure 12.6: neither the smallest lambda nor the largest.
  expect_true(which.min(apply(made$by_lambda, 2, min)) %in% 2:4)
  error <- sqrt(colMeans((made$kinds - made$exact)^2))
  expect_gt(error[["accumulating"]], error[["replacing"]])
}

book_facts[["book-08-planning"]] <- function(made) {
  expect_equal(made$best$start_value, 0.95^13)
  expect_equal(made$steps_needed(made$best), 14)
  # Figure 8.2: the more planning, the sooner; in the end a little above 14 steps.
  expect_true(all(diff(colMeans(made$lengths[2:30, ])) < 0))
  expect_true(all(diff(colMeans(made$lengths[2:5, ])) < 0))
  last <- colMeans(made$lengths[21:30, c("5", "50")])
  expect_true(all(last >= 14 & last < 20))
  # All ways through the maze have an even number of steps.
  greedy <- vapply(unlist(made$learned[2:3], recursive = FALSE), made$greedy_steps, 0)
  expect_equal(greedy / 2, round(greedy / 2), ignore_attr = TRUE)
  expect_equal(min(greedy), 14)
  expect_lt(max(greedy), 18.5)
  # Figure 8.3: without planning an episode teaches one state.
  learned <- made$learn_maze(0, iterations = 2, seeds = 1)[[1]]$agent$weights
  expect_identical(sum(rowSums(learned) > 0), 2L)
  expect_identical(sum(made$early[[1]]$values > 0), 5L)
  expect_equal(made$early[[2]]$start_value, 0.95^13)
  # Figure 8.4: after the change no reward comes for a while.
  reward <- made$rewards[c(1000, 1300, 3000), ]
  expect_true(all(reward[2, ] - reward[1, ] < 5))
  # Means of 200 repetitions, and their standard errors, calculated without this package.
  expect_near <- function(values, reference, se) {
    expect_lt(abs(mean(values) - reference) / sqrt(var(values) / length(values) + se^2), 4)
  }
  expect_near(reward[1, ], 70.9, 0.5)
  expect_near(made$last[, "Dyna-Q"], 86.5, 2)
  expect_near(made$last[, "Dyna-Q+"], 110.5, 1.1)
  # Dyna-Q+ finds the new gap sooner.
  expect_gt(mean(made$last_rewards(made$curious)), mean(made$last_rewards(made$blocking)))
}

book_facts[["book-09-approximation"]] <- function(made) {
  # Figure 9.2: the values rise from -1 to 1; ten groups come near.
  expect_lt(max(abs(made$grouped - made$exact)), 0.3)
  expect_identical(length(unique(made$grouped)), 10L)
  expect_true(all(made$errors < 0.3))
  # Figure 11.2: the weights grow without an end.
  expect_gt(max(made$weights[100, ]), 100)
}

book_facts[["book-10-mountain-car"]] <- function(made) {
  made$car$reset(seed = 1)
  before <- made$car$step(1)$observation
  after <- made$car$step(2)$observation
  velocity <- before[["velocity"]] + 0.001 - 0.0025 * cos(3 * before[["position"]])
  expect_equal(after[["velocity"]], velocity)
  expect_equal(after[["position"]], before[["position"]] + velocity)
  # Figure 10.2: the larger the learning rate, of these three, the sooner.
  expect_true(all(diff(colMeans(made$lengths)) < -50))
  expect_true(all(diff(colMeans(made$lengths[16:25, ])) < -50))
  # Figure 10.1: costs grow with the episodes. (Tiles that a state shares with others may put it a
  # little below 0.)
  expect_true(all(unlist(made$costs) > -1))
  expect_true(all(diff(vapply(made$costs, max, 0)) > 5))
  summit <- made$grid[which.max(made$costs[[3]]), ]
  expect_lt(abs(summit[[1]] + 0.5), 0.2)
  expect_lt(abs(summit[[2]]), 0.02)
  # Figures 10.3 and 12.10: traces do better. The best policies need a little above 100 steps.
  expect_lt(diff(colMeans(made$further[16:25, ])), -50)
  expect_lt(abs(-made$traces$final$mean_return - 107), 20)
}

book_facts[["book-02-bandits"]] <- function(made) {
  # The expected largest of ten standard normal numbers.
  expect_equal(made$most, 1.5388, tolerance = 1e-4)
  # Figure 2.2: in the end the greedy learners take the best arm in some 36 of 100 steps, and those
  # that explore in each tenth step in some 80.
  late <- function(learned) mean(utils::tail(learned$curve$best_share, 100))
  expect_lt(abs(late(made$greedy) - 0.36), 0.06)
  expect_lt(abs(late(made$often) - 0.8), 0.06)
  expect_gt(late(made$seldom), late(made$greedy) + 0.05)
  expect_gt(late(made$often), late(made$seldom) + 0.1)
  # Figure 2.3: optimism explores first and is ahead later.
  share <- function(learned, steps) mean(learned$curve$best_share[steps])
  expect_lt(share(made$optimistic, 1:20), share(made$realistic, 1:20))
  expect_gt(share(made$optimistic, 901:1000), share(made$realistic, 901:1000))
}

book_facts[["book-04-dynamic-programming"]] <- function(made) {
  # Figure 4.1.
  expect_equal(unname(made$random$values[1:8]), c(0, -14, -20, -22, -14, -18, -20, -20))
  expect_equal(unname(made$sweeps[3, 2:3]), c(-1.75, -2))
  expect_equal(unname(made$best$values[1:8]), c(0, -1, -2, -3, -1, -2, -3, -2))
  # Figure 4.3: at a quarter, a half and three quarters of the way the coin decides.
  expect_equal(unname(made$gambler$values[c("25", "50", "75")]), c(0.16, 0.4, 0.64))
  expect_identical(unname(made$smallest[c(25, 50, 75)]), c(25L, 50L, 25L))
  # Figure 4.2: never more than five cars are moved, and none where both places have few.
  expect_lte(max(abs(made$moved)), 5)
  expect_identical(made$moved[[1, 1]], 0L)
}

book_facts[["book-05-monte-carlo"]] <- function(made) {
  expect_equal(made$best$start_value, -0.0431131, tolerance = 1e-5)
  # The dealer goes above 21 in 28 of 100 hands.
  bust <- sum(made$dealer["bust", ] * made$chance)
  expect_lt(abs(bust - 0.28), 0.005)
  expect_equal(unname(colSums(made$dealer)), rep(1, 10))
  # Figure 5.1: more episodes, smaller errors.
  expect_true(all(made$errors >= 0))
  # Figure 5.2: what is learned is nearly the best.
  value <- evaluate_policy(made$blackjack, policy_table(made$learned$policy$q))$mean_return
  expect_lt(made$best$start_value - value, 0.02)
  # Figure 5.3: the value of the state, by both ways of weighting.
  expect_true(all(is.finite(made$error)))
}

book_facts[["book-06-temporal-differences"]] <- function(made) {
  expect_equal(unname(made$exact), 1:5 / 6)
  expect_lt(max(abs(made$values[, "100"] - made$exact)), 0.15)
  # Example 6.5, and example 6.6.
  expect_equal(solve_mdp(made$windy)$start_value, -15)
  expect_equal(solve_mdp(made$cliff)$start_value, -13)
  expect_equal(solve_mdp(made$cliff, policy = made$policies$q)$start_value, -13)
  # Sarsa earns more while it learns, because it keeps away from the edge.
  late <- function(training) mean(utils::tail(training$history$mean_return, 100))
  expect_gt(late(made$sarsa), late(made$q) + 10)
}

book_facts[["book-13-policy-gradients"]] <- function(made) {
  # Example 13.1.
  expect_equal(vapply(made$greedy, made$value_of_right, 0), c(left = -82.1, right = -44.2),
               tolerance = 0.001)
  expect_equal(made$best$maximum, 2 - sqrt(2), tolerance = 1e-4)
  # Figures 13.1 and 13.2: both come near the best policy, with a baseline sooner.
  near <- function(learned) which(learned$right > 0.5)[[1]]
  expect_lt(near(made$with), 0.75 * near(made$without))
  expect_lt(max(abs(c(utils::tail(made$with$right, 1), utils::tail(made$without$right, 1)) -
                      made$best$maximum)), 0.15)
  expect_gt(made$with$final$mean_return, -15)
  right <- exp(made$preferences[[2]]) / sum(exp(made$preferences))
  expect_lt(abs(right - made$best$maximum), 0.15)
}

test_that("each page of the book is listed here", {
  files <- book_files()
  skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
  expect_identical(setdiff(sub("[.]Rmd$", "", basename(files)), names(book_facts)), character())
})

for (name in names(book_facts)) {
  test_that(paste(name, "makes each figure by 20 lines of code at most"), {
    file <- book_file(name)
    chunks <- page_chunks(file)
    expect_gt(length(chunks), 3L)
    lengths <- vapply(chunks, function(chunk) sum(nzchar(trimws(chunk$code))), 0L)
    headers <- vapply(chunks, `[[`, "", "header")
    expect_identical(headers[lengths > 20L], character())
    lines <- unlist(lapply(chunks, `[[`, "code"))
    expect_identical(lines[nchar(lines) > 100L], character())
    # Nobody knows what a condition would be when the page is built.
    expect_false(any(grepl("eval *=", headers) & vapply(chunks, is_evaluated, NA)))
  })

  test_that(paste(name, "runs, and shows what the book shows"), {
    file <- book_file(name)
    skip_unless_all()
    expect_no_error(made <- run_book(file))
    facts <- book_facts[[name]]
    if (!is.null(facts)) facts(made)
  })
}

if (soaks("GYM_TEST_BOOK")) test_that("Gymnasium's car is solved as the page of chapter 10 says", {
  file <- book_file("book-10-mountain-car")
  shown <- unlist(lapply(Filter(Negate(is_evaluated), page_chunks(file)), `[[`, "code"))
  code <- grep("^#>", shown, value = TRUE, invert = TRUE)
  client <- test_client()
  trained <- eval(parse(text = code), new.env(parent = globalenv()))
  expect_true(trained$solved)
  expect_match(shown, paste0("Solved after ", nrow(trained$history), " iterations, ",
                             format(trained$steps, big.mark = ","), " steps"), all = FALSE)
  expect_match(shown, "Mean return in 100 fresh episodes: -103.8", fixed = TRUE, all = FALSE)
  expect_equal(round(trained$final$mean_return, 1), -103.8)
})
