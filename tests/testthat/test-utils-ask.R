answering <- function(answer, default) {
  withr::local_options(askYesNo = NULL)
  prompts <- character()
  local_functions(read_answer_line = function(prompt) {
    prompts <<- c(prompts, prompt)
    answer
  })
  value <- ask_yes_no("Start one?", default)
  expect_length(prompts, 1)
  value
}

test_that("yes is yes and no is no, also in part and with blanks", {
  for (answer in c("yes", "y", " YES ", "Ye")) expect_true(answering(answer, default = FALSE))
  for (answer in c("no", "n", "No ")) expect_false(answering(answer, default = TRUE))
})

test_that("just Enter, or a blank line of a script, is the default", {
  expect_true(answering("", default = TRUE))
  expect_true(answering("  ", default = TRUE))
  expect_false(answering("", default = FALSE))
})

test_that("a line of a script is not taken for an answer, nor asked for another", {
  error <- expect_error(
    answering("env_id <- \"CartPole-v0\"", default = TRUE), class = "gym_error_argument"
  )
  expect_match(conditionMessage(error), "CartPole-v0", fixed = TRUE)
  expect_match(conditionMessage(error), "next line of a script", fixed = TRUE)
})

test_that("a front end's own dialog is used where there is one", {
  asked <- NULL
  dialog <- function(answer) {
    function(msg, ...) {
      asked <<- msg
      answer
    }
  }
  withr::local_options(askYesNo = dialog(TRUE))
  expect_true(ask_yes_no("Start one?", default = FALSE))
  expect_identical(asked, "Start one?")
  withr::local_options(askYesNo = dialog(NA))
  expect_false(ask_yes_no("Start one?", default = TRUE))
})
