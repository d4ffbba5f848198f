quiet_training <- function(..., env = fake_environment(reward = first_action), seed = 1) {
  suppressMessages(train_agent(..., env = env, seed = seed, eval_episodes = 4, eval_every = 3),
                   classes = "gym_message_resumed")
}

some_agents <- function() {
  list(
    ars = agent_ars(directions = 3, top = 2, step_size = 0.5, noise = 1), cem = agent_cem(6, 2),
    hill = agent_hill_climb(noise = 1)
  )
}

test_that("a training has a row for each iteration, and one for each evaluation", {
  env <- fake_environment(reward = first_action)
  trained <- quiet_training(agent_ars(directions = 3), iterations = 7, target = Inf, env = env)
  expect_s3_class(trained, "gym_training")
  expect_identical(trained$history$iteration, 1:7)
  # Six candidates of one episode with three steps.
  expect_identical(trained$history$steps, 18 * 1:7)
  expect_identical(trained$steps, 126)
  expect_identical(trained$evaluations$kind, c("curve", "curve", "final"))
  expect_identical(trained$evaluations$iteration, c(3L, 6L, 7L))
  expect_identical(trained$evaluations$episodes, rep(4L, 3))
  expect_identical(trained$history$evaluation[c(3, 6)], trained$evaluations$mean_return[1:2])
  expect_true(all(is.na(trained$history$evaluation[-c(3, 6)])))
  expect_identical(trained$final, trained$evaluations[3, ], ignore_attr = TRUE)
  expect_identical(trained$solved, NA)
  expect_identical(as.data.frame(trained), trained$history)
  expect_length(env$seeds, 6 * 7 + 4 * 3)
  # Of each step of the training the observation that was acted on.
  expect_identical(trained$policy$moments$count, 126)
})

test_that("evaluations change nothing of the training, and play episodes of their own", {
  env <- fake_environment(reward = first_action)
  play <- function(eval_every, env = fake_environment(reward = first_action)) {
    train_agent(agent_ars(), env, iterations = 6, target = Inf, seed = 3, eval_episodes = 5,
                eval_every = eval_every)
  }
  often <- play(1, env)
  seldom <- play(50)
  columns <- c("steps", "min_return", "median_return", "mean_return", "max_return")
  expect_identical(often$history[columns], seldom$history[columns])
  expect_identical(often$policy, seldom$policy)
  parts <- cut(env$seeds, c(0, 2^30, 2^30 + 2^29, 2^31))
  expect_identical(as.vector(table(parts)), c(16L * 6L, 5L * 6L, 5L))
  expect_identical(which(parts == levels(parts)[[3]]), 127:131)
})

test_that("the untrained policy is evaluated where episodes have a limit, and changes nothing", {
  play <- function(...) {
    quiet_training(agent_ars(), iterations = 6, target = Inf, ...,
                   env = fake_environment(reward = first_action))
  }
  trained <- play(max_steps = 3)
  expect_identical(trained$evaluations$iteration, c(0L, 3L, 6L, 6L))
  expect_identical(trained$evaluations$kind, c("curve", "curve", "curve", "final"))
  # Without it, and without a curve at all, the same is trained and later evaluations are the same.
  without <- play()
  expect_identical(without$evaluations, trained$evaluations[-1, ], ignore_attr = TRUE)
  no_curve <- play(max_steps = 3, eval_episodes_curve = 0)
  expect_identical(no_curve$evaluations$kind, "final")
  for (other in list(without, no_curve)) {
    expect_identical(other$policy, trained$policy)
    expect_identical(other$history$mean_return, trained$history$mean_return)
  }
  expect_identical(evaluation_steps(trained), c(0, trained$history$steps[c(3, 6, 6)]))
})

test_that("a checkpoint from before the first iteration goes on to the same evaluations", {
  kept <- local_kept_files()
  play <- function(path) {
    quiet_training(agent_ars(), iterations = 3, target = Inf, max_steps = 3, checkpoint = path)
  }
  first <- play(local_checkpoint())
  expect_identical(first$evaluations$iteration[[1]], 0L)
  for (bytes in kept$list[1:2]) {
    expect_identical(play(local_checkpoint(bytes))$evaluations, first$evaluations)
  }
})

test_that("one lucky episode of an agent that gets trajectories leads to no evaluation", {
  # Iterations of so many episodes of ten steps, the last one first.
  judged <- function(agent, episodes, returns) {
    steps <- cumsum(rev(episodes)) * 10
    history <- Map(history_row, seq_along(steps), steps, rev(returns), 10, 1)
    recent_return(list(agent = agent, history = history, iteration = length(history)))
  }
  expect_equal(judged(agent_dqn(), rep(1, 20), c(500, rep(20, 7), rep(0, 12))), 80)
  expect_equal(judged(agent_dqn(), c(2, 5, 3, 9), c(10, 40, 20, 999)), 28)
  expect_equal(judged(agent_dqn(), c(1, 1), c(30, 10)), 20)
  expect_equal(judged(agent_ppo(), c(8, 8), c(30, 10)), 30)
  expect_equal(judged(agent_hill_climb(), c(1, 1), c(30, 10)), 30)
})

test_that("fresh episodes decide whether a training ends, and further ones what it has come to", {
  lucky <- function(seed, step, action) if (seed <= 2^30) 10 else 1
  trained <- quiet_training(agent_hill_climb(), iterations = 4, target = 20,
                            env = fake_environment(reward = lucky))
  expect_false(trained$solved)
  expect_identical(trained$evaluations$kind, c(rep("stopping", 4), "final"))
  expect_identical(trained$evaluations$mean_return, rep(3, 5))
  at_last <- function(seed, step, action) if (seed <= 2^30 + 2^29) 10 else 1
  trained <- quiet_training(agent_hill_climb(), iterations = 4, target = 20,
                            env = fake_environment(reward = at_last))
  expect_identical(trained[c("stopped_early", "solved")],
                   list(stopped_early = TRUE, solved = FALSE))
  expect_identical(trained$history$iteration, 1L)
  expect_identical(trained$evaluations$mean_return, c(30, 3))
  expect_output(print(trained), "Stopped early after 1 iteration, 3 steps in .* \\(target 20\\)")
  expect_output(print(trained), "Mean return in 4 fresh episodes: 3 ")
})

test_that("the environment's own threshold is the target", {
  env <- function() fake_environment(reward_threshold = 3)
  expect_true(quiet_training(agent_cem(), iterations = 2, env = env())$solved)
  expect_null(quiet_training(agent_cem(), iterations = 2)$target)
  expect_false(quiet_training(agent_cem(), iterations = 2, target = 4, env = env())$solved)
  # Whatever the agent, and whether or not there is a preset.
  expect_false("target" %in% names(agent_presets()))
  pendulum <- function(train, ...) {
    env <- fake_environment(reward_threshold = 3, id = "Pendulum-v1")
    train(env = env, ..., iterations = 1, seed = 1, eval_episodes = 2)$target
  }
  expect_identical(pendulum(search_ars), -200)
  expect_identical(pendulum(search_cem), -200)
  expect_identical(pendulum(train_agent, agent = agent_cem()), -200)
})

test_that("a training ends when its steps are used up, or its callback says so", {
  trained <- quiet_training(agent_cem(6), total_steps = 40, target = Inf)
  expect_identical(trained$steps, 54)
  seen <- list()
  callback <- function(training) {
    seen[[length(seen) + 1L]] <<- training
    nrow(training$history) < 3
  }
  trained <- quiet_training(agent_cem(6), iterations = 9, target = Inf, callback = callback)
  expect_identical(nrow(trained$history), 3L)
  expect_length(seen, 3)
  expect_s3_class(seen[[2]], "gym_training")
  expect_identical(seen[[3]]$policy, trained$policy)
  expect_false(is.null(trained$final))
})

test_that("a training goes on from the file of any iteration to an undisturbed one's result", {
  skip_unless_all()
  single <- function() fake_environment(reward = first_action)
  each <- function() fake_vector_env(2, "sync", reward = first_action)
  together <- function() fake_vector_env(7, "vector_entry_point", reward = first_action)
  goes_on <- function(agent, env) {
    play <- function(checkpoint = NULL) {
      quiet_training(agent, iterations = 5, target = Inf, checkpoint = checkpoint, env = env())
    }
    undisturbed <- what_counts(play())
    kept <- local_kept_files()
    expect_identical(what_counts(play(local_checkpoint())), undisturbed)
    expect_length(kept$list, 7)
    for (bytes in kept$list) {
      expect_identical(what_counts(play(local_checkpoint(bytes))), undisturbed)
    }
  }
  agents <- some_agents()
  for (env in list(single, each, together)) goes_on(agents$ars, env)
  goes_on(agents$cem, each)
  goes_on(agents$hill, single)
})

test_that("a larger budget goes on where a smaller one has ended", {
  play <- function(iterations, checkpoint) {
    quiet_training(agent_ars(), iterations = iterations, target = Inf, checkpoint = checkpoint)
  }
  path <- local_checkpoint()
  play(3, path)
  expect_message(
    train_agent(agent_ars(), fake_environment(reward = first_action), iterations = 3, target = Inf,
                seed = 1, eval_episodes = 4, eval_every = 3, checkpoint = path),
    "has already ended", class = "gym_message_resumed"
  )
  more <- play(6, path)
  at_once <- play(6, NULL)
  expect_identical(more$history$mean_return, at_once$history$mean_return)
  expect_identical(coef(more$policy), coef(at_once$policy))
  expect_identical(more$evaluations, at_once$evaluations)
  expect_identical(more$final, at_once$final)
})

test_that("a file of something else is refused", {
  path <- local_checkpoint()
  quiet_training(agent_ars(), iterations = 2, checkpoint = path)
  refused <- function(message, ...) {
    expect_error(quiet_training(..., iterations = 2, checkpoint = path), message, fixed = TRUE,
                 class = "gym_error_checkpoint")
  }
  refused("0.05 in the file, and CEM: population 40", agent_cem())
  refused("0.05 in the file, and ARS V2-t: directions 8, top 4, step_size 0.02, noise 0.1 here",
          agent_ars(noise = 0.1))
  refused("`env` is Fake-v0 in the file, and Other-v0 here.", agent_ars(),
          env = fake_environment(id = "Other-v0"))
  refused("`seed` is 1 in the file, and 2 here.", agent_ars(), seed = 2)
  refused("`episodes` is 1 in the file, and 3 here.", agent_ars(), episodes = 3)
  expect_error(
    search_random(fake_environment(), checkpoint = path), "belongs to a training", fixed = TRUE,
    class = "gym_error_checkpoint"
  )
})

test_that("an interrupt or an error leaves the iterations before it", {
  stopping <- function(stop_it) {
    env <- fake_environment(reward = first_action)
    step <- env$step
    env$step <- function(action) if (length(env$seeds) == 15L) stop_it() else step(action)
    env
  }
  play <- function(env) quiet_training(agent_cem(6), iterations = 5, target = Inf, env = env)
  expect_message(trained <- play(stopping(rlang::interrupt)), "interrupted after 2 of 5 iterations",
                 class = "gym_message_interrupted")
  expect_true(trained$interrupted)
  expect_null(trained$final)
  undisturbed <- play(fake_environment(reward = first_action))
  expect_identical(trained$history$mean_return, undisturbed$history$mean_return[1:2])
  expect_output(print(trained), "Interrupted after 2 iterations")
  cnd <- expect_error(play(stopping(function() gym_abort("lost"))), "after 2 of 5 iterations",
                      class = "gym_error_training")
  expect_identical(cnd$result$history$mean_return, undisturbed$history$mean_return[1:2])
})

test_that("a return that is no number names the candidate and keeps what was trained", {
  reward <- function(seed, step, action) if (length(env$seeds) == 15L) Inf else 1
  env <- fake_environment(reward = reward)
  cnd <- expect_error(quiet_training(agent_cem(6), iterations = 5, target = Inf, env = env),
                      class = "gym_error_training")
  expect_match(conditionMessage(cnd$parent), "candidate 3 of 6 is Inf")
  expect_identical(nrow(cnd$result$history), 2L)
})

test_that("an agent that returns nonsense is refused, and what it returned shown", {
  agent_of <- function(ask, tell = function(agent, results) agent) {
    .S3method("agent_ask", "odd", ask)
    .S3method("agent_tell", "odd", tell)
    structure(list(), class = c("odd", "gym_agent"))
  }
  refused <- function(agent, message) {
    cnd <- expect_error(quiet_training(agent, iterations = 2), class = "gym_error_training")
    expect_match(conditionMessage(cnd$parent), message, fixed = TRUE)
    expect_s3_class(cnd, "gym_error_agent")
  }
  refused(agent_of(function(agent) 1:4), "must return a numeric matrix with 4 columns")
  refused(agent_of(function(agent) matrix(0, 2, 3)), "not an array of 2 x 3")
  refused(agent_of(function(agent) matrix(NA_real_, 2, 4)), "finite numbers")
  refused(agent_of(function(agent) matrix(0, 2, 4), function(agent, results) NULL),
          "`agent_tell()` must return an agent, not NULL")
})

test_that("an error about a choice names the function that the user called", {
  choices <- list(list(evaluate = "best"), list(solved_by = "luck"))
  for (wrong in choices) {
    cnd <- expect_error(rlang::exec(quiet_training, agent_ars(), iterations = 1, !!!wrong),
                        class = "gym_error_argument")
    expect_identical(cnd$call[[1]], quote(train_agent))
  }
})

test_that("an agent that asks for nothing plays its behavior policy as it is", {
  trained <- function() {
    agent <- structure(list(), class = c("silent", "gym_agent"))
    quiet_training(agent, iterations = 2, target = Inf)$agent
  }
  .S3method("agent_tell", "silent", function(agent, results) {
    agent$weights <- results$weights
    agent$returns <- c(agent$returns, results$returns)
    agent
  })
  by_default <- trained()
  .S3method("agent_ask", "silent", function(agent) NULL)
  silent <- trained()
  expect_null(silent$weights)
  expect_identical(silent$returns, by_default$returns)
  expect_identical(drop(by_default$weights), coef(silent$policy))
})

test_that("an agent of one's own trains, and goes on from its file", {
  skip_unless_all()
  .S3method("agent_ask", "walk", function(agent) {
    w <- coef(agent_policy(agent))
    rbind(w + rnorm(length(w), sd = agent$size))
  })
  .S3method("agent_tell", "walk", function(agent, results) {
    agent <- NextMethod()
    if (results$returns >= agent$best) {
      agent$best <- results$returns
      coef(agent$policy) <- results$weights[1, ]
    }
    agent
  })
  walk <- structure(list(size = 0.1, best = -Inf), class = c("walk", "gym_agent"))
  play <- function(checkpoint = NULL) {
    quiet_training(walk, iterations = 5, target = Inf, checkpoint = checkpoint,
                   policy = policy_linear(normalize = TRUE))
  }
  undisturbed <- what_counts(play())
  expect_identical(undisturbed$policy$moments$count, 15)
  kept <- local_kept_files()
  play(local_checkpoint())
  for (bytes in kept$list) {
    expect_identical(what_counts(play(local_checkpoint(bytes))), undisturbed)
  }
  expect_output(print(undisturbed$agent), "<agent: walk>", fixed = TRUE)
})

test_that("the log has a row for each iteration, also where a training went on", {
  folder <- withr::local_tempdir()
  path <- local_checkpoint()
  play <- function(iterations) {
    quiet_training(agent_ars(), iterations = iterations, target = Inf, log = file.path(folder, "a"),
                   checkpoint = path)
  }
  play(2)
  trained <- play(4)
  log <- utils::read.csv(file.path(folder, "a", "progress.csv"), check.names = FALSE)
  expect_identical(log[["time/iterations"]], 1:4)
  expect_equal(log[["rollout/ep_rew_mean"]], trained$history$mean_return)
  expect_equal(log[["time/total_timesteps"]], trained$history$steps)
  expect_equal(log[["rollout/ep_len_mean"]], rep(3, 4))
  expect_identical(is.na(log[["eval/mean_reward"]]), c(TRUE, TRUE, FALSE, TRUE))
  config <- jsonlite::read_json(file.path(folder, "a", "config.json"))
  expect_identical(config$env, "Fake-v0")
  expect_identical(config$seed, 1L)
  expect_match(config$agent, "^ARS V2-t")
  # Without a checkpoint the table begins anew, and the one before is kept.
  for (time in 1:2) {
    quiet_training(agent_ars(), iterations = time, log = file.path(folder, "a"))
  }
  rows <- function(name) nrow(utils::read.csv(file.path(folder, "a", name)))
  expect_identical(rows("progress.csv"), 2L)
  expect_identical(rows("progress-1.csv"), 4L)
  expect_identical(rows("progress-2.csv"), 1L)
  file.create(file.path(folder, "file"))
  expect_error(quiet_training(agent_ars(), iterations = 1, log = file.path(folder, "file", "a")),
               "cannot be written", class = "gym_error_argument")
})

test_that("a log that went further than the checkpoint is taken back to it", {
  folder <- withr::local_tempdir()
  kept <- local_kept_files()
  play <- function(path) {
    quiet_training(agent_ars(), iterations = 4, target = Inf, log = folder, checkpoint = path)
  }
  play(local_checkpoint())
  whole <- utils::read.csv(file.path(folder, "progress.csv"))
  play(local_checkpoint(kept$list[[3]]))
  again <- utils::read.csv(file.path(folder, "progress.csv"))
  columns <- setdiff(names(whole), c("time.time_elapsed", "time.fps"))
  expect_identical(again[columns], whole[columns])
})

test_that("a line of the log that a full disk cut is whole again when the training goes on", {
  folder <- withr::local_tempdir()
  kept <- local_kept_files()
  path <- local_checkpoint()
  play <- function(iterations, path) {
    quiet_training(agent_ars(), iterations = iterations, target = Inf, log = folder,
                   checkpoint = path)
  }
  table <- file.path(folder, "progress.csv")
  iterations <- function() utils::read.csv(table)[["time.iterations"]]
  cut_by <- function(n) {
    bytes <- readBin(table, "raw", file.size(table))
    writeBin(bytes[seq_len(length(bytes) - n)], table)
  }
  play(3, path)
  before <- readLines(table)
  cut_by(9)
  play(4, path)
  expect_identical(iterations(), 1:4)
  expect_identical(readLines(table)[1:4], before)
  # The head was cut, and later lines were written behind it.
  lines <- readLines(table)
  writeLines(c(paste0(substr(lines[[1]], 1, 30), lines[[2]]), lines[3:5]), table)
  play(4, local_checkpoint(kept$list[[3]]))
  expect_identical(iterations(), 1:4)
})

test_that("the log has all lines again after one that could not be written", {
  folder <- withr::local_tempdir()
  write <- write_bytes
  local_functions(write_bytes = function(path, bytes, mode) {
    if (mode == "ab" && startsWith(rawToChar(bytes), "2,")) {
      cat("2,10", file = path, append = TRUE)
      stop("No space left on device")
    }
    write(path, bytes, mode)
  })
  expect_warning(
    trained <- quiet_training(agent_ars(), iterations = 4, target = Inf, log = folder),
    class = "gym_warning_log"
  )
  table <- utils::read.csv(file.path(folder, "progress.csv"))
  expect_identical(table[["time.iterations"]], 1:4)
  expect_equal(table[["rollout.ep_rew_mean"]], trained$history$mean_return)
})

test_that("a log that cannot be written in the middle warns once and ends nothing", {
  folder <- withr::local_tempdir()
  calls <- 0L
  callback <- function(training) {
    calls <<- calls + 1L
    if (calls == 2L) unlink(folder, recursive = TRUE)
    TRUE
  }
  warnings <- testthat::capture_warnings(
    trained <- quiet_training(agent_ars(), iterations = 5, target = Inf, log = folder,
                              callback = callback)
  )
  expect_length(warnings, 1)
  expect_match(warnings, "continues without")
  expect_identical(nrow(trained$history), 5L)
})

test_that("what an agent draws when it is told follows from the seed, also after a checkpoint", {
  .S3method("agent_start", "drawing", function(agent, policy) {
    agent <- NextMethod()
    coef(agent$policy) <- rnorm(4)
    agent
  })
  .S3method("agent_ask", "drawing", function(agent) rbind(coef(agent_policy(agent)) + 1))
  .S3method("agent_tell", "drawing", function(agent, results) {
    agent <- NextMethod()
    coef(agent$policy) <- results$weights[1, ] * runif(1)
    agent
  })
  drawing <- structure(list(), class = c("drawing", "gym_agent"))
  play <- function(checkpoint = NULL) {
    quiet_training(drawing, iterations = 4, target = Inf, checkpoint = checkpoint)
  }
  set.seed(1)
  before <- .Random.seed
  first <- what_counts(play())
  expect_identical(.Random.seed, before)
  kept <- local_kept_files()
  expect_identical(what_counts(play(local_checkpoint())), first)
  for (bytes in kept$list) expect_identical(what_counts(play(local_checkpoint(bytes))), first)
  .S3method("agent_start", "drawing", function(agent, policy) NULL)
  expect_error(play(), "`agent_start()` must return an agent", fixed = TRUE,
               class = "gym_error_agent")
})

test_that("the callback is called after every iteration, also the last", {
  calls <- 0L
  trained <- quiet_training(agent_ars(), iterations = 5, target = -100, callback = function(one) {
    calls <<- calls + 1L
    expect_identical(nrow(one$history), calls)
  })
  expect_true(trained$solved)
  expect_identical(calls, nrow(trained$history))
})

test_that("drawn weights are not what the agent draws first", {
  trained <- quiet_training(agent_random(1), policy = policy_network(c(NA, 2, 1)), iterations = 1,
                            target = Inf)
  policy <- policy_network(c(NA, 2, 1))
  start <- bind_with_seed(policy, fake_environment(), 1, rlang::current_env())
  expect_false(any(coef(start) %in% coef(trained)))
})

test_that("a training that had ended keeps where it came from", {
  path <- local_checkpoint()
  play <- function() quiet_training(agent_ars(), iterations = 1, checkpoint = path)
  expect_identical(provenance(play())$started, provenance(play())$started)
})

test_that("weights that are drawn for the environment's sizes follow from the training's seed", {
  play <- function(seed) {
    quiet_training(agent_hill_climb(), policy = policy_network(c(NA, 2, 1)), iterations = 1,
                   seed = seed, target = Inf)
  }
  expect_identical(coef(play(1)), coef(play(1)))
  expect_false(identical(coef(play(1)), coef(play(2))))
  path <- local_checkpoint()
  go <- function() {
    quiet_training(agent_hill_climb(), policy = policy_network(c(NA, 2, 1)), iterations = 1,
                   target = Inf, checkpoint = path)
  }
  expect_identical(coef(go()), coef(go()))
})

test_that("observations that are numbers of a range are not normalized", {
  env <- fake_environment(observation_space = discrete_space(4))
  expect_error(quiet_training(agent_ars(), iterations = 1, env = env), "`version = \"V1-t\"`",
               fixed = TRUE, class = "gym_error_argument")
  trained <- quiet_training(agent_ars(version = "V1-t"), iterations = 1, env = env)
  expect_null(trained$policy$moments)
})

test_that("an agent is told the trajectories that it needs, step by step", {
  told <- NULL
  .S3method("agent_needs", "curious", function(agent) c("returns", "trajectories"))
  .S3method("agent_ask", "curious", function(agent) matrix(c(-1, 1), 2, 4))
  .S3method("agent_tell", "curious", function(agent, results) {
    told <<- results
    agent
  })
  curious <- structure(list(), class = c("curious", "gym_agent"))
  env <- fake_environment(reward = first_action)
  trained <- quiet_training(curious, iterations = 1, episodes = 2, env = env)
  steps <- told$trajectories
  expect_null(told$moments)
  # Two candidates with two episodes of three steps.
  expect_identical(steps$candidate, rep(1:2, each = 6))
  expect_identical(steps$episode, rep(rep(1:2, each = 3), 2))
  expect_equal(as.vector(tapply(steps$reward, steps$candidate, sum)) / 2, told$returns)
  expect_identical(steps$next_observation[1:2, ], steps$observation[2:3, ])
  expect_identical(which(steps$terminated | steps$truncated), c(3L, 6L, 9L, 12L))
  .S3method("agent_needs", "curious", function(agent) "gradients")
  expect_error(quiet_training(curious, iterations = 1), class = "gym_error_agent")
})

test_that("arguments that are wrong are refused before anything is made", {
  skip_unless_all()
  refused <- function(..., name) {
    cnd <- expect_error(train_agent(..., env = "CartPole-v1", client = no_client()),
                        class = "gym_error_argument")
    expect_identical(cnd$argument, name)
  }
  refused(agent_ars, iterations = 1, name = "agent")
  refused("ars", iterations = 1, name = "agent")
  refused(agent_ars(), name = "iterations")
  refused(agent_ars(), iterations = 0, name = "iterations")
  refused(agent_ars(), total_steps = 0.5, name = "total_steps")
  refused(agent_ars(), steps = 100, name = "steps")
  refused(agent_ars(), iterations = 1, solved_by = "luck", name = "solved_by")
  refused(agent_ars(), iterations = 1, solved_by = "candidate", name = "solved_by")
  refused(agent_ars(), iterations = 1, episodes = 0, name = "episodes")
  refused(agent_ars(), iterations = 1, target = "high", name = "target")
  refused(agent_ars(), iterations = 1, eval_every = 0, name = "eval_every")
  refused(agent_ars(), iterations = 1, eval_episodes = 1, name = "eval_episodes")
  refused(agent_ars(), iterations = 1, callback = 3, name = "callback")
  refused(agent_ars(), iterations = 1, seed = 0.5, name = "seed")
  refused(agent_ars(), iterations = 1, policy = "linear", name = "policy")
  refused(agent_ars(), iterations = 1, policy = function(o) 0L, name = "policy")
  refused(agent_ars(), iterations = 1, policy = policy_random(), name = "policy")
  expect_error(train_agent(agent_ars(), "CartPole-v1", iterations = 1, is_round = TRUE,
                           client = test_client()), "is_round", class = "gym_error_http")
})

test_that("a training predicts, and its summary prints the final evaluation", {
  at_last <- function(seed, step, action) if (seed <= 2^30 + 2^29) 10 else 1
  trained <- quiet_training(agent_hill_climb(), iterations = 4, target = 20,
                            env = fake_environment(reward = at_last))
  expect_identical(predict(trained, rbind(1:4)), act(trained$policy, rbind(1:4)))
  expect_output(print(summary(trained)), "\nMean return in [0-9]+ fresh episodes: 3 ")
})

test_that("the progress bar shows iterations, or steps where these are the budget", {
  shown <- list()
  local_functions(progress_bar = function(total, unit, ...) {
    function(finished, note) shown[[length(shown) + 1L]] <<- list(total, unit, finished, note)
  })
  quiet_training(agent_cem(6), iterations = 2, target = Inf, progress = TRUE)
  expect_identical(shown[[2]][1:3], list(2, "Iteration", 2))
  expect_match(shown[[2]][[4]], "median .*, best .*, .* steps/s, ")
  quiet_training(agent_cem(6), total_steps = 30, target = Inf, progress = TRUE)
  expect_identical(shown[[4]][1:3], list(30, "Step", 30))
})

test_that("CartPole is solved", {
  skip_unless_all()
  trained <- train_agent(
    agent_ars(directions = 8, top = 4, step_size = 0.02, noise = 0.05), "CartPole-v1",
    iterations = 40, seed = 1, num_envs = 16, client = test_client()
  )
  expect_true(trained$solved)
  expect_gt(trained$final$mean_return, 450)
})

test_that("a large iteration gets more sub-environments, whoever else's agent has such fields", {
  expect_identical(iteration_candidates(agent_ars(directions = 60)), 120L)
  expect_identical(iteration_candidates(agent_cem(population = 150)), 150L)
  expect_identical(iteration_candidates(agent_random(7)), 7L)
  expect_identical(iteration_candidates(agent_hill_climb(candidates = 9)), 9L)
  own <- structure(list(population = list(1)), class = c("own", "gym_agent"))
  expect_identical(iteration_candidates(own), 0L)
})

test_that("what is misspelt, or not there, is refused with what there is", {
  expect_error(
    train_agent("ppo", "CartPole-v1", iterations = 1), "agent_ppo", class = "gym_error_argument"
  )
  expect_error(
    train_agent(agent_cem(), "CartPole-v1", totalsteps = 10), "Did you mean `total_steps`",
    class = "gym_error_argument"
  )
  expect_error(
    search_ars("CartPole-v1", stepsize = 10), "Did you mean `step_size`",
    class = "gym_error_argument"
  )
  expect_error(
    train_agent(agent_cem(), "CartPole-v1", iterations = 1, seed = 1:3), "`seeds` trains once",
    class = "gym_error_argument"
  )
})

test_that("an argument of the agent given to training says where it goes", {
  expect_error(train_agent(agent_ppo(), fake_environment(), batch_steps = 9, iterations = 1),
               "`agent_ppo(batch_steps = )`", fixed = TRUE, class = "gym_error_argument")
  expect_error(sweep_agent(agent_ppo, fake_environment(), data.frame(gamma = 1), 1:5,
                           batch_steps = 9, iterations = 1),
               "`data.frame(batch_steps = )`", fixed = TRUE, class = "gym_error_argument")
})

test_that("a training in the place of the environment says that this comes first", {
  trained <- quiet_training(agent_hill_climb(), iterations = 1)
  for (f in list(evaluate_policy, rollout)) {
    expect_error(f(trained), "environment comes first.*\"Fake-v0\", training",
                 class = "gym_error_argument")
  }
})

test_that("an evaluation that never ends its episodes is cut off, and says so", {
  never <- fake_environment(ends = function(seed, step, action) step == 3L && seed <= 2^30)
  trained <- NULL
  expect_message(
    trained <- train_agent(agent_hill_climb(), never, iterations = 1, eval_episodes = 2,
                           target = Inf, seed = 1),
    "cut off 2 of 2 episodes after 1,000 steps", class = "gym_message_cut_off"
  )
  expect_identical(trained$final$steps, 2000L)
  state <- list(history = list(list(mean_length = 300), list(mean_length = 120)))
  expect_identical(evaluation_limit(state, never, list()), 3000)
  expect_identical(evaluation_limit(state, never, list(max_steps = 7)), 7)
  expect_identical(evaluation_limit(state, list(spec = list(max_episode_steps = 9)), list()), Inf)
})

test_that("a long training without a progress bar says that it has begun and what it may take", {
  expect_false(inform_of_pace(10, 1e5, "Step", 1))
  expect_false(inform_of_pace(1e5 - 1, 1e5, "Step", 100))
  expect_message(inform_of_pace(1000, 1e5, "Step", 6),
                 "1,000 of 100,000 steps in 6.0 s; at this rate the rest takes 10 min")
  local_binding("pace_after", 0)
  local_binding("pace_left", 0)
  told <- function(...) {
    classes <- character()
    withCallingHandlers(
      train_agent(agent_hill_climb(), fake_environment(), iterations = 3, eval_episodes = 2,
                  target = Inf, ...),
      message = function(cnd) {
        if (inherits(cnd, "gym_message_pace")) classes <<- c(classes, conditionMessage(cnd))
        rlang::cnd_muffle(cnd)
      }
    )
    classes
  }
  expect_match(told(progress = FALSE), "Training has begun|Trained for 1 of 3 iterations")
  expect_length(told(progress = FALSE), 2)
  expect_length(told(progress = TRUE), 0)
  withr::local_options(gym.print_seconds = FALSE)
  expect_length(told(progress = FALSE), 0)
})

test_that("a server that dies in a training leaves the finished part", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  process <- the_session$servers[[server$remote_base]]$process
  kill <- function(training) if (nrow(training$history) == 2) process$kill()
  cnd <- expect_error(
    train_agent(agent_cem(), "CartPole-v1", iterations = 5, episodes = 1, target = Inf, seed = 1,
                callback = kill, client = server),
    class = "gym_error_training"
  )
  expect_s3_class(cnd, "gym_error_connection")
  expect_identical(cnd$result$history$iteration, 1:2)
  expect_match(conditionMessage(cnd$parent), "It was killed", fixed = TRUE)
})
