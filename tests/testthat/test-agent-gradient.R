quiet_learning <- function(...) {
  suppressMessages(train_agent(..., eval_episodes = 2, eval_every = 1000, target = Inf))
}

# What differs between two runs of the same training.
same_training <- function(x, y) {
  of <- function(training) {
    training$history$elapsed <- training$elapsed <- training$provenance <- NULL
    training[c("policy", "agent", "history", "steps", "final")]
  }
  expect_identical(of(x), of(y))
}

small_policy <- function(output = NA) {
  policy_network(c(NA, 8, NA), c("tanh", "identity"), bias = TRUE, normalize = TRUE,
                 output = output, init = "orthogonal")
}

test_that("a training that was cut goes on bit for bit, DQN with its memory", {
  skip_unless_all()
  skip_if_no_server()
  agents <- list(
    agent_reinforce(batch_steps = 200, learning_rate = schedule_linear(0.02, 0, 5000)),
    agent_ppo(batch_steps = 200, batch = 50, epochs = 2, normalize_rewards = TRUE),
    # Three episodes fill the memory, so its oldest steps are overwritten several times.
    agent_dqn(memory = 60, learning_starts = 50, batch = 8, updates_per_step = 0.3,
              target_every = 20)
  )
  for (agent in agents) {
    file <- withr::local_tempfile(fileext = ".rds")
    learn <- function(iterations, ...) {
      policy <- small_policy(if (inherits(agent, "gym_agent_dqn")) "epsilon-greedy" else NA)
      quiet_learning(agent, "CartPole-v1", policy, iterations = iterations, seed = 3, ...)
    }
    whole <- learn(9)
    learn(2, checkpoint = file)
    learn(6, checkpoint = file)
    cut <- learn(9, checkpoint = file)
    same_training(cut, whole)
    # One that has ended is read from its file, the memory too.
    same_training(learn(9, checkpoint = file), whole)
    expect_false(identical(coef(learn(8)), coef(whole)))
  }
})

test_that("a checkpoint whose memory is in other files is refused in words", {
  file <- withr::local_tempfile(fileext = ".rds")
  write_checkpoint(file, list(training = list(agent = list(memory = list(room = 1024)))))
  expect_error(read_checkpoint(file, NULL), "keeps its memory in other files",
               class = "gym_error_checkpoint")
})

# An agent in an environment with one number and two actions, whose networks give 10 for everything.
started <- function(agent, value = 10) {
  dqn <- inherits(agent, "gym_agent_dqn")
  env <- fake_environment(observation_space = box_space(0, 1))
  output <- if (dqn) "epsilon-greedy" else "softmax"
  policy <- policy_network(c(NA, NA), "identity", bias = TRUE, output = output)
  policy <- policy_bind(policy, env)
  coef(policy) <- c(0, 0, rep(if (dqn) value else 0, 2))
  agent <- agent_start(agent, policy)
  if (!is.null(agent$value)) coef(agent$value) <- c(0, value)
  agent
}

# Two episodes of three steps without rewards.
told <- function(terminated, reward = numeric(6)) {
  last <- rep(c(FALSE, FALSE, TRUE), 2)
  list(trajectories = list(
    candidate = rep(1L, 6), episode = rep(1:2, each = 3), observation = matrix(0.5, 6, 1),
    action = rep(0:1, 3), reward = reward, terminated = last & terminated,
    truncated = last & !terminated, next_observation = matrix(0.5, 6, 1)
  ))
}

test_that("an episode that was truncated keeps the value of its last state, a terminated one not", {
  set.seed(1)
  loss <- function(agent, terminated, name = "value_loss") {
    agent_tell(started(agent), told(terminated))$log[[name]]
  }
  ppo <- agent_ppo(gamma = 1, lambda = 1, epochs = 1, batch = Inf)
  reinforce <- agent_reinforce(gamma = 1)
  for (agent in list(ppo, reinforce)) {
    expect_equal(loss(agent, terminated = FALSE), 0)
    expect_equal(loss(agent, terminated = TRUE), 100)
  }
  # Huber's loss of an error of 10, in the last of three steps.
  dqn <- agent_dqn(gamma = 1, learning_starts = 0, batch = 600, updates_per_step = 1 / 6,
                   memory = 600)
  expect_equal(loss(dqn, terminated = FALSE, "loss"), 0)
  expect_equal(loss(dqn, terminated = TRUE, "loss"), 9.5 / 3, tolerance = 0.1)
  # Without a baseline nothing is to come after either.
  blind <- agent_reinforce(gamma = 1, baseline = FALSE)
  expect_identical(
    coef(agent_tell(started(blind), told(TRUE, rnorm(6)))$policy) == 0, rep(FALSE, 4)
  )
})

test_that("random episodes are played before observations are normalized", {
  policy <- policy_bind(small_policy("softmax"), fake_environment())
  begun <- agent_start(agent_ppo(min_episodes = 2), policy)
  expect_s3_class(agent_behavior(begun), "gym_policy_random")
  expect_equal(agent_episodes(begun, 1), warm_up_episodes)
  begun$policy$moments <- moments_of(matrix(rnorm(8), 2))
  expect_identical(agent_behavior(begun), begun$policy)
})

test_that("an iteration is learned from with the moments that it was played with", {
  # Moments of so many observations that new ones do not change them teach the same.
  learned <- function(agent, count) {
    set.seed(1)
    agent <- started(agent)
    agent$policy$moments <- new_moments(count, 3, 4 * (count - 1))
    agent_tell(agent, told(TRUE, 1:6))
  }
  for (agent in list(agent_ppo(), agent_reinforce(), agent_dqn(learning_starts = 0))) {
    few <- learned(agent, 10)
    expect_identical(coef(few$policy), coef(learned(agent, 1e12)$policy))
    expect_lt(few$policy$moments$mean, 2.5)
  }
})

test_that("how many episodes an iteration has follows from the last one", {
  next_episodes <- function(agent) agent_episodes(agent_tell(started(agent), told(TRUE)), 1)
  # Episodes had three steps; there were two of them.
  expect_identical(next_episodes(agent_ppo(batch_steps = 16, batch = 8, min_episodes = 2)), 5L)
  expect_identical(next_episodes(agent_ppo(batch_steps = 999, min_episodes = 2)), 8L)
  expect_identical(next_episodes(agent_ppo(batch_steps = 64)), 8L)
  expect_identical(next_episodes(agent_dqn()), 1L)
})

test_that("settings are those of an iteration's first step, and no update of DQN is lost", {
  set.seed(1)
  falling <- schedule_linear(1, 0, 12)
  agent <- started(agent_dqn(learning_starts = 0, batch = 2, memory = 60, updates_per_step = 0.3,
                             epsilon = falling, learning_rate = falling))
  expect_identical(agent_behavior(agent)$epsilon, 1)
  # 1.8 updates are due after six steps, 3.6 after twelve, 5.4 after eighteen.
  logged <- lapply(1:3, function(iteration) {
    agent <<- agent_tell(agent, told(TRUE))
    agent$log[c("n_updates", "exploration_rate", "learning_rate")]
  })
  expect_equal(unname(do.call(rbind, logged)), rbind(c(1, 1, 1), c(3, 0.5, 0.5), c(5, 0, 0)))
  expect_equal(agent$carried, 0.4)
  expect_identical(agent_behavior(agent)$epsilon, 0)
})

test_that("DQN plays before it learns, for as many steps as asked", {
  agent <- started(agent_dqn(learning_starts = 7, batch = 2, memory = 60))
  after <- agent_tell(agent, told(TRUE))
  expect_identical(after$updates, 0)
  expect_identical(agent_tell(after, told(TRUE))$updates, 3)
})

test_that("PPO in one pass over all steps without a clip follows the gradient of A2C", {
  set.seed(1)
  policy <- policy_network(c(3, 5, 2), bias = TRUE, output = "softmax")
  value <- value_network(policy)
  observation <- matrix(rnorm(30), 10)
  action <- act(policy, observation)
  expected <- predict(value, observation, "output")
  return <- expected + rnorm(10)
  advantage <- return - expected
  settings <- agent_ppo(epochs = 1, batch = Inf, clip = Inf, normalize_advantages = FALSE)
  found <- ppo_gradient(policy, value, c(coef(policy), coef(value)), list(
    inputs = t(observation), action = action + 1L, advantage = advantage, return = return,
    log_prob = policy_log_prob(policy, observation, action)
  ), settings)
  expect_equal(found$gradient, c(
    policy_log_prob_gradient(policy, observation, action, -advantage / 10),
    policy_output_gradient(value, observation, -advantage / 10)
  ))
})

test_that("minibatches are nearly equal and have each step once", {
  set.seed(1)
  for (batch in c(7, 64, 1000, Inf)) {
    batches <- draw_minibatches(100, batch)
    expect_length(batches, max(1, round(100 / batch)))
    expect_lte(diff(range(lengths(batches))), 1)
    expect_setequal(unlist(batches), 1:100)
  }
})

test_that("the gradient of PPO's loss is that of central differences, clipped or not", {
  set.seed(1)
  for (output in c("softmax", "gaussian")) {
    gaussian <- output == "gaussian"
    policy <- policy_network(c(3, 5, 2), bias = TRUE, output = output, log_std = -0.3)
    value <- value_network(policy)
    count <- count_weights(policy)
    weights <- c(coef(policy), coef(value))
    n <- 12
    batch <- list(
      inputs = matrix(rnorm(3 * n), 3),
      action = if (gaussian) matrix(rnorm(2 * n), 2) else sample.int(2, n, TRUE),
      advantage = rnorm(n), return = rnorm(n)
    )
    played <- forward_draws(policy, weights, batch$inputs, batch$action)$draws$log_prob
    batch$log_prob <- played + rnorm(n, sd = 0.4)
    settings <- agent_ppo(entropy = 0.1, clip = 0.3)
    found <- ppo_gradient(policy, value, weights, batch, settings)
    expect_gt(found$log[["clip_fraction"]], 0.1)
    expect_lt(found$log[["clip_fraction"]], 1)
    wanted <- vapply(seq_along(weights), function(i) {
      at <- function(by) {
        near <- replace(weights, i, weights[[i]] + by)
        ppo_gradient(policy, value, near, batch, settings)$log[["loss"]]
      }
      (at(1e-6) - at(-1e-6)) / 2e-6
    }, 0)
    expect_equal(found$gradient, wanted, tolerance = 1e-6)
  }
})

test_that("learning ends where the policy has moved too far, and where weights are NaN", {
  set.seed(1)
  started_ppo <- started(agent_ppo(target_kl = 1e-9, epochs = 50, learning_rate = 0.1))
  far <- agent_tell(started_ppo, told(TRUE, rnorm(6)))
  expect_identical(far$adam$steps, 1)
  for (agent in list(agent_ppo(), agent_reinforce(), agent_dqn(learning_starts = 0))) {
    cnd <- expect_error(agent_tell(started(agent), told(TRUE, rep(NaN, 6))), "in iteration 1",
                        class = "gym_error_agent")
    expect_identical(cnd$iteration, 1L)
  }
})

test_that("a training whose weights become NaN ends with the last good ones", {
  env <- fake_environment(observation_space = box_space(0, 1))
  jumps <- function(steps) if (steps < 60) 0.01 else Inf
  learn <- function(iterations, rate = jumps) {
    agent <- agent_ppo(batch_steps = 24, batch = 8, epochs = 3, learning_rate = rate)
    policy <- policy_network(c(NA, NA), "identity", output = NA)
    quiet_learning(agent, env, policy, iterations = iterations, seed = 1)
  }
  # Iterations of 24 steps: the fourth is the first with 60 steps before it.
  cnd <- expect_error(learn(9), "in iteration 4", class = "gym_error_agent")
  expect_identical(cnd$iteration, 4L)
  expect_identical(coef(cnd$result$policy), coef(learn(3)$policy))
  # Returns that are not finite are found before anything is learned from them.
  broken <- fake_environment(function(seed, step, action) if (step == 2L) Inf else 1)
  expect_error(quiet_learning(agent_ppo(), broken, iterations = 1), "not a finite number",
               class = "gym_error_agent")
})

test_that("agents refuse policies, spaces and settings that they cannot learn with", {
  box <- fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))
  refused <- function(agent, policy, env, words) {
    expect_error(quiet_learning(agent, env, policy, iterations = 1), words,
                 class = "gym_error_argument")
  }
  greedy <- policy_network(c(NA, NA), "identity")
  refused(agent_ppo(), greedy, box, "with standard deviations")
  refused(agent_reinforce(), greedy, fake_environment(), "a policy that draws")
  refused(agent_dqn(), policy_network(c(NA, NA), output = NA), box, "each action of a Discrete")
  refused(agent_dqn(), greedy, fake_environment(), "a value for each of 2 actions")
  picture <- fake_environment(observation_space = space_box(0, 1, shape = c(2, 2)))
  refused(agent_ppo(), NULL, picture, "gym_wrap\\(env, \"FlattenObservation\"\\)")
  screen <- fake_environment(observation_space = space_box(0, 255, shape = c(4, 4, 3)),
                             id = "ALE/Breakout-v5")
  refused(agent_dqn(), NULL, screen, "obs_type = \"ram\".*ResizeObservation")
  expect_error(agent_ppo(batch = 99, batch_steps = 64), "`batch` must be at most",
               class = "gym_error_argument")
  expect_error(agent_dqn(batch = 99, memory = 64), class = "gym_error_argument")
  expect_error(agent_ppo(learning_rate = "fast"), class = "gym_error_argument")
})

test_that("learning CartPole reaches its goal; what was evaluated is what is returned", {
  skip_unless_all()
  skip_if_no_server()
  trained <- suppressMessages(
    learn_reinforce("CartPole-v1", total_steps = 60000, target = 475, seed = 1)
  )
  expect_true(trained$solved)
  expect_gte(trained$final$mean_return, 475)
  expect_identical(trained$policy$output, "greedy")
  expect_identical(agent_policy(trained$agent)$output, "softmax")
  expect_lt(trained$steps, 60000)
})

test_that("random episodes make first moments; diagnostics are logged; a draw may be evaluated", {
  skip_if_no_server()
  folder <- withr::local_tempdir()
  trained <- quiet_learning(
    agent_ppo(batch_steps = 300, batch = 100, epochs = 1), "Pendulum-v1", small_policy(),
    iterations = 2, evaluate = "draw", log = folder, seed = 1, max_steps = 30
  )
  # The first iteration learned nothing from its eight episodes, and its observations count.
  expect_identical(is.na(trained$history$approx_kl), c(TRUE, FALSE))
  expect_identical(trained$policy$moments$count, trained$steps)
  expect_identical(trained$policy$output, "gaussian")
  expect_identical(trained$history$steps, c(240, 540))
  log <- utils::read.csv(file.path(folder, "progress.csv"), check.names = FALSE)
  expect_equal(log[["train/approx_kl"]], trained$history$approx_kl)
  expect_true(all(paste0("train/", ppo_log) %in% names(log)))
})

test_that("what a Gaussian draws is kept as drawn, and cut at the bounds when it is stepped", {
  wide <- policy_network(c(4, 2), "identity", output = "gaussian", log_std = 3)
  got <- list()
  env <- fake_environment(
    action_space = box_space(c(-1, -2), c(1, 2)), reward = function(seed, step, action) {
      got[[length(got) + 1L]] <<- action
      0
    }
  )
  steps <- rollout(env, wide, episodes = 4, steps = TRUE, seed = 1)$steps
  drawn <- cbind(steps$action_1, steps$action_2)
  expect_gt(max(abs(drawn)), 10)
  expect_equal(sort(unlist(got)), sort(pmax(c(-1, -2), pmin(t(drawn), c(1, 2)))))
})

test_that("advantages are those of the definition, over episodes that end in either way", {
  set.seed(1)
  lengths <- c(4, 1, 6)
  episode <- rep(1:3, lengths)
  last <- c(diff(episode) == 1, TRUE)
  terminated <- last & episode != 3
  reward <- rnorm(11)
  value <- rnorm(11)
  last_value <- rnorm(3)
  gamma <- 0.9
  lambda <- 0.7
  after <- next_values(value, last_value, terminated, last)
  found <- sum_backwards(reward + gamma * after - value, gamma * lambda, last)
  # Schulman et al. (2016), equation 16: the sum of (gamma lambda)^l delta, to the episode's end.
  for (own in split(seq_along(reward), episode)) {
    n <- length(own)
    end <- if (terminated[own[n]]) 0 else last_value[episode[own[1]]]
    delta <- reward[own] + gamma * c(value[own][-1], end) - value[own]
    wanted <- vapply(seq_len(n), function(t) {
      sum((gamma * lambda)^(0:(n - t)) * delta[t:n])
    }, 0)
    expect_equal(found[own], wanted)
  }
})

test_that("rewards are divided by the deviation of the discounted return so far, and cut at 10", {
  reward <- c(1, 2, 3, -4)
  last <- c(FALSE, TRUE, FALSE, TRUE)
  first <- scale_rewards(reward, last, 0.5, NULL)
  returns <- c(1, 2.5, 3, -2.5)
  deviation <- sqrt(mean((returns - mean(returns))^2))
  expect_equal(first$reward, reward / deviation)
  second <- scale_rewards(reward * 1000, last, 0.5, first$moments)
  expect_equal(second$moments$count, 8)
  rare <- scale_rewards(c(rep(0, 999), 1e6), c(rep(FALSE, 999), TRUE), 0.5, NULL)
  expect_identical(max(rare$reward), 10)
})

test_that("a single advantage stays as it is, so that it teaches", {
  expect_identical(standardized(-3), -3)
  expect_equal(standardized(c(1, 2, 6)), (c(1, 2, 6) - 3) / (sd(c(1, 2, 6)) + 1e-8))
  env <- gym_env(
    function(self) 0,
    function(self, action) list(observation = 0, reward = action, terminated = TRUE),
    space_box(-1, 1, 1), space_discrete(2)
  )
  policy <- policy_network(c(NA, NA), "identity", bias = TRUE, output = NA, init = "orthogonal")
  learned <- function(agent) {
    trained <- suppressMessages(train_agent(
      agent, env, policy, total_steps = 200, seed = 1, eval_episodes = 2, eval_episodes_curve = 0,
      target = Inf
    ))
    trained$final$mean_return
  }
  expect_identical(learned(agent_ppo(20, batch = 1, learning_rate = 0.01)), 1)
  expect_identical(learned(agent_reinforce(1, baseline = FALSE, min_episodes = 1)), 1)
})

test_that("Adam's steps are those of the paper's Algorithm 1", {
  set.seed(1)
  gradients <- matrix(rnorm(30), 3)
  weights <- wanted <- c(1, 2, 3)
  adam <- new_adam(3)
  m <- v <- 0
  for (t in 1:10) {
    g <- gradients[, t]
    moved <- adam_step(weights, g, adam, learning_rate = 0.1, epsilon = 1e-5)
    weights <- moved$weights
    adam <- moved$adam
    m <- 0.9 * m + (1 - 0.9) * g
    v <- 0.999 * v + (1 - 0.999) * g^2
    wanted <- wanted - 0.1 * (m / (1 - 0.9^t)) / (sqrt(v / (1 - 0.999^t)) + 1e-5)
    expect_equal(weights, wanted, tolerance = 1e-13)
  }
})

test_that("a gradient is cut to its greatest length, and a shorter one left alone", {
  expect_equal(clip_norm(c(3, 4), 1), c(0.6, 0.8), tolerance = 1e-6)
  expect_identical(clip_norm(c(3, 4), 6), c(3, 4))
  expect_identical(clip_norm(c(3, 4), Inf), c(3, 4))
})
