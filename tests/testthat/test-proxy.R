test_that("by nginx and TLS a client plays as it does without", {
  skip_if_no_nginx()
  proxy <- local_proxied_server()
  server <- proxy$server
  client <- proxy$client

  play <- function(client, ...) {
    env <- local_env(seed = 1, client = client, ...)
    first <- env$reset()
    action <- rep(1, env$num_envs %||% 1)
    list(first, env$step(action), env$step(action), if (is.null(env$num_envs)) env$render())
  }
  expect_identical(play(client), play(server))
  # Sub-environments travel as tensors, and 4,000 of them in more than one piece.
  expect_identical(play(client, num_envs = 4000), play(server, num_envs = 4000))

  # The name and the certificate, the token, pages from elsewhere.
  expect_error(env_list_all(create_GymClient(proxy$url, token = token_text)),
               class = "gym_error_connection")
  unsure <- httr::config(resolve = proxy$config$options$resolve)
  expect_error(env_list_all(create_GymClient(proxy$url, config = unsure, token = token_text)),
               "set_config", class = "gym_error_connection")
  withr::with_options(list(httr_config = proxy$config), {
    expect_length(env_list_all(create_GymClient(proxy$url, token = token_text)), 0)
  })
  expect_error(env_list_all(create_GymClient(proxy$url, config = proxy$config, token = NULL)),
               class = "gym_error_http_401")
  from <- function(origin) {
    config <- c(proxy$config, httr::add_headers(Origin = origin))
    create_GymClient(proxy$url, config = config, token = token_text)
  }
  expect_length(env_list_all(from(proxy$url)), 0)
  expect_error(env_list_all(from("https://evil.example")), class = "gym_error_http_403")

  log <- readLines(file.path(proxy$folder, "gym.log"))
  expect_true(any(grepl("POST /v1/envs/ 200", log, fixed = TRUE)))
  expect_false(any(grepl(token_text, log, fixed = TRUE)))
})

test_that("by nginx the watch page waits for what is new, and no log has its key", {
  skip_unless_all()
  skip_if_no_nginx()
  proxy <- local_proxied_server()
  server <- proxy$server
  client <- proxy$client
  withr::local_options(gym.viewer = FALSE)
  env <- local_env(client = client)
  env$reset(seed = 1)
  address <- env$watch()
  key <- sub(".*[?]key=", "", address)
  expect_identical(sub("[?].*", "", address),
                   paste0(proxy$url, "/v1/envs/", env$instance_id, "/watch/"))

  look <- function(path) {
    handle <- curl::new_handle(.list = proxy$config$options)
    answer <- curl::curl_fetch_memory(paste0(sub("[?].*", "", address), path), handle)
    expect_identical(answer$status_code, 200L)
    answer
  }
  expect_match(rawToChar(look(paste0("?key=", key))$content), "watch.js")
  expect_match(look("watch.js")$type, "javascript")
  seen <- from_json(rawToChar(look(paste0("state/?key=", key))$content))
  expect_gt(nchar(seen$frame), 1000)

  # A question that waits: answered when somebody has stepped, in another process.
  waiting <- step_soon(server, env$instance_id)
  later <- from_json(rawToChar(
    look(paste0("state/?sub_env=0&after=", seen$number, "&key=", key))$content
  ))
  expect_gt(later$number, seen$number)
  waiting$wait(10000)
  log <- readLines(file.path(proxy$folder, "gym.log"))
  expect_true(any(grepl("/watch/state/ 200", log, fixed = TRUE)))
  expect_false(any(grepl(key, c(log, gym_server_log(server)), fixed = TRUE)))
})

test_that("by nginx a stream is opened, which says its layout", {
  skip_unless_all()
  skip_if_no_nginx()
  proxy <- local_proxied_server()
  client <- proxy$client
  env <- local_env(client = client)

  handle <- curl::new_handle(
    url = paste0(proxy$url, "/v1/envs/", env$instance_id, "/stream/"), .list = proxy$config$options
  )
  curl::handle_setheaders(
    handle, Authorization = paste("Bearer", token_text), Connection = "Upgrade",
    Upgrade = "websocket", "Sec-WebSocket-Version" = "13",
    "Sec-WebSocket-Key" = "MDEyMzQ1Njc4OWFiY2RlZg=="
  )
  pool <- curl::new_pool()
  received <- raw()
  curl::multi_add(handle, data = function(bytes, ...) received <<- c(received, bytes), pool = pool)
  expect_true(wait_until(function() {
    curl::multi_run(timeout = 0, pool = pool)
    length(received) > 4
  }))
  expect_identical(curl::handle_data(handle)$status_code, 101L)
  # The head of a frame, and the layout as JSON.
  expect_match(rawToChar(received[-(1:4)]), '"action":', fixed = TRUE)
})

test_that("by nginx without keepalive two users play on servers of their own", {
  skip_unless_all()
  skip_if_no_nginx()
  server <- local_users_server(allow_host = "gym.example.org")
  proxy <- local_proxy(server, keepalive = FALSE)
  users <- lapply(user_tokens, function(token) {
    create_GymClient(proxy$url, config = proxy$config, token = token)
  })
  expect_identical(await_answer(users$anna)$status, "ok")
  envs <- lapply(users, function(user) gym_make("CartPole-v1", client = user))
  for (time in 1:5) {
    for (env in envs) env$reset(seed = 1)
  }
  expect_named(env_list_all(users$ben), envs$ben$instance_id)
})

test_that("the systemd unit is one that systemd takes", {
  skip_if(!nzchar(Sys.which("systemd-analyze")), "there is no systemd here")
  unit <- readLines(system.file("examples", "gym-server.service", package = "gym"))
  folder <- withr::local_tempdir()
  file <- file.path(folder, "gym-server.service")
  # systemd looks whether the program is there.
  writeLines(sub("/opt/gym/bin/gym-http-server", "/bin/true", unit, fixed = TRUE), file)
  found <- processx::run("systemd-analyze", c("verify", file), error_on_status = FALSE)
  expect_identical(found$status, 0L)
  expect_no_match(found$stderr, "gym-server.service")
  # A line that it does not know is only a warning: it must be seen by the test.
  writeLines(c(unit, "[Service]", "NoSuchThing=yes"), file)
  found <- processx::run("systemd-analyze", c("verify", file), error_on_status = FALSE)
  expect_match(found$stderr, "NoSuchThing")
})

test_that("the unit's options are the server's", {
  skip_if_no_server()
  unit <- paste(readLines(system.file("examples", "gym-server.service", package = "gym")),
                collapse = "\n")
  command <- sub(".*ExecStart=", "", sub("([^\\\\])\n.*", "\\1", sub(".*ExecStart=", "", unit)))
  options <- unique(regmatches(command, gregexpr("--[a-z-]+", command))[[1L]])
  expect_gt(length(options), 3)
  help <- run_quietly(working_python(), c("-m", "gym_server", "--help"),
                      env = server_environment())$stdout
  for (option in options) expect_match(help, option, fixed = TRUE)
})

test_that("a proxy whose server is gone is distinguished from one that is no Gym server", {
  skip_unless_all()
  skip_if_no_nginx()
  proxy <- local_proxied_server()
  server <- proxy$server
  client <- proxy$client
  expect_error(
    env_create(client, "CartPole-v1", kwargs = list(x = strrep("x", 17 * 2^20))), "the proxy",
    class = "gym_error_http_413"
  )
  gym_server_stop(server)
  expect_error(env_list(client), "behind it does not answer", class = "gym_error_http_502")
  withr::local_options(httr_config = proxy$config)
  found <- sitrep_server(proxy$url, "server", NA)
  expect_match(found$finding, "behind it does not answer")
})
