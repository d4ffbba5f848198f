test_that("a server starts on a free port, has a log and stops", {
  server <- local_server()
  env_close(server, env_create(server, "CartPole-v1"))
  expect_match(gym_server_log(server), "CartPole-v1", all = FALSE)
  expect_s3_class(server, "GymClient")
  expect_match(server$remote_base, "^http://127.0.0.1:[0-9]+$")
  expect_type(env_list_all(server), "list")
  process <- the_session$servers[[server$remote_base]]$process
  expect_true(process$is_alive())
  expect_invisible(gym_server_stop(server))
  expect_false(process$is_alive())
  expect_identical(process$get_exit_status(), 0L)
  expect_error(gym_server_stop(server), NA)
  expect_type(gym_server_log(server), "character")
  expect_error(env_list_all(server), class = "gym_error_connection")
})

test_that("a server that ended without memory names the option that gives it more", {
  skip_unless_all()
  skip_on_os(c("windows", "mac"))
  env <- make_odd("OutOfMemory", local_odd_server())
  env$reset()
  expect_error(env$step(1), "max_memory_mb = ", fixed = TRUE, class = "gym_error_connection")
})

test_that("options of the server are written as the command line reads them", {
  expect_identical(
    server_options(list(max_memory_mb = 1e5, monitor_dir = "runs", no_auth = TRUE, off = FALSE)),
    c("--max-memory-mb", "100000", "--monitor-dir", "runs", "--no-auth")
  )
  expect_identical(
    server_options(list(allow_module = c("a", "b"))),
    c("--allow-module", "a", "--allow-module", "b")
  )
})

test_that("an option that ended says what replaces it", {
  skip_if_no_server()
  expect_error(gym_server_start(no_shutdown = TRUE), "serves one user, who may stop it",
               class = "gym_error_server_start")
})

test_that("starting a server leaves R's generator alone", {
  skip_if_no_server()
  set.seed(1)
  before <- .Random.seed
  local_server()
  expect_identical(.Random.seed, before)
})

test_that("shutdown_server() stops any server", {
  server <- local_server()
  expect_invisible(shutdown_server(server))
  process <- the_session$servers[[server$remote_base]]$process
  process$wait(10000)
  expect_identical(process$get_exit_status(), 0L)
})

test_that("a port that is taken is an error with the server's words", {
  skip_unless_all()
  server <- local_server()
  port <- as.integer(sub(".*:", "", server$remote_base))
  error <- expect_error(gym_server_start(port = port), class = "gym_error_server_start")
  expect_match(conditionMessage(error), as.character(port))
  expect_type(env_list_all(server), "list")
})

test_that("a Python that cannot run the server is named, with the hint", {
  error <- expect_error(
    gym_server_start(python = "/no/such/python"), class = "gym_error_server_start"
  )
  expect_match(conditionMessage(error), "/no/such/python", fixed = TRUE)
  expect_match(conditionMessage(error), "gym::gym_server_install()", fixed = TRUE)
})

test_that("the first Python that can run the server is taken", {
  skip_unless_all()
  skip_on_os("windows")
  working <- working_python()
  folder <- withr::local_tempdir()
  # One that has none of the packages, as a system's own may be.
  bare <- file.path(folder, "bare", "python3")
  dir.create(dirname(bare))
  writeLines(
    c("#!/bin/sh", "echo \"gym_server cannot run on this Python: No module named 'flask'\" >&2",
      "exit 78"), bare
  )
  Sys.chmod(bare, "755")
  # One that only says how to get another, as on macOS.
  stub <- file.path(folder, "stub", "python3")
  dir.create(dirname(stub))
  writeLines(c("#!/bin/sh", "echo 'xcode-select: note: No developer tools' >&2", "exit 1"), stub)
  Sys.chmod(stub, "755")
  good <- file.path(folder, "good", "python3")
  dir.create(dirname(good))
  writeLines(c("#!/bin/sh", paste0("exec ", shQuote(working), " \"$@\"")), good)
  Sys.chmod(good, "755")
  withr::local_envvar(
    GYM_PYTHON = NA, VIRTUAL_ENV = NA, CONDA_PREFIX = NA,
    PATH = paste(c(dirname(c(bare, stub, good)), Sys.getenv("PATH")), collapse = ":")
  )
  server <- gym_server_start()
  withr::defer(gym_server_stop(server))
  expect_identical(the_session$servers[[server$remote_base]]$python, good)

  withr::local_envvar(PATH = dirname(bare))
  error <- expect_error(gym_server_start(), class = "gym_error_server_start")
  expect_match(error$refusals[[bare]], "No module named 'flask'", fixed = TRUE)
})

test_that("a file in the working directory takes no Python module's place", {
  skip_if_no_server()
  withr::local_dir(withr::local_tempdir())
  writeLines("raise RuntimeError", "random.py")
  expect_type(env_list_all(local_server()), "list")
})

test_that("a server stops in order while a forked child lives", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  child <- parallel::mcparallel(Sys.sleep(30))
  withr::defer({
    tools::pskill(child$pid, tools::SIGKILL)
    suppressWarnings(parallel::mccollect(child))
  })
  gym_server_stop(server)
  expect_identical(the_session$servers[[server$remote_base]]$process$get_exit_status(), 0L)
})

test_that("the end of a forked child is not the session's", {
  skip_on_os("windows")
  server <- local_server()
  parallel::mclapply(1:2, function(i) end_session(the_session), mc.cores = 2)
  expect_type(env_list_all(server), "list")
})

test_that("what cannot be a server of this session is refused with the reason", {
  expect_error(gym_server_start(port = 70000), "65535", class = "gym_error_argument")
  own <- the_session$client
  withr::defer(the_session$client <- own)
  the_session$client <- NULL
  expect_error(gym_server_stop(), "no server", class = "gym_error_argument")
  withr::local_envvar(GYM_SERVER_URL = "127.0.0.1:5000")
  expect_error(gym_client(), "GYM_SERVER_URL", class = "gym_error_argument")
})

test_that("options reach the server by name", {
  skip_unless_all()
  directory <- withr::local_tempdir()
  server <- local_server(monitor_dir = directory)
  env <- gym_make("CartPole-v1", client = server)
  env_monitor_start(server, env$instance_id, "runs")
  expect_true(file.exists(file.path(directory, "runs", "episodes.csv")))
  expect_error(gym_server_start(nonsense = 1), "nonsense", class = "gym_error_server_start")
  expect_error(gym_server_start(NULL, NULL, "x"), class = "gym_error_argument")
})

test_that("GYM_SERVER_URL names the session's server", {
  server <- local_server()
  withr::local_envvar(GYM_SERVER_URL = paste0(server$remote_base, "/"))
  expect_identical(gym_client()$remote_base, server$remote_base)
  withr::local_envvar(GYM_SERVER_URL = NA)
  expect_false(identical(gym_client()$remote_base, server$remote_base))
})

test_that("the session's server is started once, and anew when it died", {
  own <- test_client()
  expect_identical(gym_client(), own)
  the_session$servers[[own$remote_base]]$process$kill()
  expect_false(identical(gym_client()$remote_base, own$remote_base))
  expect_type(env_list_all(gym_client()), "list")
})

test_that("a server that another session started is not stopped here", {
  expect_error(
    gym_server_stop(create_GymClient("http://127.0.0.1:1")), "not started by this session",
    class = "gym_error_argument"
  )
})

test_that("the server ends with the R session and leaves no log, and ends when R is killed", {
  skip_unless_all()
  skip_on_os("windows")
  skip_if_no_server()
  for (ending in c("q('no')", "tools::pskill(Sys.getpid(), tools::SIGKILL)")) {
    script <- paste0(
      ".libPaths(", deparse1(.libPaths()), "); server <- gym::gym_server_start();",
      "cat(unlist(gym:::the_session$servers[[1]][c('pid', 'log')]), sep = '\\n'); ", ending
    )
    output <- processx::run(
      file.path(R.home("bin"), "Rscript"), c("-e", script), error_on_status = FALSE
    )
    said <- strsplit(output$stdout, "\n")[[1]]
    pid <- as.integer(said[[1]])
    for (i in 1:100) {
      if (!pid_runs(pid)) break
      Sys.sleep(0.1)
    }
    expect_false(pid_runs(pid))
    # R that is killed leaves its temporary folder.
    expect_identical(file.exists(said[[2]]), grepl("kill", ending))
    unlink(dirname(said[[2]]), recursive = TRUE)
  }
})

test_that("R that is killed while it starts a server or uses it leaves none behind", {
  skip_unless_all()
  skip_if_not(file.exists("/proc/self/environ"), "a system that tells a process's variables")
  skip_if_no_server()
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"),
    "env <- gym::gym_make('CartPole-v1')",
    "repeat gym::rollout(env, function(observation) 1L)"
  ))
  marked <- function(mark) {
    any(vapply(Sys.glob("/proc/[0-9]*/environ"), function(path) {
      bytes <- tryCatch(suppressWarnings(readBin(path, "raw", 1e5)), error = function(cnd) raw())
      grepl(mark, rawToChar(bytes[bytes > 0]), fixed = TRUE, useBytes = TRUE)
    }, NA))
  }
  for (moment in c(0.5, 1, 1.5, 3)) {
    mark <- random_key()
    session <- processx::process$new(
      file.path(R.home("bin"), "Rscript"), script, env = c("current", GYM_MARK = mark)
    )
    session$wait(moment * 1000)
    expect_true(marked(mark))
    tools::pskill(session$get_pid(), tools::SIGKILL)
    for (i in 1:100) {
      if (!marked(mark)) break
      Sys.sleep(0.1)
    }
    expect_false(marked(mark))
  }
})

test_that("the server does not get the library path that R made for itself", {
  skip_if_not(file.exists(file.path(R.home("etc"), "ldpaths")), "R that sets LD_LIBRARY_PATH")
  path_in_r <- function(path) {
    processx::run(
      file.path(R.home("bin"), "Rscript"),
      c("-e", "cat(gym:::own_library_path(), Sys.getenv('LD_LIBRARY_PATH'), sep = '\\n')"),
      env = c("current", LD_LIBRARY_PATH = path, R_LIBS = paste(.libPaths(), collapse = ":"))
    )$stdout
  }
  lines <- strsplit(path_in_r("/opt/a:/opt/b"), "\n")[[1]]
  expect_identical(lines[[1]], "/opt/a:/opt/b")
  expect_match(lines[[2]], ".+:/opt/a:/opt/b$")
  expect_identical(strsplit(path_in_r(""), "\n")[[1]][[1]], "")
})

test_that("a server that takes too long to start is killed, and the error says how to wait", {
  skip_if_no_server()
  expect_error(
    gym_server_start(timeout = 0.01), "within 0.01 seconds.*timeout = ",
    class = "gym_error_server_start"
  )
})

test_that("a session whose temporary folder was deleted starts a server", {
  skip_unless_all()
  skip_if_no_server()
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"),
    "library(gym)", "unlink(tempdir(), recursive = TRUE)",
    "server <- gym_server_start()", "cat(length(env_list_all(server)))"
  ))
  run <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", script), timeout = 60,
    error_on_status = FALSE
  )
  expect_identical(run[c("stdout", "stderr")], list(stdout = "0", stderr = ""))
})

test_that("with `users` each user has a server that ends with the session's", {
  skip_unless_all()
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  expect_no_message(server <- local_users_server(port = free_port()))
  expect_error(env_list_all(server), "is not this server", class = "gym_error_http_401")
  users <- lapply(user_tokens, function(token) create_GymClient(server$remote_base, token = token))
  pids <- vapply(users, function(user) get_request(user, "/v1/health/")$pid, 1L)
  env <- gym_make("CartPole-v1", client = users$anna)
  expect_length(env_list_all(users$ben), 0)
  expect_error(env_step(users$ben, env$instance_id, 0), class = "gym_error_http_400")
  # A user stops their own server only, and the next call starts another.
  shutdown_server(users$ben)
  expect_length(env_list_all(users$ben), 0)
  expect_length(env_list_all(users$anna), 1)
  gym_server_stop(server)
  expect_false(any(vapply(pids, pid_runs, NA)))
})

test_that("a users file that others can read, and a token besides, are refused with the fix", {
  skip_if_no_server()
  skip_on_os("windows")
  file <- withr::local_tempfile(lines = "anna token-of-anna-0123456789")
  Sys.chmod(file, "644")
  expect_error(gym_server_start(users = file), "chmod 600", class = "gym_error_server_start")
  expect_error(gym_server_start(users = 1), class = "gym_error_argument")
  expect_error(gym_server_start(users = file, token = TRUE), "exclude",
               class = "gym_error_argument")
})
