# What a session that reads it from a file has.
saved_and_read <- function(x) {
  file <- withr::local_tempfile(fileext = ".rds")
  saveRDS(x, file)
  readRDS(file)
}

holding <- function(thing) {
  force(thing)
  function(observation) if (is.null(thing)) 0L else 1L
}

expect_lost <- function(policy, text, name = "thing") {
  cnd <- expect_error(
    rollout("CartPole-v1", policy, client = no_client()),
    paste0("The function given for `policy` uses `", name, "`, ", text,
           ", which was lost when the function was saved."),
    fixed = TRUE, class = "gym_error_argument"
  )
  expect_match(conditionMessage(cnd), "Make it again in this session, and the function with it")
}

test_that("a policy that held a connection when it was saved says which", {
  connection <- textConnection("a line")
  withr::defer(close(connection))
  expect_silent(check_policy(holding(connection)))
  expect_lost(saved_and_read(holding(connection)), "a connection of R")
  expect_lost(saved_and_read(holding(curl::new_handle())), "an object of class curl_handle")
  expect_silent(check_policy(holding(curl::new_handle())))
  expect_silent(check_policy(saved_and_read(holding(stdin()))))
})

test_that("so does one that held an environment on a server", {
  env <- local_env()
  policy <- holding(env)
  expect_silent(check_policy(policy))
  expect_lost(saved_and_read(policy), "an environment made by `gym_make()`")
  file <- withr::local_tempfile(fileext = ".rds")
  saveRDS(policy, file)
  run <- run_session(
    test_client(), sprintf("policy <- readRDS(\"%s\")", file),
    "tryCatch(rollout(\"CartPole-v1\", policy, client = server),",
    "         gym_error_argument = function(cnd) cat(conditionMessage(cnd)))"
  )
  expect_match(run$stdout, "uses `thing`, an environment made by `gym_make()`", fixed = TRUE)
})

test_that("connections are found in lists, in functions and in frames around", {
  thing <- curl::new_handle()
  in_list <- local({
    things <- list(1, list(thing = thing))
    function(observation) length(things)
  })
  expect_lost(saved_and_read(in_list), "an object of class curl_handle", "things[[2]]$thing")
  in_function <- local({
    inner <- holding(thing)
    function(observation) inner(observation)
  })
  expect_lost(saved_and_read(in_function), "an object of class curl_handle")
  around <- local({
    thing <- thing
    local(function(observation, more = thing) 1L)
  })
  expect_lost(saved_and_read(around), "an object of class curl_handle")
  policies <- list(function(observation) 1L, saved_and_read(holding(thing)))
  expect_error(rollout("CartPole-v1", policies, client = no_client()),
               "given for `policy[[2]]` uses `thing`", fixed = TRUE, class = "gym_error_argument")
})

test_that("a connection that lies around and is not used does no harm", {
  beside <- local({
    thing <- curl::new_handle()
    function(observation, about = "thing") 1L
  })
  expect_silent(check_policy(saved_and_read(beside)))
})

test_that("looking for them evaluates nothing and comes to an end", {
  lazy <- function(value) function(observation) value
  expect_silent(check_policy(lazy(stop("evaluated"))))
  left_out <- function(value) function(observation) if (missing(value)) 1L else value
  expect_silent(check_policy(left_out()))
  frame <- new.env()
  makeActiveBinding("active", function() stop("evaluated"), frame)
  frame$self <- eval(quote(function(observation) if (active) self(observation)), frame)
  expect_silent(check_policy(frame$self))
})
