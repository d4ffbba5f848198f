# What a user sees and answers, in a real interactive session.

test_that("a script that names a server that is not there gets one, and goes on", {
  skip_unless_all()
  skip_if_no_server()
  python <- working_python()
  console <- local_console(c(GYM_PYTHON = python))
  port <- free_port()
  console$say("library(gym)")
  console$await("> ")
  console$say(sprintf("server <- create_GymClient('http://127.0.0.1:%d')", port))
  console$await("> ")
  console$say("length(env_reset(server, env_create(server, 'CartPole-v0')))")
  question <- console$await("[(]Yes/no[)] ")
  expect_match(question, sprintf("No server runs at http://127.0.0.1:%d", port), fixed = TRUE)
  console$say("yes")
  console$await("stops with this R session[.]\n")
  answer <- console$await("> ")
  expect_match(answer, "[1] 4", fixed = TRUE)
  console$say("cat('pid', gym:::the_session$servers[[1]]$pid, '\n')")
  pid <- as.integer(sub(".*pid ([0-9]+).*", "\\1", console$await("pid [0-9]+ \n")))
  expect_true(pid_runs(pid))
  console$say("q('no')")
  console$process$wait(30000)
  for (i in 1:100) {
    if (!pid_runs(pid)) break
    Sys.sleep(0.1)
  }
  expect_false(pid_runs(pid))
})

test_that("without a Python the question comes once; declined, the error says what helps", {
  console <- local_console(c(
    GYM_PYTHON = "", VIRTUAL_ENV = "", CONDA_PREFIX = "", R_USER_CACHE_DIR = withr::local_tempdir()
  ))
  console$say("library(gym); Sys.setenv(PATH = '')")
  console$await("> ")
  console$say("env <- gym_make('CartPole-v1')")
  question <- console$await("[(]yes/No[)] ")
  expect_match(question, "MB", fixed = TRUE)
  expect_match(question, "Where:", fixed = TRUE)
  # An empty line, as a pasted script may have one, is no consent.
  console$say("")
  error <- console$await("> ")
  expect_match(error, "gym::gym_server_install()", fixed = TRUE)
  console$say("env <- gym_make('CartPole-v1')")
  again <- console$await("\n> ")
  expect_match(again, "gym::gym_server_install()", fixed = TRUE)
  expect_no_match(again, "yes/No")
})
