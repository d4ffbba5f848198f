# Every agent of the package, and an environment that it learns quickly.
walk <- function() {
  gym_model(
    data.frame(
      state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
      reward = c(0, 0, 0, 1)
    ),
    start = 1, max_episode_steps = 20
  )
}

one_step <- function() {
  gym_env(
    function(self) runif(2, -1, 1),
    function(self, action) list(observation = runif(2, -1, 1), reward = action, terminated = TRUE),
    space_box(-1, 1, 2), space_discrete(2)
  )
}

agents <- function() {
  list(
    agent_ppo(20, batch = 10), agent_reinforce(20),
    agent_dqn(learning_starts = 5, min_episodes = 8), agent_ars(2), agent_cem(6),
    agent_hill_climb(), agent_random(2), agent_q(),
    agent_q(double = TRUE), agent_q(planning = 2), agent_sarsa(), agent_monte_carlo(),
    agent_td(policy_random()), agent_actor_critic()
  )
}

env_of <- function(agent) if (learns_online(agent)) walk() else one_step()

quick <- function(..., iterations = 2) {
  train_agent(..., iterations = iterations, seed = 1, target = Inf, eval_episodes = 2,
              eval_episodes_curve = 0)
}

# Functions of a learner's features are made anew in each training.
learned <- function(training) training$agent[setdiff(names(training$agent), "basis")]

test_that("every agent goes on with all that it has learned, as itself or from its training", {
  for (agent in agents()) {
    info <- class(agent)[[1]]
    env <- env_of(agent)
    first <- quick(agent, env)
    expect_message(again <- quick(first$agent, env), "Going on", class = "gym_message_continued")
    # With the same seed, an agent that starts again would do the same again.
    changes <- !inherits(agent, c("gym_agent_ars", "gym_agent_hill_climb"))
    if (changes) expect_false(identical(learned(again), learned(first)), info = info)
    expect_identical(again$history$iteration, 1:2)
    by_training <- suppressMessages(quick(agent, env, policy = first))
    expect_identical(learned(by_training), learned(again), info = info)
    for (name in intersect(c("steps", "iteration", "played", "taken", "updates"), names(agent))) {
      expect_gt(again$agent[[name]], first$agent[[name]])
    }
    if (!is.null(first$agent$adam)) expect_gt(again$agent$adam$steps, first$agent$adam$steps)
    expect_no_message(quick(agent, env))
  }
})

test_that("learn_*() goes on with the training's own settings and budget, or those given", {
  first <- quick(agent_ppo(20, batch = 10, epochs = 3, learning_rate = 0.01), one_step())
  learn <- function(...) {
    suppressMessages(learn_ppo(one_step(), first, eval_episodes = 2, target = Inf, seed = 2, ...))
  }
  more <- learn()
  settings <- c("epochs", "learning_rate")
  expect_identical(more$agent[settings], first$agent[settings])
  expect_identical(more$rules$iterations, 2)
  expect_identical(more$agent$steps, first$steps + more$steps)
  other <- learn(learning_rate = 0.1, total_steps = 20)
  expect_identical(other$agent[settings], list(epochs = 3, learning_rate = 0.1))
  # Defaults of a learner of tables are no choice of the user.
  table <- quick(agent_q(learning_rate = 0.7), walk())
  more <- suppressMessages(learn_q(walk(), policy = table, seed = 1))
  expect_identical(more$agent$learning_rate, 0.7)
})

test_that("what cannot go on is refused: a kept part of another kind, an ended schedule, a space", {
  suppressMessages({
    first <- quick(agent_reinforce(20), one_step())
    table <- quick(agent_q(), walk())
  })
  expect_error(quick(agent_reinforce(20, baseline = FALSE), one_step(), policy = first),
               "The earlier training has another `baseline`", class = "gym_error_argument")
  ended <- first$agent
  ended$learning_rate <- schedule_linear(0.1, 0, 1)
  expect_error(quick(ended, one_step()), "`agent$learning_rate <- 1e-4`", fixed = TRUE,
               class = "gym_error_argument")
  larger <- gym_model(data.frame(state = 0:8, action = 0, next_state = 9, reward = 1), start = 0)
  expect_error(suppressMessages(quick(table$agent, larger)),
               "has learned with the observation space", class = "gym_error_argument")
})

test_that("another agent starts with the policy that draws; a policy alone starts again", {
  first <- quick(agent_ppo(20, batch = 10), one_step())
  expect_identical(policy_to_train(first, agent_reinforce()), first$agent$policy)
  expect_s3_class(quick(agent_reinforce(20), one_step(), policy = first), "gym_training")
  again <- quick(first$agent, one_step(), policy = agent_policy(first$agent))
  expect_identical(again$agent$steps, again$steps)
})

test_that("a training that was solved goes on from its file with a higher target", {
  path <- withr::local_tempfile(fileext = ".rds")
  play <- function(target) {
    suppressMessages(train_agent(
      agent_ppo(8, batch = 4), one_step(), iterations = 4, target = target, seed = 1,
      eval_episodes = 2, eval_every = 1, checkpoint = path
    ))
  }
  first <- play(-1)
  expect_identical(first[c("stopped_early", "steps")], list(stopped_early = TRUE, steps = 8))
  more <- play(2)
  expect_identical(nrow(more$history), 4L)
  expect_false(more$solved)
  expect_identical(play(2)$final, more$final)
  expect_identical(nrow(play(Inf)$history), 4L)
})

test_that("a checkpoint that readRDS() reads prints what it is, and how to resume", {
  path <- withr::local_tempfile(fileext = ".rds")
  quick(agent_hill_climb(), walk(), policy = policy_network(c(NA, NA), "identity"),
        checkpoint = path)
  printed <- capture.output(print(readRDS(path)))
  expect_match(printed[[1]], "<checkpoint of a training in .* by hill climbing: noise 0.1>")
  expect_match(printed, "2 iterations, .* steps, ended|as `checkpoint`", all = FALSE)
  expect_length(printed, 4)
  older <- structure(list(format = 1L, version = "0.9"), class = "gym_checkpoint")
  expect_output(print(older), "by gym 0.9, which this version cannot read")
})
