test_that("the first round whose mean reaches the target ends the search", {
  env <- scripted_environment(c(1, 2, 3, 10, 20, 30, 20, 20, 20, 100, 100, 100))
  search <- search_random(env, rounds = 4, episodes = 3, target = 20)
  expect_true(search$solved)
  expect_identical(search$round, 2L)
  expect_identical(
    search$rounds, data.frame(round = 1:2, mean_return = c(2, 20), steps = c(3L, 3L))
  )
  expect_identical(search$episodes$return, c(1, 2, 3, 10, 20, 30))
  expect_identical(search$episodes$round, rep(1:2, each = 3))
  expect_identical(search$episodes$episode, rep(1:3, 2))
  expect_identical(as.data.frame(search), search$episodes)
})

test_that("the mean counts equal returns as often as they came", {
  env <- scripted_environment(c(0, 30, 30, 30, 30, 30, 30, 30, 30, 30))
  search <- search_random(env, rounds = 2, episodes = 5, target = 24)
  expect_identical(search$rounds$mean_return, 24)
})

test_that("without the target reached the best round is returned, of equal ones the first", {
  env <- scripted_environment(c(5, 7, 3, 7))
  search <- search_random(env, rounds = 4, episodes = 1, target = 100)
  expect_false(search$solved)
  expect_identical(search$round, 2L)
  expect_identical(nrow(search$rounds), 4L)
})

test_that("the target is the environment's threshold unless one is given", {
  env <- scripted_environment(rep(7, 5), reward_threshold = 7)
  search <- search_random(env, rounds = 5, episodes = 1)
  expect_identical(search$target, 7)
  expect_identical(nrow(search$rounds), 1L)
})

test_that("without a threshold, or with target = Inf, nothing stops early", {
  search <- search_random(scripted_environment(1:5), rounds = 5, episodes = 1)
  expect_null(search$target)
  expect_false(search$solved)
  expect_identical(nrow(search$rounds), 5L)
  env <- scripted_environment(1:5, reward_threshold = 1)
  search <- search_random(env, rounds = 5, episodes = 1, target = Inf)
  expect_identical(search$round, 5L)
})

test_that("the policy returned is the one that was played in its round", {
  env <- fake_environment(reward = first_action)
  search <- search_random(env, rounds = 10, episodes = 3, target = Inf, seed = 1)
  again <- vapply(
    search$episodes$seed[search$episodes$round == search$round],
    function(seed) {
      action <- act(search$policy, env$reset(seed = seed))
      env$step(action)$reward
    },
    numeric(1)
  )
  expect_identical(again, search$episodes$return[search$episodes$round == search$round])
})

test_that("each round draws fresh weights, the first too", {
  env <- fake_environment()
  template <- policy_network(c(4, 1), weights = list(matrix(5, 1, 4)))
  weights <- vapply(1:5, function(i) {
    search_random(env, template, rounds = 1, episodes = 1)$policy$weights[[1]][[1]]
  }, numeric(1))
  expect_length(unique(weights), 5)
  expect_true(all(abs(weights) <= 1))
})

test_that("a search is a training by the tutorial's rule", {
  env <- fake_environment(reward = first_action)
  search <- search_random(env, rounds = 9, target = 13, seed = 2)
  trained <- train_agent(agent_random(), env, policy_network(), iterations = 9L, episodes = 5,
                         target = 13, seed = 2, solved_by = "candidate")
  expect_s3_class(trained, c("gym_search", "gym_training"), exact = TRUE)
  same <- setdiff(names(search), c("elapsed", "template", "max_rounds", "provenance"))
  expect_identical(trained[same], search[same])
  expect_identical(search$history$iteration, search$rounds$round)
  expect_identical(search$history$steps, cumsum(as.numeric(search$rounds$steps)))
  expect_identical(nrow(search$evaluations), 0L)
})

test_that("a search logs its rounds, and calls back after those that were played together", {
  folder <- withr::local_tempdir()
  seen <- integer()
  trained <- train_agent(
    agent_random(), fake_vector_env(4, "sync", reward = first_action), policy_network(),
    iterations = 9, episodes = 4, target = Inf, seed = 2, solved_by = "candidate", log = folder,
    callback = function(search) {
      seen <<- c(seen, nrow(search$rounds))
      TRUE
    }
  )
  # A batch of 16 episodes has room for four rounds.
  expect_identical(seen, c(4L, 8L, 9L))
  log <- utils::read.csv(file.path(folder, "progress.csv"))
  expect_identical(log$time.iterations, 1:9)
  expect_equal(log$rollout.ep_rew_mean, trained$rounds$mean_return)
})

test_that("many searches are trainings, too, and each says whether it was solved", {
  env <- fake_environment(reward = first_action)
  trained <- train_agent(agent_random(), env, policy_network(), iterations = 4, episodes = 3,
                         target = 11, seeds = 1:4, solved_by = "candidate")
  searches <- search_random(env, rounds = 4, episodes = 3, target = 11, seeds = 1:4)
  for (i in 1:4) {
    alone <- search_random(env, rounds = 4, episodes = 3, target = 11, seed = i)
    parts <- c("solved", "round", "rounds", "episodes", "policy")
    expect_identical(trained$trainings[[i]][parts], alone[parts])
    expect_identical(searches$trainings[[i]][parts], alone[parts])
  }
  expect_setequal(as.data.frame(searches)$reached, c(TRUE, FALSE))
  expect_output(print(trained), "Reached the target 11 with [0-9] of 4 seeds")
})

test_that("set.seed() alone fixes a search, whose seed gives it again and moves no generator", {
  figures <- function(search) search[c("policy", "rounds", "episodes", "round", "seed")]
  env <- fake_environment(reward = first_action)
  set.seed(5)
  first <- figures(search_random(env, rounds = 4))
  set.seed(5)
  expect_identical(figures(search_random(env, rounds = 4)), first)
  state <- .Random.seed
  expect_identical(figures(search_random(env, rounds = 4, seed = first$seed)), first)
  expect_identical(.Random.seed, state)
  # A template's own weights make no difference, wherever they were drawn.
  policy <- policy_network()
  expect_identical(figures(search_random(env, policy, rounds = 4, seed = first$seed)), first)
  expect_false(identical(figures(search_random(env, rounds = 4, seed = 6)), first))
})

test_that("a search draws one number from the session's generator, the policy in its call none", {
  env <- fake_environment(reward = first_action)
  set.seed(5)
  draw_seed()
  wanted <- .Random.seed
  set.seed(5)
  search_random(env, policy_network(), rounds = 2)
  expect_identical(.Random.seed, wanted)
})

test_that("a seed means one search under every RNGkind()", {
  env <- fake_environment(reward = first_action)
  withr::local_preserve_seed()
  play <- function(...) {
    suppressWarnings(RNGkind(...))
    search_random(env, rounds = 3, target = Inf, seed = 1)[c("policy", "episodes")]
  }
  first <- play("Mersenne-Twister", "Inversion", "Rejection")
  expect_identical(play("Wichmann-Hill", "Box-Muller", "Rounding"), first)
  expect_identical(play("Marsaglia-Multicarry", "Ahrens-Dieter"), first)
  expect_identical(play("L'Ecuyer-CMRG", "Kinderman-Ramage"), first)
  expect_identical(RNGkind()[1:2], c("L'Ecuyer-CMRG", "Kinderman-Ramage"))
})

test_that("a shorter search is the beginning of a longer one", {
  env <- fake_environment(reward = first_action)
  short <- search_random(env, rounds = 3, target = Inf, seed = 1)
  long <- search_random(env, rounds = 9, target = Inf, seed = 1)
  expect_identical(long$episodes[long$episodes$round <= 3, ], short$episodes)
})

test_that("max_steps reaches the episodes", {
  search <- search_random(fake_environment(), rounds = 2, max_steps = 2, target = Inf)
  expect_identical(unique(search$episodes$length), 2L)
  expect_true(all(search$episodes$truncated))
})

test_that("bad arguments are refused before anything is made, naming argument and value", {
  bad <- function(..., message) {
    expect_error(search_random(..., client = no_client()), message, fixed = TRUE,
                 class = "gym_error_argument")
  }
  bad(rounds = 0, message = "`rounds` must be a whole number of at least 1, not 0.")
  bad(rounds = -1, message = "`rounds` must be a whole number of at least 1, not -1.")
  bad(rounds = 2.5, message = "`rounds` must be a whole number of at least 1, not 2.5.")
  bad(episodes = 0, message = "`episodes`")
  bad(target = NA, message = "`target` must be a number or NULL, not NA.")
  bad(target = "high", message = "`target`")
  bad(max_steps = 0, message = "`max_steps`")
  bad(seed = 1.5, message = "`seed`")
  bad(progress = 1, message = "`progress`")
  bad(env = NA, message = "`env`")
  bad(policy = 3, message = "`policy`")
  bad(policy = policy_random(), message = "`policy` must be a policy with weights, not random.")
  bad(policy = function(observation) 1, message = "not a function")
})

test_that("sizes that do not fit are refused with both numbers before a step is taken", {
  env <- fake_environment(id = "CartPole-v1")
  expect_error(search_random(env, policy_network(c(3, 2, 1))),
               "The network takes 3 inputs, but an observation of CartPole-v1 has 4 numbers.",
               fixed = TRUE,
               class = "gym_error_argument")
  expect_length(env$seeds, 0)
})

test_that("an interrupt returns the rounds that were finished, with a message", {
  env <- scripted_environment(c(1, 2, 3, 4, 5))
  step <- env$step
  env$step <- function(action) if (length(env$seeds) == 5L) rlang::interrupt() else step(action)
  expect_message(
    search <- search_random(env, rounds = 9, episodes = 2, target = Inf),
    "interrupted after 2 of 9 rounds", class = "gym_message_interrupted"
  )
  expect_true(search$interrupted)
  expect_identical(search$rounds$mean_return, c(1.5, 3.5))
  expect_identical(search$round, 2L)
  expect_output(print(search), "Interrupted after 2 rounds, 4 steps", fixed = TRUE)
})

test_that("an interrupt in the first round leaves a search that says it has nothing", {
  env <- fake_environment()
  env$step <- function(action) rlang::interrupt()
  suppressMessages(search <- search_random(env))
  expect_null(search$policy)
  expect_false(search$solved)
  expect_identical(search$round, NA_integer_)
  expect_identical(nrow(search$episodes), 0L)
  expect_output(print(search), "before the first round")
  expect_error(summary(search), "no policy", class = "gym_error_argument")
  expect_error(predict(search, 1:4), "no policy", class = "gym_error_argument")
  expect_error(plot(search), "nothing to plot", class = "gym_error_argument")
})

test_that("an error in the middle carries what was played, with its own classes and fields", {
  env <- scripted_environment(c(1, 2, 3, 4, 5))
  step <- env$step
  env$step <- function(action) {
    if (length(env$seeds) < 5L) return(step(action))
    gym_abort("lost", class = "gym_error_connection", url = "http://there")
  }
  cnd <- tryCatch(search_random(env, episodes = 2, target = Inf), gym_error_search = identity)
  expect_s3_class(cnd, "gym_error_connection")
  expect_s3_class(cnd, "gym_error")
  expect_identical(cnd$url, "http://there")
  expect_identical(cnd$result$rounds$mean_return, c(1.5, 3.5))
  expect_identical(cnd$result$round, 2L)
  expect_match(conditionMessage(cnd), "after 2 of 50 rounds")
  expect_identical(conditionMessage(cnd$parent), "lost")
  expect_false(cnd$result$interrupted)
})

test_that("a progress bar is shown when asked for and nothing is said otherwise", {
  skip_unless_all()
  expect_silent(search_random(fake_environment(), rounds = 2, progress = FALSE))
  withr::local_options(cli.progress_show_after = 0, cli.dynamic = FALSE, cli.num_colors = 1)
  env <- fake_environment()
  step <- env$step
  env$step <- function(action) {
    Sys.sleep(0.005)
    step(action)
  }
  shown <- capture.output(
    search <- search_random(env, rounds = 20, progress = TRUE), type = "message"
  )
  expect_match(paste(shown, collapse = " "), "Round [0-9]+ of 20 .*best mean return 3")
})

test_that("CartPole: the default search solves it, and the same seed gives the same search", {
  client <- test_client()
  search <- search_random(seed = 1, client = client)
  expect_true(search$solved)
  expect_identical(search$env_id, "CartPole-v0")
  expect_identical(search$target, 195)
  expect_gte(search$rounds$mean_return[[search$round]], 195)
  expect_lte(max(search$episodes$return), 200)
  again <- search_random(seed = 1, client = client)
  expect_identical(again$episodes, search$episodes)
  expect_identical(again$policy, search$policy)
})

test_that("no instance stays open on the server, whatever ends a search", {
  skip_unless_all()
  client <- local_server()
  open <- function() length(env_list_all(client))
  search_random(rounds = 1, client = client)
  expect_identical(open(), 0L)
  expect_error(search_random(policy = policy_network(c(3, 1)), client = client),
               class = "gym_error_argument")
  expect_identical(open(), 0L)
})

test_that("a server that stops in the middle ends the search with what was played", {
  skip_unless_all()
  server <- local_server()
  env <- gym_make("CartPole-v1", client = server)
  fragile <- list(
    spec = env$spec, client = server,
    observation_space = env$observation_space, action_space = env$action_space,
    reset = env$reset, close = env$close
  )
  count <- 0L
  fragile$step <- function(action) {
    count <<- count + 1L
    if (count == 600L) gym_server_stop(server)
    env$step(action)
  }
  cnd <- tryCatch(search_random(fragile, seed = 1, target = Inf), gym_error_search = identity)
  expect_match(conditionMessage(cnd), "on a server that has ended")
  expect_lt(sum(cnd$result$rounds$steps), 600)
  expect_gt(nrow(cnd$result$rounds), 0)
})

test_that("only who names an environment that is out of date is told so", {
  withr::local_options(rlib_warning_verbosity = "verbose")
  client <- test_client()
  searched <- function(search, ...) {
    # As if it were asked for the first time.
    state <- client_state(client)
    state$described <- new.env()
    search(..., rounds = 1, episodes = 1, client = client)
  }
  expect_no_warning(searched(search_random, seed = 1))
  expect_no_warning(searched(search_random, seeds = 1))
  warned <- expect_warning(
    searched(search_random, "CartPole-v0", seed = 1), class = "gym_warning_gymnasium"
  )
  expect_match(conditionMessage(warned), "^The environment CartPole-v0 is out of date")
})
