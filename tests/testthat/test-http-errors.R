test_that("with no server there the error names the address and the hint", {
  port <- free_port()
  client <- create_GymClient(paste0("http://127.0.0.1:", port))
  error <- expect_error(env_list_all(client), class = "gym_error_connection")
  expect_match(conditionMessage(error), paste0("http://127.0.0.1:", port), fixed = TRUE)
  expect_match(conditionMessage(error), paste0("gym_server_start(port = ", port, ")"), fixed = TRUE)
})

test_that("a server that stops in the middle is an error, one that is back is used again", {
  skip_unless_all()
  server <- local_server()
  port <- as.integer(sub(".*:", "", server$remote_base))
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  gym_server_stop(server)
  expect_error(env_step(server, id, 1), class = "gym_error_connection")
  again <- suppressMessages(local_server(port = port))
  expect_identical(again$remote_base, server$remote_base)
  expect_error(env_step(server, id, 1), "unknown", class = "gym_error_http_400")
  expect_length(env_reset(server, env_create(server, "CartPole-v1")), 4)
})

test_that("whatever way a server is dead, the error comes within the timeout, with what helps", {
  skip_unless_all()
  for (how in c("silent", "half", "full", "cut")) {
    client <- create_GymClient(local_stalling(how), timeout = 0.5)
    for (call in list(env_list_all, function(x) env_create(x, "CartPole-v1"))) {
      # Where it is not noticed this test hangs for a minute.
      taken <- system.time(error <- expect_error(call(client), class = "gym_error_connection"))
      expect_lt(taken[["elapsed"]], 20)
      hint <- switch(how, full = , cut = "gym_server_start", "timeout")
      expect_match(conditionMessage(error), hint, info = how)
    }
  }
})

test_that("a server that is killed or stopped in a call is noticed", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_odd_server()
  pid <- the_session$servers[[server$remote_base]]$pid
  hasty <- create_GymClient(server$remote_base, timeout = 1)
  env <- make_odd("Slow", server)
  env$reset()

  tools::pskill(pid, tools::SIGSTOP)
  error <- expect_error(env_list_all(hasty), class = "gym_error_connection")
  expect_match(conditionMessage(error), "gym_server_stop()", fixed = TRUE)
  tools::pskill(pid, tools::SIGCONT)

  kill_later(pid, 0.3)
  error <- expect_error(env$step(1), class = "gym_error_connection")
  expect_match(conditionMessage(error), "made on a server that has ended", fixed = TRUE)
})

test_that("a hint that ends with a command can be copied whole", {
  expect_identical(sentence("in a terminal: \"python\" -m pip install \"gymnasium[box2d]\""),
                   "In a terminal: \"python\" -m pip install \"gymnasium[box2d]\"")
  expect_identical(sentence("did you mean this"), "Did you mean this.")
})
