test_that("a client prints its address", {
  expect_output(
    print(create_GymClient("http://127.0.0.1:5000")), "<GymClient: http://127.0.0.1:5000>",
    fixed = TRUE
  )
})

test_that("a slash at the end of the address changes nothing", {
  expect_identical(create_GymClient("http://127.0.0.1:5000/")$remote_base, "http://127.0.0.1:5000")
})

test_that("what is no address is refused and named", {
  expect_error(create_GymClient("127.0.0.1:5000"), "127.0.0.1:5000", class = "gym_error_argument")
  expect_error(create_GymClient(5000), "5000", class = "gym_error_argument")
  expect_error(create_GymClient("http://a", timeout = 0), "timeout", class = "gym_error_argument")
  expect_error(create_GymClient("http://a", config = list()), "config",
               class = "gym_error_argument")
})

test_that("what is no client is refused", {
  expect_error(env_list_all("http://127.0.0.1:5000"), "client", class = "gym_error_argument")
})

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

test_that("an answer that does not come within the timeout is an error", {
  skip_unless_all()
  server <- odd_server()
  patient <- make_odd("Slow", server)
  patient$reset()
  hasty <- create_GymClient(server$remote_base, timeout = 0.3)
  expect_error(env_step(hasty, patient$instance_id, 1), "[Tt]ime", class = "gym_error_connection")
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

test_that("a timeout of httr's goes before the client's, after a repeat too", {
  skip_unless_all()
  server <- local_server()
  client <- local_cut_client(server, "answered", "GET /v1/envs/ ")
  client$config <- httr::timeout(3)
  expect_identical(timeout_of(client), 3)
  expect_type(env_list_all(client), "list")
  expect_identical(timeout_of(server), 60)
})

test_that("what cannot be a query or a body is refused by name before it is sent", {
  client <- create_GymClient("http://127.0.0.1:1")
  refused <- function(data, text, request = get_request) {
    cnd <- expect_error(request(client, "/v1/registry/", data), class = "gym_error_argument")
    expect_match(conditionMessage(cnd), text, fixed = TRUE)
  }
  refused(list(search = c("a", "b")), "`data$search` must be one value, not c(\"a\", \"b\")")
  refused(list(search = NULL), "`data$search` must be one value, not NULL")
  refused(list(search = NA), "`data$search` must be one value, not NA")
  refused(list(search = list(1)), "`data$search` must be one value, not a list of length 1")
  for (request in list(get_request, post_request)) {
    refused(list("a"), "`data` must be a list with names", request)
    refused(3, "`data` must be a list with names", request)
    refused(list(a = 1, a = 2), "`data` has `a` more than once", request)
  }
})

# Steps and resets by HTTP.
messages_to <- function(id) paste0("POST /v1/envs/", id, "/stream/")

test_that("a step whose answer was lost is not taken twice", {
  server <- local_server()
  id <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  client <- local_cut_client(server, "answered", messages_to(id))
  first <- env_step(client, id, 1)
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)

  twin <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, twin)
  expect_identical(first, env_step(server, twin, 1))
  expect_identical(env_step(client, id, 0), env_step(server, twin, 0))
})

test_that("creating is not done twice, nor is closing", {
  skip_unless_all()
  server <- local_server()
  client <- local_cut_client(server, "answered", "POST /v1/envs/ ")
  id <- env_create(client, "CartPole-v1")
  expect_named(env_list_all(server), id)
  client <- local_cut_client(server, "answered", "/close")
  expect_error(env_close(client, id), NA)
  expect_length(env_list_all(server), 0)
})

test_that("a call that was cut before it was sent is made", {
  skip_unless_all()
  server <- local_server()
  id <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  client <- local_cut_client(server, "unsent", messages_to(id), times = 2)
  expect_equal(env_step(client, id, 1)$reward, 1)
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)
})

test_that("a connection that breaks each time is an error in the end", {
  skip_unless_all()
  server <- local_server()
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, "answered", messages_to(id), times = 100)
  expect_error(env_step(client, id, 1), class = "gym_error_connection")
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)
})

test_that("a call without a number is not repeated", {
  skip_unless_all()
  server <- local_server()
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, "answered", "/step")
  expect_error(
    post_request(client, paste0("/v1/envs/", id, "/step/"), list(action = 1)),
    class = "gym_error_connection"
  )
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)
})

test_that("a client survives saveRDS() and makes calls of its own", {
  client <- test_client()
  id <- env_create(client, "CartPole-v1", seed = 3)
  withr::defer(env_close(client, id))
  file <- withr::local_tempfile()
  saveRDS(client, file)
  copies <- list(readRDS(file), readRDS(file))
  expect_length(env_reset(copies[[1]], id), 4)
  expect_equal(env_step(copies[[2]], id, 1)$reward, 1)
  expect_equal(env_step(client, id, 0)$reward, 1)
  # Of one process all have one key, and no number of it twice.
  keys <- lapply(c(list(client), copies), function(copy) copy$state$keys)
  expect_identical(keys[[2]], keys[[1]])
  expect_identical(keys[[3]], keys[[1]])
})

test_that("a script may make a client for each call", {
  skip_unless_all()
  base <- test_client()$remote_base
  id <- env_create(create_GymClient(base), "CartPole-v1", seed = 3)
  # More than R has connections.
  for (i in 1:150) env_reset(create_GymClient(base), id)
  expect_equal(env_step(create_GymClient(base), id, 1)$reward, 1)
  expect_silent(env_close(create_GymClient(base), id))
})

test_that("a client works in forked workers", {
  skip_on_os("windows")
  client <- test_client()
  env_list_all(client)
  key <- function(...) client_state(client)$keys$key
  keys <- c(key(), unlist(parallel::mclapply(1:2, key, mc.cores = 2)))
  expect_length(unique(keys), 3)
  answers <- parallel::mclapply(1:4, function(seed) {
    env <- gym_make("CartPole-v1", seed = seed, client = client)
    on.exit(env$close())
    observation <- env$reset()
    for (i in 1:5) observation <- env$step(i %% 2)$observation
    observation
  }, mc.cores = 4)
  alone <- lapply(1:4, function(seed) {
    env <- gym_make("CartPole-v1", seed = seed, client = client)
    on.exit(env$close())
    observation <- env$reset()
    for (i in 1:5) observation <- env$step(i %% 2)$observation
    observation
  })
  expect_identical(answers, alone)
})

test_that("a client works in spawned workers", {
  skip_unless_all()
  client <- test_client()
  cluster <- parallel::makePSOCKcluster(1)
  withr::defer(parallel::stopCluster(cluster))
  library_paths <- .libPaths()
  answer <- parallel::clusterCall(cluster, function(client, library_paths) {
    .libPaths(library_paths)
    env <- gym::gym_make("CartPole-v1", seed = 1, client = client)
    on.exit(env$close())
    env$reset()
  }, client, library_paths)
  env <- local_env(seed = 1)
  expect_identical(answer[[1]], env$reset())
})

test_that("a forked worker closes nothing of its parent's", {
  skip_unless_all()
  skip_on_os("windows")
  client <- test_client()
  env <- gym_make("CartPole-v1", client = client)
  env$reset()
  parallel::mclapply(1:2, function(i) {
    gym_make("CartPole-v1", client = client)$close()
    env <<- NULL
    gc()
    gym_make("CartPole-v1", client = client)$close()
  }, mc.cores = 2)
  expect_equal(env$step(1)$reward, 1)
  env$close()
})

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

test_that("what is no answer of a Gym server is an error with a class", {
  read <- function(status, body) {
    parse_server_error_or_raise_for_status(structure(
      list(status_code = status, content = charToRaw(body), url = "http://127.0.0.1:1/",
           type = "text/html", request = list(method = "GET")),
      class = "response"
    ))
  }
  expect_error(read(200, "<html>"), class = "gym_error_connection")
  expect_error(read(200, "\"oops\""), class = "gym_error_connection")
  expect_error(read(302, ""), class = "gym_error_connection")
  expect_error(read(520, "\"oops\""), class = "gym_error_http_520")
})

test_that("another kind of server is distinguished from a Gym server", {
  python <- working_python()
  folder <- withr::local_tempdir()
  dir.create(file.path(folder, "v1", "envs"), recursive = TRUE)
  writeLines("<html>", file.path(folder, "v1", "envs", "index.html"))
  log <- file.path(folder, "log")
  process <- processx::process$new(
    python, c("-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", folder),
    stdout = log, stderr = NULL
  )
  withr::defer(process$kill())
  while (process$is_alive() && !length(readLines(log))) Sys.sleep(0.05)
  client <- create_GymClient(sub(".*(http://[0-9.:]+).*", "\\1", readLines(log)[[1]]))
  expect_error(env_list_all(client), "not come from a Gym server", class = "gym_error_connection")
  expect_error(env_create(client, "CartPole-v1"), class = "gym_error_http_501")
})

test_that("a large body arrives, one that is too large is an error", {
  skip_unless_all()
  env <- local_env()
  # CartPole looks at two of its options and lets the others be.
  expect_length(env$reset(options = list(x = as.numeric(1:1e5))), 4)
  expect_error(env$reset(options = list(x = strrep("x", 17 * 2^20))), class = "gym_error_http_413")
  expect_length(env$reset(), 4)
})

test_that("classic requests go to any route", {
  client <- test_client()
  expect_equal(get_request(client, "/v1/health/")$status, "ok")
  id <- post_request(client, "/v1/envs/", list(env_id = "CartPole-v1"))$instance_id
  expect_match(id, "^[0-9a-f]{8}$")
  expect_null(post_request(client, paste0("/v1/envs/", id, "/close/")))
})

test_that("an answer of httr's is read or raised", {
  skip_unless_all()
  base <- local_server(token = FALSE)$remote_base
  answer <- parse_server_error_or_raise_for_status(httr::GET(paste0(base, "/v1/health/")))
  expect_equal(answer$status, "ok")
  expect_error(
    parse_server_error_or_raise_for_status(httr::GET(paste0(base, "/v1/envs/nobody/"))),
    "Instance_id nobody unknown",
    class = "gym_error_http_400"
  )
})

test_that("settings made with httr are sent", {
  client <- create_GymClient(
    test_client()$remote_base, config = c(httr::add_headers("X-Test" = "1"), httr::timeout(5))
  )
  expect_length(env_reset(client, env_create(client, "CartPole-v1")), 4)
})

test_that("a proxy of the system's is not asked for a server on this machine", {
  test_client()
  withr::local_envvar(http_proxy = "http://127.0.0.1:9", no_proxy = "")
  client <- create_GymClient(test_client()$remote_base)
  expect_type(env_list_all(client), "list")
})

test_that("calls leave R's generator alone", {
  env <- local_env()
  set.seed(1)
  before <- .Random.seed
  env$reset()
  env$step(1)
  env_action_space_sample(env$client, env$instance_id)
  expect_identical(.Random.seed, before)
})

test_that("httr's set_config() holds for clients, too, and their own settings take precedence", {
  made_before <- create_GymClient("http://a")
  withr::local_options(httr_config = httr::config(cainfo = "group.pem", proxy = "a.example.org"))
  expect_identical(client_config(made_before)$options$cainfo, "group.pem")
  own <- create_GymClient("http://a", config = httr::config(cainfo = "own.pem"))
  expect_identical(client_config(own)$options$cainfo, "own.pem")
  expect_identical(client_config(own)$options$proxy, "a.example.org")
  expect_s3_class(client_config(own), "request")
  withr::local_envvar(GYM_SERVER_URL = "http://a")
  expect_identical(client_config(gym_client())$options$cainfo, "group.pem")
  options(httr_config = NULL)
  expect_null(client_config(gym_client())$options$cainfo)
})

test_that("a connection follows httr's set_config() and reset_config()", {
  client <- create_GymClient(test_client()$remote_base)
  expect_type(env_list_all(client), "list")
  withr::local_options(httr_config = httr::add_headers(Origin = "https://evil.example"))
  expect_error(env_list_all(client), class = "gym_error_http_403")
  options(httr_config = NULL)
  expect_type(env_list_all(client), "list")
})

test_that("a server of this machine is not looked for by the session's proxy", {
  address <- test_client()$remote_base
  # Nothing listens at port 1.
  no_proxy <- httr::use_proxy("127.0.0.1", 1)
  withr::local_options(httr_config = no_proxy)
  client <- create_GymClient(address)
  expect_type(env_list_all(client), "list")
  expect_identical(client_config(create_GymClient("http://a"))$options$proxyport, 1)
  through <- create_GymClient(address, config = no_proxy)
  expect_error(env_list_all(through), class = "gym_error_connection")
})

test_that("a hint that ends with a command can be copied whole", {
  expect_identical(sentence("in a terminal: \"python\" -m pip install \"gymnasium[box2d]\""),
                   "In a terminal: \"python\" -m pip install \"gymnasium[box2d]\"")
  expect_identical(sentence("did you mean this"), "Did you mean this.")
})
