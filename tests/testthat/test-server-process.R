test_that("the reason why a server has ended is found in its log", {
  reason <- function(status, ...) {
    log <- withr::local_tempfile(lines = c(...))
    end_reason(list(get_exit_status = function() status), log)
  }
  hang <- "2026-01-02 03:04:05,678 CRITICAL gym_server.cli.stuck: step() of it took more than 3 s"
  expect_identical(reason(1L, "before", hang, "Thread 1", "  File a.py"),
                   "step() of it took more than 3 s.")
  expect_match(reason(1L, "Timeout (0:00:04)!", "Thread 1"), "`max_call_seconds`", fixed = TRUE)
  expect_identical(reason(-11L, "Fatal Python error: Aborted", "", "Thread 1"),
                   "It crashed: Aborted, signal 11.")
  expect_identical(reason(-11L, "x"), "It was ended by signal 11.\nx")
  expect_match(reason(-9L, "x"), "max_memory_mb")
  expect_match(reason(-6L, "terminate called after throwing an instance of 'std::bad_alloc'",
                      "Fatal Python error: Aborted"), "max_memory_mb")
  expect_identical(reason(3L, "a", "b", "c", "d"), "Its exit status is 3.\nb\nc\nd")
  expect_null(reason(0L, "a"))
})

# What listens at an address --------------------------------------------------------------

# A program that is no Gym server; the port it listens on.
local_stranger <- function(name, frame = parent.frame()) {
  python <- working_python()
  process <- processx::process$new(
    python, c(test_path("stranger_server.py"), name), stdin = "|", stdout = "|", stderr = NULL
  )
  withr::defer(process$kill(), envir = frame)
  port <- character()
  while (!length(port) && process$is_alive()) {
    process$poll_io(1000)
    port <- process$read_output_lines()
  }
  as.integer(port)
}

test_that("a server's place is distinguished from other addresses", {
  expect_identical(local_place("http://127.0.0.1:5000"), list(host = "127.0.0.1", port = 5000L))
  expect_identical(local_place("http://localhost:5001"), list(host = "127.0.0.1", port = 5001L))
  expect_identical(local_place("http://127.1.2.3:80"), list(host = "127.1.2.3", port = 80L))
  expect_identical(local_place("http://[::1]:5000"), list(host = "::1", port = 5000L))
  for (other in c(
    "https://127.0.0.1:5000", "http://127.0.0.1", "http://127.0.0.1:5000/gym", "http://lab:5000",
    "http://127.0.0.1.example.org:5000", "http://localhost:0", "http://localhost:70000",
    "http://localhost.lab:5000", "http://10.0.0.1:5000", "http://user@127.0.0.1:5000"
  )) {
    expect_null(local_place(other), info = other)
  }
})

test_that("it is found out who listens", {
  port <- free_port()
  nobody <- probe_server(paste0("http://127.0.0.1:", port), timeout = 0.3)
  expect_false(nobody$listens)
  expect_false(nobody$is_gym)

  server <- local_server()
  gym <- probe_server(server$remote_base, timeout = 5)
  expect_true(gym$listens && gym$is_gym)

  stranger <- probe_server(paste0("http://127.0.0.1:", local_stranger("Fish/1.0")), timeout = 5)
  expect_true(stranger$listens)
  expect_false(stranger$is_gym)
  expect_identical(stranger$name, "Fish/1.0")
})

test_that("who takes connections but does not answer listens", {
  port <- free_port()
  socket <- serverSocket(port)
  withr::defer(close(socket))
  silent <- probe_server(paste0("http://127.0.0.1:", port), timeout = 0.3)
  expect_true(silent$listens)
  expect_false(silent$is_gym)
})

test_that("asking who listens leaves R's generator alone", {
  port <- free_port()
  set.seed(1)
  before <- .Random.seed
  probe_server(paste0("http://127.0.0.1:", port), timeout = 0.3)
  expect_identical(.Random.seed, before)
})

test_that("AirPlay at the port is recognised by its name, with the hint", {
  client <- create_GymClient(paste0("http://127.0.0.1:", local_stranger("AirTunes/695.5.1")))
  error <- expect_error(env_create(client, "CartPole-v0"), class = "gym_error_http_403")
  expect_match(conditionMessage(error), "AirPlay", fixed = TRUE)
  expect_match(conditionMessage(error), "gym_server_start()", fixed = TRUE)
})

test_that("another program at the port is named", {
  port <- local_stranger("Fish/1.0")
  base <- paste0("http://127.0.0.1:", port)
  error <- expect_error(env_list_all(create_GymClient(base)), class = "gym_error_http_403")
  expect_match(conditionMessage(error), "Fish/1.0", fixed = TRUE)
  expect_match(conditionMessage(error), "gym_server_start()", fixed = TRUE)
  response <- httr::GET(paste0(base, "/v1/envs/"))
  error <- expect_error(
    parse_server_error_or_raise_for_status(response), class = "gym_error_http_403"
  )
  expect_match(conditionMessage(error), "Fish/1.0", fixed = TRUE)
})

test_that("a port that is taken: the error says what has it", {
  skip_unless_all()
  server <- local_server()
  base <- server$remote_base
  start <- function(base) gym_server_start(port = local_place(base)$port)
  error <- expect_error(start(base), class = "gym_error_server_start")
  expect_match(conditionMessage(error), "This session's own server", fixed = TRUE)
  expect_match(conditionMessage(error), paste0("create_GymClient(\"", base, "\")"), fixed = TRUE)

  known <- the_session$servers
  local_session(servers = list())
  error <- expect_error(start(base), "A Gym server has it", class = "gym_error_server_start")
  local_session(servers = known)

  stranger <- paste0("http://127.0.0.1:", local_stranger("Fish/1.0"))
  expect_error(start(stranger), "Fish/1.0", class = "gym_error_server_start")
})

test_that("Python is looked for in the order of the help page", {
  folder <- withr::local_tempdir()
  commands <- file.path(folder, c("venv/bin/python3", "path/python3", "WindowsApps/python3"))
  for (command in commands) {
    dir.create(dirname(command), recursive = TRUE)
    writeLines(command, command)
    Sys.chmod(command, "755")
  }
  skip_on_os("windows")
  withr::local_envvar(
    GYM_PYTHON = NA, VIRTUAL_ENV = file.path(folder, "venv"), CONDA_PREFIX = NA,
    PATH = paste(file.path(folder, c("WindowsApps", "path")), collapse = ":")
  )
  expect_identical(python_candidates(), commands[1:2])
  expect_identical(python_candidates("/my/python"), "/my/python")
  withr::local_envvar(GYM_PYTHON = "/its/python")
  expect_identical(python_candidates(), "/its/python")
  expect_identical(python_candidates("/my/python"), "/my/python")
})

test_that("what is to be typed in a terminal is quoted for the system's own", {
  expect_identical(quote_for_terminal("a b"), if (is_windows()) "\"a b\"" else "'a b'")
  local_binding("is_windows", function() TRUE)
  expect_identical(quote_for_terminal("C:/a b"), "\"C:/a b\"")
})

test_that("the stand-in for Python of macOS without developer tools is left alone", {
  skip_on_os("windows")
  skip_if_not(any(file.exists(c("/usr/bin/python3", "/usr/bin/python"))), "no Python in /usr/bin")
  withr::local_envvar(GYM_PYTHON = NA, VIRTUAL_ENV = NA, CONDA_PREFIX = NA, PATH = "/usr/bin")
  expect_true(any(startsWith(python_candidates(), "/usr/bin/")))
  local_binding("lacks_developer_tools", function() TRUE)
  expect_false(any(startsWith(python_candidates(), "/usr/bin/")))
})

test_that("a Python that cannot run the server says why", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  problem <- function(...) python_problem(fake_program(file.path(folder, "python3"), ...), 20)
  set.seed(1)
  before <- .Random.seed
  expect_null(python_problem(working_python()))
  expect_identical(.Random.seed, before)
  expect_identical(problem(
    "echo \"gym_server cannot run on this Python (3.12.1, /x (y)): No module named 'flask'\" >&2",
    "exit 78"
  ), "No module named 'flask'")
  expect_identical(problem("exit 1"), "it ended without output")
  expect_identical(problem("exit 0"), "it ended without output")
  expect_match(python_problem("/no/such/python"), "there is no such file")
  hanging <- fake_program(file.path(folder, "hanging"), "exec sleep 60")
  expect_match(python_problem(hanging, timeout = 0.5), "does not answer in 0.5 s")
})
