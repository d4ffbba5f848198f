test_that("a timeout of httr's goes before the client's, after a repeat too", {
  skip_unless_all()
  server <- local_server()
  client <- local_cut_client(server, "answered", "GET /v1/envs/ ")
  client$config <- httr::timeout(3)
  expect_identical(timeout_of(client), 3)
  expect_type(env_list_all(client), "list")
  expect_identical(timeout_of(server), 60)
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

test_that("settings made with httr are sent", {
  client <- create_GymClient(
    test_client()$remote_base, config = c(httr::add_headers("X-Test" = "1"), httr::timeout(5))
  )
  expect_length(env_reset(client, env_create(client, "CartPole-v1")), 4)
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

# Everything that an error, a message or an object shows in any way.
shown <- function(x) {
  file <- tempfile()
  on.exit(unlink(file))
  dput(x, file)
  kept <- if (inherits(x, "condition")) {
    c(conditionMessage(x), deparse(conditionCall(x)), format(x$trace),
      unlist(lapply(x$trace$call, deparse)), if (!is.null(x$parent)) shown(x$parent))
  }
  paste(c(
    utils::capture.output(print(x)), utils::capture.output(utils::str(x)),
    format(x), deparse(x), readLines(file), kept
  ), collapse = "\n")
}

expect_hidden <- function(x) {
  expect_false(grepl(token_text, shown(x), fixed = TRUE), info = shown(x))
}

test_that("a server that asks for a token gets it from the client that was returned", {
  server <- local_locked_server()
  env <- local_env(client = server)
  expect_length(env$reset(), 4)
  expect_true(env$step(1)$reward == 1)
  expect_identical(get_request(server, "/v1/health/")$status, "ok")
})

test_that("the session's server is this session's alone", {
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  client <- test_client()
  token <- client$token()
  expect_gte(nchar(token), 32)
  for (other in list(NULL, token_text)) {
    stranger <- create_GymClient(client$remote_base, token = other)
    expect_error(env_list_all(stranger), class = "gym_error_http_401")
    expect_error(env_create(stranger, "CartPole-v1"), class = "gym_error_http_401")
    expect_error(shutdown_server(stranger), class = "gym_error_http_401")
  }
  # Within the session nobody needs to know.
  expect_type(env_list_all(create_GymClient(paste0(client$remote_base, "/"))), "list")
  withr::local_envvar(GYM_SERVER_URL = client$remote_base)
  expect_type(env_list_all(gym_client()), "list")
  seen <- c(capture.output(client, the_session$servers), gym_server_log(client))
  expect_false(any(grepl(token, seen, fixed = TRUE)))
  command_line <- file.path("/proc", the_session$servers[[client$remote_base]]$pid, "cmdline")
  skip_if_not(file.exists(command_line))
  command_line <- readBin(command_line, "raw", 1e5)
  expect_length(grepRaw(token, command_line, fixed = TRUE), 0)
})

test_that("each server has another token, which is not drawn from R's generator", {
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  set.seed(1)
  before <- .Random.seed
  expect_silent(server <- local_server())
  expect_identical(.Random.seed, before)
  expect_false(identical(server$token(), test_client()$token()))
})

test_that("a server on a port that was asked for is open, and says so", {
  skip_unless_all()
  skip_if_no_server()
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  is_open <- function(server) {
    tryCatch(
      is.list(env_list_all(create_GymClient(server$remote_base, token = NULL))),
      gym_error_http_401 = function(cnd) FALSE
    )
  }
  expect_message(server <- local_server(port = free_port()), class = "gym_message_open_server")
  expect_true(is_open(server))
  expect_silent(server <- local_server(port = free_port(), token = TRUE))
  expect_false(is_open(server))
  error <- expect_error(gym_server_start(token = "correct-horse-battery-staple"),
                        class = "gym_error_argument")
  expect_match(conditionMessage(error), "token_file")
  expect_hidden(error)
})

test_that("without it, or with another, the error is a 401 that says what helps", {
  server <- local_locked_server()
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  for (token in list(NULL, "", "another-token-altogether")) {
    stranger <- create_GymClient(server$remote_base, token = token)
    error <- expect_error(env_list_all(stranger), class = "gym_error_http_401")
    expect_identical(error$code, "unauthorized")
    expect_match(conditionMessage(error), "create_GymClient(token = )", fixed = TRUE)
    expect_match(conditionMessage(error), "GYM_SERVER_TOKEN")
  }
  expect_error(shutdown_server(stranger), class = "gym_error_http_401")
  friend <- create_GymClient(server$remote_base, token = token_text)
  expect_length(env_list_all(friend), 0)
})

test_that("the variable is the token of every client", {
  server <- local_locked_server()
  # As if another session had started it.
  local_session(servers = list())
  withr::local_envvar(GYM_SERVER_TOKEN = token_text, GYM_SERVER_URL = server$remote_base)
  expect_length(env_list_all(create_GymClient(server$remote_base)), 0)
  expect_length(env_list_all(gym_client()), 0)
  expect_error(env_list_all(create_GymClient(server$remote_base, token = NULL)),
               class = "gym_error_http_401")
  Sys.setenv(GYM_SERVER_TOKEN = "another-token-altogether")
  expect_error(env_list_all(gym_client()), class = "gym_error_http_401")
})

test_that("a server that is started sees the variable, and its client has it", {
  skip_unless_all()
  withr::local_envvar(GYM_SERVER_TOKEN = token_text)
  server <- local_server()
  expect_length(env_list_all(server), 0)
  expect_error(env_list_all(create_GymClient(server$remote_base, token = NULL)),
               class = "gym_error_http_401")
  open <- local_server(no_auth = TRUE)
  expect_length(env_list_all(create_GymClient(open$remote_base, token = NULL)), 0)
})

test_that("a client never shows its token", {
  client <- create_GymClient("http://gym.example.org", token = token_text)
  expect_hidden(client)
  expect_hidden(client$token)
  expect_hidden(unclass(client))
  expect_hidden(list(a = client))
  expect_output(print(client), "<GymClient: http://gym.example.org>", fixed = TRUE)
  # It goes where the client goes.
  file <- withr::local_tempfile()
  saveRDS(client, file)
  expect_identical(readRDS(file)$token(), token_text)
})

test_that("the report of how things stand does not show the token", {
  skip_unless_all()
  withr::local_envvar(
    GYM_SERVER_TOKEN = token_text, GYM_SERVER_URL = paste0("http://127.0.0.1:", free_port())
  )
  text <- paste(capture.output(expect_hidden(gym_sitrep())), collapse = "\n")
  expect_match(text, "GYM_SERVER_TOKEN=<token>", fixed = TRUE)
  expect_false(grepl(token_text, text, fixed = TRUE))
})

test_that("no error shows the token, also where the call was written with it", {
  skip_unless_all()
  server <- local_locked_server()
  errors <- list(
    tryCatch(create_GymClient("nowhere", token = "correct-horse-battery-staple"),
             error = identity),
    tryCatch(create_GymClient("http://a", timeout = 0, token = "correct-horse-battery-staple"),
             error = identity),
    tryCatch(create_GymClient("http://a", token = "correct-horse-battery-staple x"),
             error = identity),
    tryCatch(create_GymClient("http://a", token = c("correct-horse-battery-staple", "b")),
             error = identity),
    tryCatch(env_list_all(create_GymClient(paste0("http://127.0.0.1:", free_port()),
                                           token = "correct-horse-battery-staple")),
             error = identity),
    tryCatch(env_create(create_GymClient(server$remote_base,
                                         token = "correct-horse-battery-staple"), "bad string"),
             error = identity),
    tryCatch(env_list_all(create_GymClient(server$remote_base,
                                           token = "not-correct-horse-battery-staple")),
             error = identity)
  )
  for (error in errors) {
    expect_s3_class(error, "gym_error")
    expect_hidden(error)
  }
})

test_that("what cannot stand in a header is no token", {
  for (token in list("a b", "a\nX-Header: b", "\u00e4\u00f6", 5, NA_character_, c("a", "b"))) {
    error <- expect_error(create_GymClient("http://a", token = token),
                          class = "gym_error_argument")
    expect_identical(error$argument, "token")
  }
})

test_that("the server's log does not show the token", {
  skip_unless_all()
  server <- local_locked_server()
  env <- local_env(client = server)
  env$reset()
  try(env_create(server, "bad string"), silent = TRUE)
  stranger <- create_GymClient(server$remote_base, token = paste0(token_text, "x"))
  try(env_list_all(stranger), silent = TRUE)
  log <- gym_server_log(server)
  expect_true(any(grepl("without a token", log)))
  expect_false(any(grepl(token_text, log, fixed = TRUE)))
})

test_that("a token that is none ends the start, and is not shown", {
  skip_unless_all()
  skip_if_no_server()
  file <- local_token_file("short-token")
  error <- expect_error(gym_server_start(token_file = file), class = "gym_error_server_start")
  expect_match(conditionMessage(error), "16 to 1,024")
  expect_false(grepl("short-token", conditionMessage(error)))
  expect_error(gym_server_start(token_file = "nowhere/token"), "cannot be read",
               class = "gym_error_server_start")
})

test_that("off this machine a token is needed, or the word that none is", {
  skip_if_no_server()
  withr::local_envvar(GYM_SERVER_TOKEN = NA)
  error <- expect_error(
    gym_server_start(host = "0.0.0.0", token = FALSE), class = "gym_error_server_start"
  )
  expect_match(conditionMessage(error), "--token-file")
})

test_that("a watch page is opened by a key of its own", {
  seen <- character()
  withr::local_options(gym.viewer = function(address) {
    seen <<- c(seen, address)
    curl::curl_fetch_memory(sub("?", "presence/?", address, fixed = TRUE))
  })
  server <- local_locked_server()
  env <- local_env(client = server)
  address <- env$watch()
  expect_match(address, "/watch/?key=", fixed = TRUE)
  expect_identical(seen, address)
  expect_false(grepl(token_text, address, fixed = TRUE))
  expect_identical(curl::curl_fetch_memory(address)$status_code, 200L)
  for (wrong in c(sub("[?].*", "", address), paste0(address, "x"))) {
    expect_identical(curl::curl_fetch_memory(wrong)$status_code, 401L)
  }
})

test_that("who is asked who listens is shown no token", {
  server <- local_locked_server()
  probe <- probe_server(server$remote_base, timeout = 5)
  expect_true(probe$listens && probe$is_gym)
  withr::local_envvar(GYM_SERVER_URL = "http://127.0.0.1:1", GYM_SERVER_TOKEN = NA)
  expect_match(sitrep_server(server$remote_base, "server", NA)$finding, "environment")
})

test_that("calls without tokens are kept as they are", {
  local_session(hidden = token_text)
  call <- quote(f(x[1, ], "a", b = function(y, z = "correct-horse-battery-staple") NULL))
  expect_identical(
    without_tokens(call), quote(f(x[1, ], "a", b = function(y, z = "<token>") NULL))
  )
})
