test_that("a call inside another call disturbs neither", {
  skip_unless_all()
  server <- http_client(local_server())
  id <- env_create(server, "CartPole-v1", seed = 1)
  twin <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  env_reset(server, twin)
  # curl asks R for a call's body, and there R may run finalizers: here it does.
  line <- line_of(server)
  curl::handle_setopt(line$handle, readfunction = function(nbytes, ...) {
    if (line$sent == 0L) {
      thrown_away <- new.env()
      reg.finalizer(thrown_away, function(x) {
        env_close(server, env_create(server, "CartPole-v1"))
      })
      rm(thrown_away)
      gc()
    }
    body_reader(line)(nbytes)
  })
  other <- create_GymClient(server$remote_base)
  for (action in c(1, 0, 1)) {
    expect_identical(env_step(server, id, action), env_step(other, twin, action))
  }
  expect_setequal(names(env_list_all(server)), c(id, twin))
})

test_that("a call of one client inside another's disturbs neither", {
  skip_unless_all()
  server <- http_client(local_server())
  other <- create_GymClient(server$remote_base)
  id <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  line <- line_of(server)
  made <- NULL
  curl::handle_setopt(line$handle, readfunction = function(nbytes, ...) {
    if (line$sent == 0L) made <<- c(made, env_create(other, "CartPole-v1"))
    body_reader(line)(nbytes)
  })
  expect_equal(env_step(server, id, 1)$reward, 1)
  expect_equal(env_step(server, id, 0)$reward, 1)
  expect_setequal(names(env_list_all(other)), c(id, made))
  expect_length(made, 2)
})

# Runs a script that uses the package, and returns what it prints.
output_of_script <- function(...) {
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"),
    "library(gym)",
    "server <- gym_server_start()",
    ...
  ))
  processx::run(file.path(R.home("bin"), "Rscript"), script, timeout = 60)$stdout
}

test_that("no interrupt jumps out of libcurl", {
  skip_unless_all()
  skip_on_os("windows")
  skip_if_no_server()
  # Curl asks R for the body. Then an interrupt is on its way, and it is taken at the next garbage
  # collection, which is made to come at one allocation after another: some are curl's own.
  output <- output_of_script(
    "server <- create_GymClient(server$remote_base, config = httr::add_headers(a = 'b'))",
    "id <- env_create(server, 'CartPole-v1')",
    "invisible(env_reset(server, id))",
    "line <- gym:::line_of(server)",
    "interrupted <- works <- 0",
    "for (wait in 1:60) {",
    "  curl::handle_setopt(line$handle, readfunction = function(nbytes, ...) {",
    "    body <- gym:::body_reader(line)(nbytes)",
    "    gctorture2(1e6L, wait)",
    "    tools::pskill(Sys.getpid(), tools::SIGINT)",
    "    body",
    "  })",
    "  tryCatch({",
    "    env_step(server, id, 1)",
    "    Sys.sleep(0.5)",
    "  }, interrupt = function(cnd) interrupted <<- interrupted + 1)",
    "  gctorture2(0L)",
    "  curl::handle_setopt(line$handle, readfunction = gym:::body_reader(line))",
    "  other <- create_GymClient(server$remote_base)",
    "  reset <- post_request(other, paste0('/v1/envs/', id, '/reset/'))$observation",
    "  works <- works + (length(reset) == 4 && env_step(server, id, 1)$reward == 1)",
    "}",
    "cat(interrupted, works)"
  )
  expect_identical(output, "60 60")
})

test_that("interrupts at any moment leave a client that works", {
  skip_unless_all()
  skip_on_os("windows")
  skip_if_no_server()
  # R itself does not stand interrupts while it loads a package, or a function of one at its first
  # use: here all are loaded beforehand.
  output <- output_of_script(
    "invisible(env_list_all(server))",
    "for (package in loadedNamespaces()) as.list(asNamespace(package), all.names = TRUE)",
    "interrupts <- 0",
    "suspendInterrupts({",
    "  storm <- processx::process$new('sh', c('-c', paste(",
    "    'for i in $(seq 100); do kill -INT', Sys.getpid(), '; sleep 0.02; done')))",
    "  while (storm$is_alive()) {",
    "    tryCatch(allowInterrupts({",
    "      client <- create_GymClient(server$remote_base)",
    "      id <- env_create(client, 'CartPole-v1')",
    "      env_reset(client, id)",
    "      env_close(client, id)",
    "    }), interrupt = function(cnd) interrupts <<- interrupts + 1)",
    "  }",
    "  tryCatch(allowInterrupts(Sys.sleep(0.1)), interrupt = identity)",
    "})",
    "id <- env_create(client, 'CartPole-v1')",
    "cat(interrupts > 10, length(env_reset(client, id)), env_step(client, id, 1)$reward)"
  )
  expect_identical(output, "TRUE 4 1")
})

test_that("a large body arrives, one that is too large is an error", {
  skip_unless_all()
  env <- local_env()
  # CartPole looks at two of its options and lets the others be.
  expect_length(env$reset(options = list(x = as.numeric(1:1e5))), 4)
  expect_error(env$reset(options = list(x = strrep("x", 17 * 2^20))), class = "gym_error_http_413")
  expect_length(env$reset(), 4)
})

test_that("a proxy of the system's is not asked for a server on this machine", {
  test_client()
  withr::local_envvar(http_proxy = "http://127.0.0.1:9", no_proxy = "")
  client <- create_GymClient(test_client()$remote_base)
  expect_type(env_list_all(client), "list")
})
