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
