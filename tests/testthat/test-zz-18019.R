book_files <- function() {
    folders <- c(file.path(test_path(), "../../vignettes"), system.file("doc", 
        package = "gym"))
    files <- lapply(folders, list.files, pattern = "^book-.*[.]Rmd$", 
        full.names = TRUE)
    found <- files[lengths(files) > 0L]
    if (length(found)) 
        found[[1L]]
    else character()
}
book_file <- function(name) {
    files <- book_files()
    skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
    file <- files[basename(files) == paste0(name, ".Rmd")]
    skip_if_not(length(file) == 1L, paste0("there is no ", name, 
        ".Rmd"))
    file
}
book_chunks <- function(file) {
    lines <- readLines(file, encoding = "UTF-8")
    fences <- grep("^```", lines)
    starts <- fences[c(TRUE, FALSE)]
    ends <- fences[c(FALSE, TRUE)]
    stopifnot(length(starts) == length(ends), lines[ends] == 
        "```")
    chunks <- Map(function(start, end) {
        list(header = lines[[start]], code = lines[seq_len(end - 
            start - 1L) + start])
    }, starts, ends)
    chunks[grepl("^```[{]r", lines[starts])]
}
is_evaluated <- function(chunk) !grepl("eval *= *(FALSE|F)\\b", 
    chunk$header)
run_book <- function(file) {
    skip_if_not_installed("knitr")
    withr::local_pdf(NULL)
    made <- new.env(parent = globalenv())
    chunks <- Filter(is_evaluated, book_chunks(file))
    is_of_page <- !grepl("^```[{]r setup", vapply(chunks, `[[`, 
        "", "header"))
    code <- lapply(chunks[is_of_page], `[[`, "code")
    withr::with_preserve_seed(utils::capture.output(source(exprs = parse(text = unlist(code), 
        keep.source = FALSE), local = made, print.eval = TRUE)))
    made
}
book_facts <- list()
book_facts[["book-07-n-steps-and-traces"]] <- function(made) {
    expect_equal(unname(made$exact), seq(-0.9, 0.9, by = 0.1))
    expect_equal(unname(made$one[, 1]), c(-0.4, rep(0, 18)))
    expect_equal(unname(made$one[, 2]), c(-0.4, -0.64, -0.4, 
        rep(0, 16)))
    away <- log(made$one[made$one[, 3] != 0, 3]/-0.4, base = 0.8)
    expect_equal(away, round(away))
    expect_identical(unname(which.min(made$one[, 3])), 1L)
    expect_lt(max(abs(made$by_n - cbind(c(0.506, 0.471, 0.413, 
        0.346), c(0.47, 0.406, 0.311, 0.318), c(0.412, 0.322, 
        0.265, 0.39), c(0.347, 0.279, 0.319, 0.479), c(0.322, 
        0.327, 0.421, 0.57)))), 0.05)
    expect_lt(max(abs(made$by_lambda - cbind(c(0.506, 0.471, 
        0.413, 0.346), c(0.485, 0.431, 0.344, 0.276), c(0.438, 
        0.354, 0.257, 0.307), c(0.415, 0.325, 0.257, 0.346), 
        c(0.401, 0.316, 0.278, 0.393)))), 0.05)
    expect_identical(colnames(made$by_n)[[which.min(apply(made$by_n, 
        2, min))]], "4")
    expect_true(all(diff(apply(made$by_n, 2, which.min)) <= 0))
    expect_true(which.min(apply(made$by_lambda, 2, min)) %in% 
        2:4)
    error <- sqrt(colMeans((made$kinds - made$exact)^2))
    expect_gt(error[["accumulating"]], error[["replacing"]])
}
book_facts[["book-08-planning"]] <- function(made) {
    expect_equal(made$best$start_value, 0.95^13)
    expect_equal(made$steps_needed(made$best), 14)
    expect_true(all(diff(colMeans(made$lengths[2:30, ])) < 0))
    expect_true(all(diff(colMeans(made$lengths[2:5, ])) < 0))
    last <- colMeans(made$lengths[21:30, c("5", "50")])
    expect_true(all(last >= 14 & last < 20))
    greedy <- vapply(unlist(made$learned[2:3], recursive = FALSE), 
        made$greedy_steps, 0)
    expect_equal(greedy/2, round(greedy/2), ignore_attr = TRUE)
    expect_equal(min(greedy), 14)
    expect_lt(max(greedy), 18.5)
    learned <- made$learn_maze(0, iterations = 2, seeds = 1)[[1]]$agent$weights
    expect_identical(sum(rowSums(learned) > 0), 2L)
    expect_identical(sum(made$early[[1]]$values > 0), 5L)
    expect_equal(made$early[[2]]$start_value, 0.95^13)
    reward <- made$rewards[c(1000, 1300, 3000), ]
    expect_true(all(reward[1, ] > 40))
    expect_true(all(reward[2, ] - reward[1, ] < 5))
    expect_gt(mean(made$last_rewards(made$curious)), mean(made$last_rewards(made$blocking)))
}
book_facts[["book-09-approximation"]] <- function(made) {
    expect_lt(max(abs(made$grouped - made$exact)), 0.3)
    expect_identical(length(unique(made$grouped)), 10L)
    expect_true(all(made$errors < 0.3))
    expect_gt(max(made$weights[100, ]), 100)
}
book_facts[["book-10-mountain-car"]] <- function(made) {
    made$car$reset(seed = 1)
    before <- made$car$step(1)$observation
    after <- made$car$step(2)$observation
    velocity <- before[["velocity"]] + 0.001 - 0.0025 * cos(3 * 
        before[["position"]])
    expect_equal(after[["velocity"]], velocity)
    expect_equal(after[["position"]], before[["position"]] + 
        velocity)
    expect_true(all(diff(colMeans(made$lengths)) < -50))
    expect_true(all(diff(colMeans(made$lengths[16:25, ])) < -50))
    expect_true(all(unlist(made$costs) > -1))
    expect_true(all(diff(vapply(made$costs, max, 0)) > 5))
    summit <- made$grid[which.max(made$costs[[3]]), ]
    expect_lt(abs(summit[[1]] + 0.5), 0.2)
    expect_lt(abs(summit[[2]]), 0.02)
    expect_lt(diff(colMeans(made$further[16:25, ])), -50)
    expect_lt(abs(-made$traces$final$mean_return - 107), 20)
}
book_facts[["book-02-bandits"]] <- function(made) {
    expect_equal(made$most, 1.5388, tolerance = 1e-04)
    late <- function(learned) mean(utils::tail(learned$curve$best_share, 
        100))
    expect_lt(abs(late(made$greedy) - 0.36), 0.06)
    expect_lt(abs(late(made$often) - 0.8), 0.06)
    expect_gt(late(made$seldom), late(made$greedy) + 0.05)
    expect_gt(late(made$often), late(made$seldom) + 0.1)
    share <- function(learned, steps) mean(learned$curve$best_share[steps])
    expect_lt(share(made$optimistic, 1:20), share(made$realistic, 
        1:20))
    expect_gt(share(made$optimistic, 901:1000), share(made$realistic, 
        901:1000))
}
book_facts[["book-04-dynamic-programming"]] <- function(made) {
    expect_equal(unname(made$random$values[1:8]), c(0, -14, -20, 
        -22, -14, -18, -20, -20))
    expect_equal(unname(made$sweeps[3, 2:3]), c(-1.75, -2))
    expect_equal(unname(made$best$values[1:8]), c(0, -1, -2, 
        -3, -1, -2, -3, -2))
    expect_equal(unname(made$gambler$values[c("25", "50", "75")]), 
        c(0.16, 0.4, 0.64))
    expect_identical(unname(made$smallest[c(25, 50, 75)]), c(25L, 
        50L, 25L))
    expect_lte(max(abs(made$moved)), 5)
    expect_identical(made$moved[[1, 1]], 0L)
}
book_facts[["book-05-monte-carlo"]] <- function(made) {
    expect_equal(made$best$start_value, -0.0431131, tolerance = 1e-05)
    bust <- sum(made$dealer["bust", ] * made$chance)
    expect_lt(abs(bust - 0.28), 0.005)
    expect_equal(unname(colSums(made$dealer)), rep(1, 10))
    expect_true(all(made$errors >= 0))
    value <- evaluate_policy(made$blackjack, policy_table(made$learned$policy$q))$mean_return
    expect_lt(made$best$start_value - value, 0.02)
    expect_true(all(is.finite(made$error)))
}
book_facts[["book-06-temporal-differences"]] <- function(made) {
    expect_equal(unname(made$exact), 1:5/6)
    expect_lt(max(abs(made$values[, "100"] - made$exact)), 0.15)
    expect_equal(solve_mdp(made$windy)$start_value, -15)
    expect_equal(solve_mdp(made$cliff)$start_value, -13)
    expect_equal(solve_mdp(made$cliff, policy = made$policies$q)$start_value, 
        -13)
    late <- function(training) mean(utils::tail(training$history$mean_return, 
        100))
    expect_gt(late(made$sarsa), late(made$q) + 10)
}
book_facts[["book-13-policy-gradients"]] <- function(made) {
    expect_equal(vapply(made$greedy, made$value_of_right, 0), 
        c(left = -82.1, right = -44.2), tolerance = 0.001)
    expect_equal(made$best$maximum, 2 - sqrt(2), tolerance = 1e-04)
    near <- function(learned) which(learned$right > 0.5)[[1]]
    expect_lt(near(made$with), 0.75 * near(made$without))
    expect_lt(max(abs(c(utils::tail(made$with$right, 1), utils::tail(made$without$right, 
        1)) - made$best$maximum)), 0.15)
    expect_gt(made$with$final$mean_return, -15)
    right <- exp(made$preferences[[2]])/sum(exp(made$preferences))
    expect_lt(abs(right - made$best$maximum), 0.15)
}
for (name in names(book_facts)) {
    test_that(paste(name, "makes each figure by 20 lines of code at most"), 
        {
            file <- book_file(name)
            chunks <- book_chunks(file)
            expect_gt(length(chunks), 3L)
            lengths <- vapply(chunks, function(chunk) sum(nzchar(trimws(chunk$code))), 
                0L)
            headers <- vapply(chunks, `[[`, "", "header")
            expect_identical(headers[lengths > 20L], character())
            lines <- unlist(lapply(chunks, `[[`, "code"))
            expect_identical(lines[nchar(lines) > 100L], character())
            expect_false(any(grepl("eval *=", headers) & vapply(chunks, 
                is_evaluated, NA)))
        })
    test_that(paste(name, "runs, and shows what the book shows"), 
        {
            file <- book_file(name)
            skip_unless_all()
            expect_no_error(made <- run_book(file))
            facts <- book_facts[[name]]
            if (!is.null(facts)) 
                facts(made)
        })
}
if (soaks("GYM_TEST_BOOK")) test_that("Gymnasium's car is solved as the page of chapter 10 says", 
    {
        file <- book_file("book-10-mountain-car")
        shown <- unlist(lapply(Filter(Negate(is_evaluated), book_chunks(file)), 
            `[[`, "code"))
        code <- grep("^#>", shown, value = TRUE, invert = TRUE)
        client <- test_client()
        trained <- eval(parse(text = code), new.env(parent = globalenv()))
        expect_true(trained$solved)
        expect_match(shown, paste0("Solved after ", nrow(trained$history), 
            " iterations, ", format(trained$steps, big.mark = ","), 
            " steps"), all = FALSE)
        expect_match(shown, "Mean return in 100 fresh episodes: -103.8", 
            fixed = TRUE, all = FALSE)
        expect_equal(round(trained$final$mean_return, 1), -103.8)
    })
test_that("REINFORCE of the page on own agents trains, and goes on from its file bit for bit", 
    {
        folder <- unique(dirname(book_files()))
        skip_if_not(length(folder) == 1L, "no vignettes/ beside the tests, and none in the package")
        chunks <- book_chunks(file.path(folder, "own-agent.Rmd"))
        names(chunks) <- sub("^```[{]r ([a-z-]*).*$", "\\1", 
            vapply(chunks, `[[`, "", "header"))
        code <- lapply(chunks, `[[`, "code")
        expect_lte(sum(nzchar(code$reinforce)), 30)
        made <- new.env(parent = globalenv())
        eval(parse(text = unlist(code[c("world", "reinforce", 
            "register-reinforce")])), made)
        drawing <- policy_network(c(2, 1), "identity", weights = list(cbind(0, 
            0)), output = "gaussian", log_std = -0.5)
        file <- withr::local_tempfile(fileext = ".rds")
        train <- function(iterations, ...) {
            trained <- suppressMessages(train_agent(made$agent_climber(), 
                made$ball, drawing, iterations = iterations, 
                episodes = 10, seed = 1, eval_every = 100, eval_episodes = 20, 
                ...))
            list(coef(agent_policy(trained$agent)), trained$history$mean_return, 
                trained$final$mean_return)
        }
        whole <- train(12)
        expect_gt(whole[[3]], train(1)[[3]] + 10)
        train(5, checkpoint = file)
        expect_identical(train(12, checkpoint = file), whole)
        expect_false(identical(train(11)[[1]], whole[[1]]))
    })
