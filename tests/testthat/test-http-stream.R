# The stream of an environment, `NULL` if its steps go by HTTP.
connection_of <- function(env) env$.__enclos_env__$private$instance$stream$con

# Other tests of this process may have left as many as there may be.
drop_streams(function(stream) TRUE)

test_that("a stream says what HTTP says, of every kind of space", {
  for (id in c("CartPole-v1", "Pendulum-v1", "FrozenLake-v1", "Blackjack-v1", "Taxi-v4")) {
    for (n in list(NULL, 3)) {
      ways <- lapply(list(test_client(), http_client()), function(client) {
        local_env(id, num_envs = n, seed = 1, client = client, frame = parent.frame(4),
                  vectorization_mode = if (length(n)) "sync")
      })
      resets <- lapply(ways, function(env) env$reset(return_info = TRUE))
      expect_identical(resets[[1]], resets[[2]], info = id)
      for (step in 1:3) {
        action <- space_sample(ways[[1]]$action_space)
        # Some episodes end before.
        steps <- suppressWarnings(lapply(ways, function(env) env$step(action)))
        expect_identical(steps[[1]], steps[[2]], info = id)
      }
      classic <- suppressWarnings(
        lapply(ways, function(env) env_step(env$client, env$instance_id, action))
      )
      expect_identical(classic[[1]], classic[[2]], info = id)
      expect_false(is.null(connection_of(ways[[1]])))
      expect_null(connection_of(ways[[2]]))
    }
  }
})

test_that("frames of any size are read: of 1,142 sub-environments as float64, of more as float32", {
  for (n in c(1142, 1143)) {
    ways <- lapply(list(test_client(), http_client()), function(client) {
      local_env("CartPole-v1", num_envs = n, seed = 1, client = client, frame = parent.frame(3))
    })
    expect_identical(ways[[1]]$reset(), ways[[2]]$reset())
    steps <- lapply(ways, function(env) env$step(rep_len(0:1, n)))
    expect_identical(steps[[1]], steps[[2]])
    layout <- ways[[1]]$.__enclos_env__$private$instance$stream$layout$step
    expect_identical(layout$observation$dtype, if (n == 1142) "F64" else "F32")
    expect_false(is.null(connection_of(ways[[1]])))
  }
})

test_that("actions that are unusual are checked and sent by the stream", {
  env <- local_env(seed = 1)
  env$reset()
  expect_error(env$step("jump"), class = "gym_error_space")
  error <- expect_error(env$step(2), "not in Discrete", class = "gym_error_space")
  expect_identical(error$code, "action_not_in_space")
  expect_named(env$step("push left")$observation)
  expect_false(is.null(connection_of(env)))
})

test_that("a stream that broke between two steps is opened anew", {
  env <- local_env(seed = 1)
  twin <- local_env(seed = 1, client = http_client())
  for (each in list(env, twin)) each$reset()
  before <- connection_of(env)
  close(before)
  # The number of the connection is another's now.
  file <- file(withr::local_tempfile(), "w+b")
  expect_identical(as.integer(file), as.integer(before))
  expect_identical(env$step(1), twin$step(1))
  expect_identical(seek(file), 0)
  closeAllConnections()
  expect_identical(env$step(0), twin$step(0))
  expect_false(is.null(connection_of(env)))
})

test_that("an environment whose stream another client took over goes on by HTTP", {
  env <- local_env(seed = 1)
  env$reset()
  again <- create_GymClient(env$client$remote_base, token = token_of(env$client))
  expect_length(env_step(again, env$instance_id, 1)$observation, 4)
  for (i in 1:2) expect_length(env$step(0)$observation, 4)
  expect_null(connection_of(env))
  expect_length(env_step(again, env$instance_id, 1)$observation, 4)
})

test_that("a session has 32 streams, and those that it does not use make room for others", {
  skip_unless_all()
  client <- test_client()
  envs <- lapply(1:34, function(i) local_env(seed = i, client = client, frame = parent.frame(2)))
  observed <- lapply(envs, function(env) env$reset())
  expect_lte(sum(lengths(lapply(envs, connection_of)) > 0), 32)
  for (env in envs) expect_length(env$step(1)$observation, 4)
  the_session$messages <- the_session$messages + 2000
  envs[[34]]$step(1)
  expect_false(is.null(connection_of(envs[[34]])))
})

test_that("an environment that is collected takes its stream along, without a warning", {
  client <- test_client()
  opened <- function() nrow(showConnections())
  before <- opened()
  local({
    env <- gym_make("CartPole-v1", client = client)
    env$reset()
  })
  expect_identical(opened(), before + 1L)
  expect_no_warning({
    gc()
    invisible(gc())
  })
  close_queued(client)
  expect_identical(opened(), before)
})

test_that("a forked process and a copy from a file open streams of their own", {
  skip_on_os("windows")
  env <- local_env(seed = 1)
  env$reset()
  there <- parallel::mclapply(1, function(i) list(env$step(1)$reward, connection_of(env)))[[1]]
  expect_identical(there[[1]], 1)
  expect_length(env$step(1)$observation, 4)
})

test_that("an interrupt of a step closes the stream, and the next step is the next", {
  skip_unless_all()
  skip_on_os("windows")
  server <- odd_server()
  env <- make_odd("Slow", server)
  env$reset()
  before <- connection_of(env)
  interrupted <- tryCatch(
    {
      tools::pskill(Sys.getpid(), tools::SIGINT)
      env$step(1)
    },
    interrupt = function(cnd) "interrupted"
  )
  expect_identical(interrupted, "interrupted")
  expect_type(env$step(1), "list")
})

test_that("a client says which way its steps go", {
  said <- function(...) utils::capture.output(print(create_GymClient(...)))[[2]]
  expect_match(said("http://127.0.0.1:5000"), "by a stream")
  expect_match(said("https://gym.example.org"), "by HTTP: https")
  expect_match(said("http://127.0.0.1:5000", timeout = 0.5), "by HTTP: a timeout")
  withr::local_envvar(http_proxy = "http://proxy.example.org")
  expect_match(said("http://gym.example.org"), "by HTTP: a proxy")
  expect_match(said("http://127.0.0.1:5000", config = httr::user_agent("me")), "by HTTP: settings")
})
