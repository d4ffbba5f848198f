test_that("a learner trains in the loop of all agents, exactly judged where there is a model", {
  learned <- learn_q(walk_model(), iterations = 20, seed = 1)
  expect_s3_class(learned, "gym_training")
  expect_identical(nrow(learned$history), 20L)
  expect_identical(learned$final$mean_return, 1)
  expect_identical(c(learned$final$se, learned$final$episodes), c(0, 0))
  expect_output(print(learned), "Expected return, by the model: 1", fixed = TRUE)
  expect_identical(predict(learned, 1:2), c(1L, 1L))
  expect_identical(predict(learned, 1:2, type = "output"), learned$agent$weights[2:3, ])
})

test_that("a seed fixes what is learned, and another one gives another table", {
  learn <- function(seed) learn_sarsa(walk_model(), iterations = 10, seed = seed)$agent$weights
  set.seed(7)
  first <- learn(1)
  expect_identical(learn(1), first)
  expect_false(identical(learn(2), first))
})

test_that("a learner goes on from its checkpoint to where an undisturbed one comes", {
  skip_unless_all()
  for (learn in list(
    function(...) learn_q(..., double = TRUE), function(...) learn_q(..., planning = 2),
    function(...) learn_sarsa(..., lambda = 0.5), function(...) learn_monte_carlo(...)
  )) {
    file <- withr::local_tempfile(fileext = ".rds")
    at_once <- learn(walk_model(), iterations = 12, seed = 3)
    learn(walk_model(), iterations = 5, seed = 3, checkpoint = file)
    gone_on <- suppressMessages(learn(walk_model(), iterations = 12, seed = 3, checkpoint = file))
    expect_identical(gone_on$agent, at_once$agent)
    expect_identical(gone_on$final, at_once$final)
  }
})

test_that("prediction comes near to the exact values", {
  skip_unless_all()
  exact <- solve_mdp(walk_model(), policy = policy_random())$values
  for (how in list(list(), list(n = 3), list(lambda = 0.8))) {
    learned <- rlang::exec(
      "learn_td", walk_model(), policy_random(), iterations = 300, discount = 1, seed = 1,
      learning_rate = schedule_exponential(0.5, 0.005, 5000), !!!how
    )
    expect_equal(state_values(learned)[2:3], exact[2:3], tolerance = 0.1)
  }
})

test_that("many sub-environments feed one table", {
  learned <- learn_q(walk_model(), iterations = 10, episodes = 64, num_envs = 16, seed = 1)
  expect_identical(learned$final$mean_return, 1)
  expect_identical(learned$provenance$num_envs, 16L)
})

test_that("a learner plays on the server, and judges by Gymnasium's own table", {
  skip_unless_all()
  learned <- learn_q("CliffWalking-v1", iterations = 40, learning_rate = 0.5, discount = 1,
                     seed = 1, num_envs = 8, model = FALSE, client = test_client())
  expect_identical(learned$final$mean_return, -13)
  expect_identical(learned$final$episodes, 0L)
})

test_that("Tuples have tables, too, and are judged by playing", {
  learned <- learn_monte_carlo("Blackjack-v1", iterations = 5, episodes = 100, discount = 1,
                               seed = 1, eval_episodes = 50, client = test_client())
  # Whole episodes, by the server's processes.
  expect_identical(learned$provenance$way, "beside the environment")
  starts <- learn_monte_carlo("Blackjack-v1", iterations = 1, seed = 1, exploring_starts = TRUE,
                              eval_episodes = 2, client = test_client())
  expect_gt(starts$provenance$num_envs, 1)
  expect_identical(learned$final$episodes, 50L)
  expect_identical(dim(learned$agent$weights), c(32L * 11L * 2L, 2L))
  expect_identical(sum(learned$agent$visited > 0) > 50, TRUE)
})

test_that("how episodes are cut into requests changes nothing that Monte Carlo learns from them", {
  learn <- function() {
    learn_monte_carlo("Blackjack-v1", iterations = 3, discount = 1, seed = 1, eval_episodes = 2,
                      client = test_client())
  }
  learned <- learn()
  # By default an iteration has many episodes.
  expect_gt(learned$steps, 3000)
  local_functions(
    next_size = function(units, seconds, wanted) 70L, first_size = function(play) 70L
  )
  set.seed(1)
  before <- .Random.seed
  again <- learn()
  expect_identical(again$policy$q, learned$policy$q)
  expect_identical(again$history[-9L], learned$history[-9L])
  expect_identical(.Random.seed, before)
})

test_that("`max_steps` truncates, and the value of what follows counts", {
  skip_unless_all()
  # Going on pays 1 each step without an end: the value is 1 / (1 - 0.5).
  model <- gym_model(data.frame(state = 0, action = 0, next_state = 0, reward = 1))
  learned <- learn_q(model, iterations = 30, discount = 0.5, learning_rate = 0.5, max_steps = 4,
                     seed = 1)
  expect_equal(state_values(learned), c("0" = 2), tolerance = 1e-6)
})

test_that("the true next observation is learned from in all autoreset modes", {
  skip_unless_all()
  # Each episode of the lake that does not slip ends at the goal or in a hole; a learner that took
  # the first state of the next episode for what follows would add its value.
  client <- test_client()
  for (mode in c("NextStep", "SameStep", "Disabled")) {
    env <- gym_make("FrozenLake-v1", num_envs = 4, autoreset_mode = mode, is_slippery = FALSE,
                    max_episode_steps = 3, seed = 1, client = client)
    withr::defer(env$close())
    learned <- learn_td(env, function(state) rep(2L, length(state)), iterations = 40,
                        learning_rate = 0.5, discount = 0.5, initial = 1, seed = 1)
    # To the right: 0, 1, 2, 3, where it stays and is cut off with its value still 1, which halves
    # with each step, as no reward comes.
    values <- state_values(learned)
    expect_lt(values[["2"]], 1)
    expect_equal(values[["3"]], 1)
    expect_equal(values[["2"]], 0.5 * values[["3"]], tolerance = 1e-3)
    expect_equal(values[["0"]], 0.125 * values[["3"]], tolerance = 1e-3)
  }
})

test_that("a learner of one's own is a class with two methods", {
  counter <- structure(list(seen = 0), class = c("counter", "gym_learner", "gym_agent"))
  registerS3method("agent_act", "counter", function(agent, observation, sub_env) {
    rep(1L, length(sub_env))
  }, envir = asNamespace("gym"))
  registerS3method("agent_observe", "counter", function(agent, transitions) {
    agent$seen <- agent$seen + length(transitions$reward)
    agent
  }, envir = asNamespace("gym"))
  registerS3method("agent_policy", "counter", function(agent) c(1, 1, 1, 1),
                   envir = asNamespace("gym"))
  trained <- train_agent(counter, walk_model(), iterations = 3, episodes = 5, seed = 1)
  expect_identical(trained$agent$seen, 30)
  expect_identical(trained$steps, 30)
  wrong <- structure(list(), class = c("wrong", "gym_learner", "gym_agent"))
  registerS3method("agent_act", "wrong", function(agent, observation, sub_env) 1L,
                   envir = asNamespace("gym"))
  registerS3method("agent_observe", "wrong", function(agent, transitions) 3,
                   envir = asNamespace("gym"))
  expect_error(train_agent(wrong, walk_model(), iterations = 1), class = "gym_error_agent")
})

test_that("a checkpoint tells schedules and models apart", {
  file <- withr::local_tempfile(fileext = ".rds")
  learn <- function(model, from) {
    learn_q(model, iterations = 2, seed = 1, checkpoint = file,
            epsilon = schedule_linear(from, 0.05, 10))
  }
  learn(walk_model(), 1)
  expect_error(learn(walk_model(), 0.5), "`agent` is a different one",
               class = "gym_error_checkpoint")
  other <- walk_table()
  other$reward <- 2 * other$reward
  expect_error(learn(gym_model(other, start = 1), 1), "`env` is a different one",
               class = "gym_error_checkpoint")
})

test_that("an exact evaluation keeps to the environment's own limit", {
  endless <- gym_model(data.frame(state = 0, action = 0, next_state = 0, reward = 1),
                       max_episode_steps = 10)
  learned <- suppressWarnings(learn_q(endless, iterations = 1, max_steps = 100, seed = 1))
  expect_identical(learned$final$mean_return, 10)
})

test_that("a policy that draws is judged by playing", {
  draws <- function(state) sample(0:1, length(state), replace = TRUE)
  learned <- learn_td(walk_model(), draws, iterations = 2, seed = 1, eval_episodes = 20)
  expect_identical(learned$final$episodes, 20L)
})

test_that("an action that a state does not have is never taken", {
  bets <- do.call(rbind, lapply(1:9, function(capital) {
    stake <- seq_len(min(capital, 10 - capital))
    data.frame(
      state = capital, action = rep(stake, 2),
      probability = rep(c(0.4, 0.6), each = length(stake)),
      next_state = c(capital + stake, capital - stake)
    )
  }))
  bets$reward <- as.numeric(bets$next_state == 10)
  gambler <- gym_model(bets, start = 5)
  for (learn in list(learn_q, learn_sarsa, function(...) learn_q(..., double = TRUE))) {
    learned <- learn(gambler, iterations = 5, seed = 1, discount = 1, epsilon = 0.5)
    expect_identical(learned$agent$weights == -Inf, !possible_actions(gambler) & 0:10 %in% 1:9)
  }
  explores <- learn_monte_carlo(gambler, iterations = 5, seed = 1, exploring_starts = TRUE)
  expect_gt(explores$steps, 0)
})

test_that("rewards that are no numbers end the training by name", {
  wrong <- gym_env(
    reset = function(self) 0L,
    step = function(self, action) list(observation = 0L, reward = Inf, terminated = TRUE),
    observation_space = space_discrete(2), action_space = space_discrete(2)
  )
  expect_error(learn_q(wrong, iterations = 1), class = "gym_error_agent")
})

test_that("a learner that knows nothing yet does not walk against one wall", {
  # Twelve states in a row. Only the third action leads on, and only the last step pays: who draws
  # needs 48 steps on average, who takes the first action but where epsilon explores 480.
  steps <- expand.grid(action = 0:3, state = 0:11)
  steps$next_state <- steps$state + (steps$action == 2)
  steps$reward <- as.numeric(steps$next_state == 12)
  learned <- learn_q(gym_model(steps, start = 0), iterations = 1, episodes = 1, seed = 1)
  expect_lt(learned$history$mean_length, 150)
})

test_that("exact evaluations in a large model are a tenth of the work, and they are told", {
  line <- data.frame(state = 1:599, action = 0, next_state = 2:600, reward = -1)
  model <- gym_model(line, start = 550, max_episode_steps = 500)
  learn <- function(iterations, ...) {
    learn_q(model, iterations = iterations, episodes = 20, eval_every = 1, seed = 1, target = Inf,
            ...)
  }
  learned <- learn(16)
  # 600 states times 500 sweeps, of which a step is worth 50. An iteration has 1,000 steps.
  expect_identical(learned$rules$eval_steps, 6000)
  expect_identical(learned$evaluations$iteration, c(0L, 6L, 12L, 16L))
  expect_output(print(learned), "Evaluated 4 times: eval_every 1, at least 6,000 steps apart")
  file <- tempfile(fileext = ".rds")
  on.exit(unlink(file))
  learn(8, checkpoint = file)
  resumed <- learn(16, checkpoint = file)
  expect_identical(resumed$evaluations, learned$evaluations)
  expect_identical(learn_q(walk_model(), iterations = 3, max_steps = 50, eval_every = 1,
                           seed = 1, target = Inf)$evaluations$iteration, c(0:3, 3L))
})

test_that("an iteration is evaluated exactly once, for the curve, the end and the result", {
  model <- walk_model(max_episode_steps = 50)
  calls <- 0
  suppressMessages(trace(
    "evaluate_exactly", function() calls <<- calls + 1, where = asNamespace("gym"), print = FALSE
  ))
  on.exit(suppressMessages(untrace("evaluate_exactly", where = asNamespace("gym"))))
  learned <- learn_q(model, iterations = 50, eval_every = 1, seed = 1, target = 1)
  expect_true(learned$stopped_early)
  at <- learned$evaluations
  expect_true(all(c("stopping", "final") %in% at$kind))
  expect_identical(calls, as.double(length(unique(at$iteration))))
})
