# The routes of the requests that are made in the meantime.
local_requests <- function(frame = parent.frame()) {
  asked <- new.env()
  asked$routes <- character()
  local_functions(send_request = local({
    send <- gym:::send_request
    function(client, route, method = "POST", ...) {
      asked$routes <- c(asked$routes, paste(method, basename(route)))
      send(client, route, method, ...)
    }
  }), frame = frame)
  asked
}

test_that("making an environment is one request, whose answer describes it", {
  drop_streams(function(stream) TRUE)
  client <- test_client()
  env_list_all(client)
  asked <- local_requests()
  env <- local_env(num_envs = 2, seed = 1)
  expect_identical(env$spec$max_episode_steps, 500L)
  id <- env_create(client, "CartPole-v1")
  expect_identical(asked$routes, c("POST envs", "POST envs"))
  env_reset(client, id)
  env_step(client, id, 1)
  env_close(client, id)
  # The reset and the step go by a stream.
  expect_identical(asked$routes[-(1:2)], "POST close")
})

test_that("an environment that cannot be described is closed again", {
  server <- local_canned_server(list(
    "/v1/envs/" = list(text = paste0(
      '{"instance_id":"0a1b2c3d","request":{},"env_id":"Bad-v0","action_space":3,',
      '"observation_space":{"name":"Discrete","n":2}}'
    )),
    "/v1/envs/0a1b2c3d/close/" = list(status = 200, text = "{}")
  ))
  expect_error(env_create(server, "Bad-v0"), "action_space", class = "gym_error_connection")
  expect_false(instance_place(server, "0a1b2c3d") %in% ls(the_session$instances))
})

test_that("a call that hangs ends the server; errors say why, and which environments were lost", {
  skip_unless_all()
  # The other calls take less, even on a busy machine.
  server <- local_odd_server(max_call_seconds = 4)
  env <- gym_make("CartPole-v1", client = server)
  many <- gym_make("Acrobot-v1", num_envs = 2, client = server)
  hangs <- expect_error(
    gym_make("odd_environments:SlowToMake-v0", seconds = 60, client = server),
    "Making odd_environments:SlowToMake-v0 took more than 4 seconds",
    class = "gym_error_connection"
  )
  for (cnd in list(hangs, expect_error(env$reset()), expect_error(env_list(server)))) {
    expect_s3_class(cnd, "gym_error_connection")
    expect_false(inherits(cnd, "gym_error_argument"))
    text <- conditionMessage(cnd)
    expect_match(text, "its option --max-call-seconds sets the limit", fixed = TRUE)
    for (one in list(env, many)) {
      expect_match(text, paste0(one$spec$id, " (", one$instance_id, ")"), fixed = TRUE)
    }
  }
})

test_that("an error names what may be lost on a server of somebody else", {
  skip_unless_all()
  server <- local_server()
  base <- server$remote_base
  env <- gym_make("CartPole-v1", client = server)
  own <- the_session$servers[[base]]
  # As if another session had started it.
  the_session$servers[[base]] <- NULL
  stop_server(own)
  remember_instance(server, env$instance_id, "CartPole-v1")
  cnd <- expect_error(env_list(server), class = "gym_error_connection")
  text <- paste0("If it has ended, these are lost: `CartPole-v1 (", env$instance_id, ")`.")
  expect_match(conditionMessage(cnd), text, fixed = TRUE)
  the_session$servers[[base]] <- own
})

test_that("an environment whose server has ended is not open, and says so", {
  server <- local_server()
  single <- gym_make("CartPole-v1", client = server)
  several <- gym_make("CartPole-v1", client = server, num_envs = 2)
  wrapped <- gym_wrap(gym_make("CartPole-v1", client = server), "TransformReward",
                      func = function(reward) -reward)
  classic <- env_create(server, "CartPole-v1")
  file <- withr::local_tempfile()
  saveRDS(list(single, server, classic), file)
  for (env in list(single, several, wrapped)) env$reset()
  gym_server_stop(server)
  # Before anything else has noticed it.
  cnd <- expect_error(single$step(1), "on a server that has ended", class = "gym_error_connection")
  expect_false(inherits(cnd, "gym_error_argument"))
  for (env in list(single, several, wrapped)) {
    expect_false(env$is_open)
    expect_error(env$reset(), "on a server that has ended", class = "gym_error_connection")
    expect_silent(env$close())
  }
  for (call in list(env_reset, env_render, env_action_space_sample, env_monitor_close)) {
    expect_error(call(server, classic), " has ended", class = "gym_error_connection")
  }
  expect_error(env_step(server, classic, 1), " has ended", class = "gym_error_connection")
  expect_silent(env_close(server, classic))
  expect_output(print(single), "<gym_env: CartPole-v1, made on a server that has ended>")
  expect_output(print(wrapped), "TransformReward, made on a server that has ended>")
  script <- paste0(
    "library(gym); saved <- readRDS('", normalizePath(file, "/"), "');",
    "env <- saved[[1]]; client <- saved[[2]]; id <- saved[[3]];",
    "say <- function(code) tryCatch(code, error = function(cnd) cat(conditionMessage(cnd)));",
    "print(env); say(env$step(1)); say(env$reset()); cat(env$is_open, env$close()$is_open);",
    "say(env_step(client, id, 1)); say(env_reset(client, id)); env_close(client, id)"
  )
  said <- processx::run(file.path(R.home("bin"), "Rscript"), c("-e", script))$stdout
  said <- gsub("made in a session that has ended", "ENDED", said)
  expect_match(said, "CartPole-v1, ENDED>.*ENDED.*ENDED.*FALSE FALSE.*ENDED.*ENDED")
})

random_lake <- function(play, ...) {
  play("FrozenLake-v1", ..., desc = NULL, map_name = NULL, client = test_client())
}

test_that("a random map follows from the seed, whatever plays", {
  maps <- lapply(c(1, 1, 2), function(seed) {
    played <- random_lake(rollout, policy_random(), episodes = 2, seed = seed)
    provenance(played)$kwargs$desc
  })
  expect_identical(nchar(maps[[1L]]), rep(8L, 8))
  expect_identical(maps[[2L]], maps[[1L]])
  expect_false(identical(maps[[3L]], maps[[1L]]))
  env <- random_lake(gym_make, seed = 1)
  on.exit(env$close())
  expect_identical(env$spec$kwargs$desc, maps[[1L]])
  # It is the map by which the environment moves.
  cells <- strsplit(paste(maps[[1L]], collapse = ""), "")[[1L]]
  moves <- as.data.frame(env_model(env))
  expect_setequal(
    unique(moves$next_state[moves$terminated]), which(cells %in% c("H", "G")) - 1
  )
})

test_that("what is learned on a random map is judged on the same", {
  skip_unless_all()
  learned <- random_lake(learn_q, total_steps = 500, seed = 1, is_slippery = FALSE,
                         max_steps = 100)
  lake <- env_model(
    "FrozenLake-v1", desc = provenance(learned)$kwargs$desc, is_slippery = FALSE,
    client = test_client()
  )
  exact <- evaluate_policy(lake, learned$policy, max_steps = 100)$mean_return
  expect_identical(learned$final$mean_return, exact)
})

test_that("a way leads to the goal of every map", {
  ice <- matrix(c(TRUE, FALSE, TRUE, TRUE), 2)
  expect_true(has_way(ice))
  expect_false(has_way(ice & row(ice) == col(ice)))
  expect_true(all(vapply(1:50, function(seed) {
    map <- with_generator(new_generator(seed), draw_lake())
    has_way(do.call(rbind, strsplit(map, "")) != "H")
  }, NA)))
})
