# What is open on a server, once it has had a moment.
open_after_a_while <- function(server) {
  for (i in 1:50) {
    left <- names(env_list_all(server))
    if (!length(left)) break
    Sys.sleep(0.1)
  }
  left
}

# Where closing hangs a session's end would take a client's timeout, a minute.
expect_quick_end <- function(run, begun) {
  expect_false(run$timeout)
  expect_lt(as.numeric(Sys.time(), units = "secs") - begun, 20)
}

test_that("what a session created on another's server is closed with it, classic ids too", {
  skip_unless_all()
  server <- local_server()
  kept <- env_create(server, "CartPole-v1")
  run <- run_session(
    server,
    "classic <- env_create(server, 'CartPole-v1')",
    "env <- gym_make('CartPole-v1', client = server)",
    "again <- create_GymClient(server$remote_base)",
    "envs <- gym_make('CartPole-v1', num_envs = 3, client = again)",
    "invisible(env$reset())",
    "cat(length(env_list_all(server)))"
  )
  expect_identical(run$stdout, "4")
  expect_named(env_list_all(server), kept)
})

test_that("a session ends at once whatever has become of the servers where it created something", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  pid <- the_session$servers[[server$remote_base]]$pid
  cases <- c(
    killed = sprintf("tools::pskill(%d, 9L)", pid),
    stopped = sprintf("tools::pskill(%d, tools::SIGSTOP)", pid)
  )
  for (what in rev(names(cases))) {
    run <- run_session(
      server,
      "ids <- replicate(20, env_create(server, 'CartPole-v1'))",
      cases[[what]],
      "cat(as.numeric(Sys.time()))"
    )
    expect_quick_end(run, as.numeric(run$stdout))
    tools::pskill(pid, tools::SIGCONT)
  }
})

test_that("a session ends at once with a server behind a broken connection, and its own stopped", {
  skip_unless_all()
  skip_on_os("windows")
  full <- create_GymClient(local_stalling("full"))
  run <- run_session(
    full,
    "gym:::remember_instance(server, 'abcdef01')",
    "own <- gym_server_start()",
    "pid <- gym:::the_session$servers[[1]]$pid",
    "tools::pskill(pid, tools::SIGSTOP)",
    "cat(as.numeric(Sys.time()), pid)"
  )
  words <- as.numeric(strsplit(run$stdout, " ")[[1]])
  expect_quick_end(run, words[[1]])
  for (i in 1:100) {
    if (!pid_runs(words[[2]])) break
    Sys.sleep(0.1)
  }
  expect_false(pid_runs(words[[2]]))
})

test_that("a forked child closes what it created, and nothing of its parent's", {
  skip_on_os("windows")
  server <- local_server()
  ours <- env_create(server, "CartPole-v1")
  # As on a server that is not the session's own, which would not be asked.
  local_session(servers = list())
  children <- parallel::mclapply(1:2, function(i) {
    env_create(server, "CartPole-v1")
    open <- length(env_list_all(server))
    end_session(the_session)
    open
  }, mc.cores = 2)
  expect_true(all(unlist(children) > 1L))
  expect_named(env_list_all(server), ours)
  close_session_instances(closing_time)
  expect_length(env_list_all(server), 0)
})

test_that("an object that was thrown away is closed when the server is next spoken to", {
  skip_unless_all()
  server <- local_server()
  kept <- gym_make("CartPole-v1", client = server)
  speak <- list(
    function() kept$reset(), function() env_list_all(server),
    function() env_close(server, env_create(server, "CartPole-v1"))
  )
  for (say in speak) {
    gym_make("CartPole-v1", client = server)
    gc()
    say()
    expect_named(get_answer(server, "/v1/envs/")$all_envs, kept$instance_id)
  }
})

test_that("an environment that was closed is not closed again", {
  skip_unless_all()
  server <- local_server()
  env <- gym_make("CartPole-v1", client = server)
  id <- env$instance_id
  env$close()
  rm(env)
  gc()
  expect_length(client_state(server)$to_close, 0)
  expect_false(instance_place(server, id) %in% ls(the_session$instances))
  gone <- gym_make("CartPole-v1", client = server)
  route <- paste0("/v1/envs/", gone$instance_id, "/close/")
  post_answer(server, route)
  expect_error(gone$close(), NA)
  expect_false(instance_place(server, gone$instance_id) %in% ls(the_session$instances))
})

test_that("what was refused or never sent is not remembered", {
  remembered <- function() length(ls(the_session$instances))
  before <- remembered()
  expect_error(env_create(test_client(), "Nothing-v0"), class = "gym_error_http_400")
  nobody <- create_GymClient(paste0("http://127.0.0.1:", free_port()))
  error <- expect_error(env_create(nobody, "CartPole-v1"), class = "gym_error_connection")
  expect_false(error$reached)
  expect_identical(remembered(), before)
})

test_that("a server that was stopped has nothing left to close", {
  server <- local_server()
  env_create(server, "CartPole-v1")
  gym_server_stop(server)
  expect_false(any(startsWith(ls(the_session$instances), server$remote_base)))
})

test_that("an error in a search closes its environment without waiting for a server that hangs", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  pid <- the_session$servers[[server$remote_base]]$pid
  hasty <- create_GymClient(server$remote_base, timeout = 0.5)
  stop_it <- function(observation) {
    tools::pskill(pid, tools::SIGSTOP)
    rep(1L, nrow(observation))
  }
  withr::defer(tools::pskill(pid, tools::SIGCONT), priority = "first")
  taken <- system.time(
    expect_error(rollout("CartPole-v1", stop_it, client = hasty), class = "gym_error_connection")
  )
  expect_lt(taken[["elapsed"]], 20)
  tools::pskill(pid, tools::SIGCONT)
  close_session <- function() close_together(ls(the_session$instances), closing_time)
  close_session()
  expect_length(open_after_a_while(server), 0)
})

test_that("a client goes on with a server that was started later at its address", {
  skip_unless_all()
  first <- local_server(token = FALSE)
  client <- create_GymClient(first$remote_base)
  expect_type(env_create(client, "CartPole-v1"), "character")
  port <- as.integer(sub(".*:", "", first$remote_base))
  gym_server_stop(first)
  later <- local_server(port = port, token = FALSE)
  id <- env_create(client, "CartPole-v1")
  expect_named(env_list_all(later), id)
})

test_that("a server that the front started anew is said to have lost the session's environments", {
  skip_unless_all()
  server <- local_users_server()
  anna <- create_GymClient(server$remote_base, token = user_tokens[["anna"]])
  ids <- replicate(2, env_create(anna, "CartPole-v1"))
  env <- gym_make("Acrobot-v1", client = anna)
  env$reset()
  expect_error(env_step(anna, "abcdef01", 0), "unknown", class = "gym_error_http_400")
  tools::pskill(get_answer(anna, "/v1/health/")$pid, tools::SIGKILL)
  calls <- list(
    function() env$step(1), function() env$render(), function() env_reset(anna, ids[[1]])
  )
  for (call in calls) {
    cnd <- expect_error(call(), "was started again", class = "gym_error_connection")
    for (id in c(env$instance_id, ids)) expect_match(conditionMessage(cnd), id, fixed = TRUE)
  }
  # What is made on the new server is not lost.
  new <- env_create(anna, "CartPole-v1")
  cnd <- expect_error(env$step(1), class = "gym_error_connection")
  expect_no_match(conditionMessage(cnd), new, fixed = TRUE)
})
