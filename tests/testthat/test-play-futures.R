# Workers of a plan: the same results, whoever plays and whatever is lost. Real workers with real
# servers, which end with their plan.

skip_if_not_installed("future")

# Sets a plan of workers until the test ends.
local_plan <- function(..., frame = parent.frame()) {
  test_client()
  old <- future::plan(...)
  withr::defer(
    {
      future::plan("sequential")
      the_session$left_futures <- NULL
      the_session$broken_plan <- NULL
    },
    envir = frame
  )
  invisible(old)
}

drawing <- function(observation) sample.int(3, nrow(observation), replace = TRUE) - 1L

train <- function(...) {
  train_agent(
    agent_ars(directions = 8, top = 4), "Acrobot-v1", policy_linear(normalize = TRUE),
    iterations = 4, seed = 3, eval_episodes = 10, eval_every = 2, max_steps = 60, ...
  )
}

everything <- function() {
  objective <- gym_objective("Acrobot-v1", policy_linear(), episodes = 5, seed = 1, max_steps = 40)
  weights <- matrix(seq(-1, 1, length.out = 3 * 18), 3)
  search <- search_random(
    "Acrobot-v1", policy_network(c(6, 2, 3)), rounds = 20, target = -150, seed = 1
  )
  list(
    what_counts(train()),
    rollout("Acrobot-v1", drawing, 300, seed = 5, max_steps = 50, steps = TRUE)[1:2],
    as.data.frame(evaluate_policy("Acrobot-v1", list(drawing, policy_random()), 10, seed = 2,
                                  max_steps = 50)),
    search$episodes, search$solved, objective(weights),
    rollout("CartPole-v1", policy_random(), 600, seed = 1)$episodes
  )
}

# The processes of all workers of the plan. Each is asked while the others still answer.
worker_pids <- function() {
  asked <- lapply(seq_len(future::nbrOfWorkers()), function(i) {
    future::future({
      Sys.sleep(0.3)
      Sys.getpid()
    }, lazy = FALSE)
  })
  vapply(asked, future::value, 0L)
}

test_that("a worker's server plays in as many processes as future gives the worker, one", {
  skip_unless_all()
  local_plan(future::multisession, workers = 2)
  rollout("Acrobot-v1", policy_random(), 40, seed = 1, max_steps = 20)
  asked <- lapply(1:2, function(i) {
    future::future({
      Sys.sleep(0.3)
      utils::getFromNamespace("the_session", "gym")$cores
    }, lazy = FALSE)
  })
  counts <- unlist(lapply(asked, future::value))
  expect_gt(length(counts), 0L)
  expect_true(all(counts == 1L))
})

test_that("a search that normalises has the same moments, whoever plays beyond its end", {
  skip_unless_all()
  search <- function() {
    search <- search_random(
      "Acrobot-v1", policy_network(c(6, 3), normalize = TRUE), rounds = 40, target = -400, seed = 1
    )
    expect_true(search$solved)
    search$policy$moments
  }
  alone <- search()
  local_plan(future::multisession, workers = 2)
  expect_identical(search(), alone)
})

test_that("results are the same with none and with three workers, and with 1 and 7", {
  skip_unless_all()
  alone <- everything()
  local_plan(future::multisession, workers = 3)
  expect_identical(everything(), alone)
  if (soaks("GYM_TEST_FUTURES")) {
    future::plan(future::cluster, workers = 1)
    expect_identical(everything(), alone)
    future::plan(future::multisession, workers = 7)
    expect_identical(everything(), alone)
  }
})

test_that("environments and models in R travel", {
  skip_unless_all()
  withr::defer(gym_unregister("Travel-v0"))
  gym_register("Travel-v0", r_cartpole())
  model <- walk_model(max_episode_steps = 20)
  play <- function() {
    list(
      rollout("Travel-v0", policy_random(), 40, seed = 1)$episodes,
      rollout(model, policy_random(), 300, seed = 1)$episodes
    )
  }
  alone <- play()
  local_plan(future::multisession, workers = 2)
  expect_identical(play(), alone)
})

test_that("what cannot travel is played here, which is said once", {
  skip_unless_all()
  withr::local_options(rlib_message_verbosity = "verbose")
  local_plan(future::multisession, workers = 2)
  env <- local_env("CartPole-v1")
  expect_message(rollout(env, policy_random(), seed = 1), class = "gym_message_plays_here")
  wrapped <- gym_wrap("CartPole-v1", "NormalizeObservation")
  expect_message(
    expect_message(rollout(wrapped, policy_random(), seed = 1), class = "gym_message_remembers"),
    "remembers earlier episodes"
  )
  pointing <- local({
    pointer <- methods::new("externalptr")
    function(observation) drawing(observation)
  })
  expect_message(rollout("Acrobot-v1", pointing, 2, max_steps = 5), "connection or a pointer")
  expect_message(
    train_agent(
      agent_q(), "FrozenLake-v1", iterations = 1, eval_episodes = 2, seed = 1, model = FALSE
    ),
    "learns from each step"
  )
})

test_that("without a plan nothing is loaded or said", {
  expect_no_message(rollout("Acrobot-v1", drawing, 2, max_steps = 5, seed = 1))
  expect_identical(plan_kind(), "none")
})

test_that("a worker that is killed in a training is done without", {
  skip_unless_all()
  alone <- what_counts(train())
  local_plan(future::multisession, workers = 2)
  killed <- FALSE
  kill_one <- function(training) {
    if (!killed) tools::pskill(worker_pids()[[1]], tools::SIGKILL)
    killed <<- TRUE
    Sys.sleep(0.5)
  }
  expect_warning(trained <- train(callback = kill_one), class = "gym_warning_worker")
  expect_identical(what_counts(trained), alone)
})

test_that("a worker whose server is killed starts another one", {
  skip_unless_all()
  alone <- what_counts(train())
  local_plan(future::cluster, workers = 1)
  kill_server <- function(training) {
    if (training$history$iteration[[nrow(training$history)]] == 2L) {
      future::value(future::future({
        session <- utils::getFromNamespace("the_session", "gym")
        session$servers[[1]]$process$kill()
      }, globals = FALSE, lazy = FALSE))
    }
  }
  expect_no_error(trained <- suppressWarnings(train(callback = kill_server)))
  expect_identical(what_counts(trained), alone)
})

test_that("when no worker is left the session plays on", {
  skip_unless_all()
  alone <- what_counts(train())
  local_plan(future::multisession, workers = 2)
  kill_all <- function(training) {
    if (nrow(training$history) == 1L) tools::pskill(worker_pids(), tools::SIGKILL)
    Sys.sleep(0.5)
  }
  expect_identical(what_counts(suppressWarnings(train(callback = kill_all))), alone)
})

test_that("a plan that is set again after it broke is used again", {
  skip_unless_all()
  play <- function() rollout("Acrobot-v1", drawing, 20, max_steps = 5, seed = 1)$episodes
  alone <- play()
  cluster <- parallelly::makeClusterPSOCK(2)
  withr::defer(for (i in 1:2) try(parallel::stopCluster(cluster[i]), silent = TRUE))
  local_plan(future::cluster, workers = cluster)
  tools::pskill(worker_pids(), tools::SIGKILL)
  Sys.sleep(0.5)
  expect_warning(played <- play(), "accepts no more futures", class = "gym_warning_worker")
  expect_identical(played, alone)
  expect_identical(plan_kind(), "none")
  expect_no_warning(play())
  again <- parallelly::makeClusterPSOCK(1)
  withr::defer(parallel::stopCluster(again))
  cluster <- again
  future::plan(future::cluster, workers = cluster)
  expect_identical(plan_kind(), "kept")
  expect_identical(play(), alone)
})

test_that("a worker that is silent counts as lost, and its part is played here in the end", {
  skip_unless_all()
  here <- Sys.getpid()
  slow <- function(observation) {
    if (Sys.getpid() != here) Sys.sleep(30)
    drawing(observation)
  }
  play <- function() rollout("Acrobot-v1", slow, 4, seed = 1, max_steps = 5)$episodes
  alone <- play()
  local_plan(future::multisession, workers = 2)
  # They would go on sleeping after the end of the plan.
  pids <- worker_pids()
  withr::defer(tools::pskill(pids, tools::SIGKILL))
  withr::local_options(gym.batch_deadline = 1)
  expect_warning(
    expect_warning(played <- play(), "silent for"), "silent for", class = "gym_warning_worker"
  )
  expect_identical(played, alone)
})

test_that("another version of the package is an error that names the host", {
  task <- new_worker_task("batch", list(), NULL)
  task$gym <- "0.0.1"
  done <- do_task(task)
  expect_s3_class(done$error, "gym_error_worker")
  expect_match(conditionMessage(done$error), Sys.info()[["nodename"]], fixed = TRUE)
  expect_match(conditionMessage(done$error), "0.0.1", fixed = TRUE)
  expect_false(done$lost)
})

test_that("a worker without the package is an error that names the host", {
  skip_unless_all()
  local_plan(future::cluster, workers = 1)
  future::value(future::future(.libPaths(tempfile(), include.site = FALSE), globals = FALSE))
  installed <- future::value(
    future::future(requireNamespace("gym", quietly = TRUE), globals = FALSE)
  )
  skip_if(installed, "gym is in the library of R itself")
  error <- expect_error(
    rollout("Acrobot-v1", drawing, 2, max_steps = 5), class = "gym_error_worker"
  )
  expect_match(conditionMessage(error), "lacks the package gym")
})

test_that("an error of a policy on a worker is that of the call, and workers go on", {
  skip_unless_all()
  local_plan(future::multisession, workers = 2)
  failing <- function(observation) stop("no idea")
  expect_error(rollout("Acrobot-v1", failing, 4, seed = 1), "no idea")
  expect_identical(nrow(rollout("Acrobot-v1", drawing, 4, seed = 1, max_steps = 5)$episodes), 4L)
})

test_that("functions travel with what they use of the session", {
  skip_unless_all()
  # The functions of a user's session are in the global environment.
  define <- quote({
    gym_test_limit <- 0.5
    gym_test_list <- list(above = function(x) x > gym_test_limit)
    gym_test_policy <- function(observation) 2 * gym_test_list$above(observation[, 1])
    gym_test_shift <- 5
    gym_test_reward <- function(reward) reward + gym_test_shift
    gym_test_base <- R6::R6Class("Base", public = list(start = function() 0))
    gym_test_class <- R6::R6Class("Child", inherit = gym_test_base)
    gym_test_walk <- function() {
      gym::gym_env(
        function(self) self$at <- gym_test_class$new()$start(),
        function(self, action) {
          self$at <- self$at + 1
          list(observation = self$at, reward = gym_test_shift, terminated = self$at == 3)
        },
        observation_space = gym::space_discrete(4), action_space = gym::space_discrete(2)
      )
    }
  })
  eval(define, globalenv())
  withr::defer(rm(list = c("gym_test_limit", "gym_test_list", "gym_test_policy", "gym_test_shift",
                           "gym_test_reward", "gym_test_base", "gym_test_class", "gym_test_walk"),
                  envir = globalenv()))
  gym_register("Session-v0", get("gym_test_walk", globalenv()))
  withr::defer(gym_unregister("Session-v0"))
  play <- function() {
    policy <- get("gym_test_policy", globalenv())
    shaped <- gym_wrap("Acrobot-v1", "TransformReward", func = get("gym_test_reward", globalenv()))
    remembers <- policy_memory(function(observation, memory) {
      list(action = policy(observation), memory = memory)
    }, 0)
    suppressMessages(list(
      rollout("Session-v0", policy_random(), 4, seed = 1)$episodes,
      rollout(shaped, policy, 4, seed = 1, max_steps = 20)$episodes,
      rollout("Acrobot-v1", remembers, 4, seed = 1, max_steps = 20)$episodes,
      coef(train_agent(agent_ars(directions = 2, top = 2), shaped, iterations = 1, seeds = 1:2,
                       max_steps = 20, eval_episodes = 2, target = Inf))
    ))
  }
  alone <- play()
  local_plan(future::multisession, workers = 2)
  expect_no_message(there <- play(), class = "gym_message_plays_here")
  expect_identical(there, alone)
})

test_that("seeds are trained by workers, each with its own files", {
  skip_unless_all()
  trained <- function(...) {
    lapply(train_agent(
      agent_ars(directions = 4, top = 2), "Acrobot-v1", policy_linear(), iterations = 2,
      seeds = 1:3, eval_episodes = 5, max_steps = 40, ...
    )$trainings, what_counts)
  }
  alone <- trained()
  folder <- withr::local_tempdir()
  local_plan(future::multisession, workers = 2)
  expect_identical(trained(checkpoint = file.path(folder, "a.rds"), log = folder), alone)
  expect_setequal(list.files(folder, "rds$"), paste0("a-", 1:3, ".rds"))
  expect_setequal(list.files(folder, "^seed"), paste0("seed-", 1:3))
  future::plan(future::multicore, workers = 2)
  expect_identical(trained(), alone)
  # inst/examples/slurm.R, which test-examples.R runs, has jobs of batchtools.
  if (!soaks("GYM_TEST_FUTURES")) return()
  inner <- future::tweak(future::multisession, workers = I(2))
  future::plan(list(future::tweak(future::multisession, workers = 2), inner))
  expect_identical(trained(), alone)
  withr::local_dir(folder)
  future::plan(future.batchtools::batchtools_local)
  expect_identical(trained(), alone)
  future::plan(list(future.batchtools::batchtools_local, inner))
  expect_identical(trained(), alone)
})

test_that("a future in a policy in a rollout in a future comes to an end, with the same result", {
  skip_unless_all()
  test_client()
  asking <- function(observation) {
    turn <- future::value(future::future(1L))
    rep(turn, nrow(observation))
  }
  play <- function() {
    gym::rollout("Acrobot-v1", asking, 4, seed = 1, max_steps = 3)$episodes
  }
  alone <- play()
  local_plan(future::multisession, workers = 2)
  inner <- future::tweak(future::multisession, workers = I(2))
  future::plan(list(future::tweak(future::multisession, workers = 2), inner))
  expect_identical(future::value(future::future(play(), seed = NULL)), alone)
  expect_identical(play(), alone)
})

test_that("an answer that future has read by itself is not waited for", {
  skip_unless_all()
  local_plan(future::multisession, workers = 2)
  read <- future::future(1L)
  expect_identical(future::value(read), 1L)
  one <- list(future = read, started = proc.time()[["elapsed"]])
  crew <- rlang::env(running = list(one), slowest = 0, deadline = function(slowest) Inf)
  expect_identical(await_workers(crew), 1L)
  crew$running <- list()
  expect_identical(await_workers(crew), integer())
})

test_that("progressr is told where it listens", {
  skip_if_not_installed("progressr")
  told <- 0
  progressr::with_progress(enable = TRUE, withCallingHandlers(
    rollout("Acrobot-v1", drawing, 20, max_steps = 5, seed = 1),
    progression = function(cnd) told <<- told + (cnd$type == "update")
  ))
  expect_gt(told, 0)
})

test_that("no worker and no server of a worker is left", {
  skip_unless_all()
  skip_on_os("windows")
  local_plan(future::multisession, workers = 2)
  rollout("Acrobot-v1", drawing, 30, max_steps = 20, seed = 1)
  asked <- lapply(1:2, function(i) {
    future::future({
      Sys.sleep(0.3)
      session <- utils::getFromNamespace("the_session", "gym")
      c(Sys.getpid(), vapply(session$servers, function(server) server$pid, 0L))
    }, globals = FALSE, lazy = FALSE)
  })
  pids <- unlist(lapply(asked, future::value))
  expect_gt(length(pids), 2)
  expect_true(all(vapply(pids, pid_runs, NA)))
  future::plan("sequential")
  expect_true(wait_until(function() !any(vapply(pids, pid_runs, NA))))
})
