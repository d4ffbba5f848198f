# The pages of vignettes/ that readers write code from.

test_that("REINFORCE of the page on own agents trains, and goes on from its file bit for bit", {
  page <- page_files("^own-agent[.]Rmd$")
  skip_if_not(length(page) == 1L, "no vignettes/ beside the tests, and none in the package")
  chunks <- page_chunks(page)
  names(chunks) <- sub("^```[{]r ([a-z-]*).*$", "\\1", vapply(chunks, `[[`, "", "header"))
  code <- lapply(chunks, `[[`, "code")
  expect_lte(sum(nzchar(code$reinforce)), 30)
  made <- new.env(parent = globalenv())
  eval(parse(text = unlist(code[c("world", "reinforce", "register-reinforce")])), made)
  drawing <- policy_network(
    c(2, 1), "identity", weights = list(cbind(0, 0)), output = "gaussian", log_std = -0.5
  )
  file <- withr::local_tempfile(fileext = ".rds")
  train <- function(iterations, ...) {
    trained <- suppressMessages(train_agent(
      made$agent_climber(), made$ball, drawing, iterations = iterations, episodes = 10, seed = 1,
      eval_every = 100, eval_episodes = 20, ...
    ))
    list(coef(agent_policy(trained$agent)), trained$history$mean_return, trained$final$mean_return)
  }
  whole <- train(12)
  expect_gt(whole[[3]], train(1)[[3]] + 1)
  train(5, checkpoint = file)
  expect_identical(train(12, checkpoint = file), whole)
  expect_false(identical(train(11)[[1]], whole[[1]]))
})
