# What every class of this package prints, as a whole. After a change that is meant:
# testthat::snapshot_review() shows what is new, snapshot_accept() takes it.

# Ports, sizes of files and temporary names differ from run to run.
steady <- function(lines) {
  lines <- gsub("127\\.0\\.0\\.1:[0-9]+", "127.0.0.1:PORT", lines)
  lines <- gsub("[0-9.,]+ kB", "SIZE", lines)
  lines <- gsub("^  [^ ]*[.]gif$", "  FILE.gif", lines)
  gsub("[0-9.]+ steps/s|[0-9.]+ s\\b", "TIME", lines)
}

expect_printed <- function(x) expect_snapshot(print(x), transform = steady)

# The action of the first step is the reward of an episode of one step.
one_step <- function(...) {
  fake_environment(
    reward = function(seed, step, action) action,
    ends = function(seed, step, action) TRUE, ...
  )
}

test_that("a client and a token", {
  expect_printed(create_GymClient("http://127.0.0.1:5000"))
  expect_printed(as_token("a-secret-of-16-characters"))
})

test_that("an environment, open and closed, with sub-environments, and wrapped", {
  env <- local_env("CartPole-v1", seed = 1)
  expect_printed(env)
  env$close()
  expect_printed(env)
  expect_printed(local_env("CartPole-v1", seed = 1, num_envs = 3))
  expect_printed(gym_wrap("CartPole-v1", "TimeLimit", max_episode_steps = 50))
})

test_that("an environment in R, open and closed, and with sub-environments", {
  env <- r_cartpole()
  expect_printed(env)
  env$close()
  expect_printed(env)
  expect_printed(r_cartpole_vectorized(num_envs = 3))
})

test_that("a space of each kind", {
  expect_printed(box_space(c(-1, 0), c(1, Inf)))
  expect_printed(discrete_space(3L, start = -1L))
  expect_printed(new_space(list(
    name = "MultiDiscrete", shape = list(2L), dtype = "int64", nvec = list(2L, 3L),
    start = list(0L, 0L)
  )))
  expect_printed(new_space(list(name = "MultiBinary", shape = list(2L, 3L), dtype = "int8")))
  text <- list(name = "Text", min_length = 1L, max_length = 6L, characters = "abc")
  move <- list(name = "Discrete", n = 2L, start = 0L, dtype = "int64")
  point <- describe_box(0, 1)
  expect_printed(new_space(text))
  expect_printed(new_space(list(name = "Tuple", spaces = list(move, point))))
  expect_printed(new_space(describe_dict(move = move, note = text)))
  expect_printed(new_space(list(name = "Sequence", space = move, stack = FALSE)))
  expect_printed(new_space(list(name = "Graph", node_space = point, edge_space = NULL)))
  expect_printed(new_space(list(name = "OneOf", spaces = list(move, point))))
})

test_that("a policy of each kind", {
  expect_printed(policy_random())
  expect_printed(policy_network(c(4, 2, 1)))
  weights <- list(matrix(seq(-0.4, 0.3, by = 0.1), 2), matrix(c(1, -1), 1))
  expect_printed(policy_network(c(4, 2, 1), weights = weights))
  expect_printed(policy_candidates(policy_network(c(4, 2, 1)), matrix(0, 3, 10)))
  steps <- data.frame(pole_angle = c(-1, 0.2, -0.1, 2), action = c(0, 0, 1, 1))
  expect_printed(as_policy(glm(action ~ pole_angle, binomial, steps)))
  expect_printed(as_policy(lm(steps$action ~ 1)))
})

test_that("a frame, frames and an animation", {
  env <- local_env("CartPole-v1", seed = 1)
  env$reset()
  expect_printed(env$render())
  played <- rollout(env, policy_random(), episodes = 1, seed = 1, max_steps = 3, frames = TRUE)
  expect_printed(played$frames[[1]])
  withr::local_options(gym.viewer = function(url) NULL)
  expect_printed(animate(played, file = withr::local_tempfile(fileext = ".gif")))
})

test_that("a rollout and its summary", {
  played <- rollout(fake_vector_env(4), policy_random(), episodes = 10, seed = 1)
  expect_printed(played)
  expect_printed(summary(played))
})

test_that("rollouts and evaluations of several policies", {
  network <- policy_network(c(4, 1), weights = list(matrix(c(1, -1, 1, -1), 1)))
  policies <- list(network = network, random = policy_random())
  env <- fake_vector_env(4, reward = function(seed, step, action) seed %% 7 + action)
  played <- rollout(env, policies, episodes = 10, seed = 1)
  expect_printed(played)
  expect_printed(summary(played))
  expect_printed(evaluate_policy(env, network, episodes = 10, seed = 1))
  expect_printed(evaluate_policy(env, network, episodes = 1, seed = 1))
  weights <- matrix(sin(1:48), 12)
  candidates <- policy_candidates(policy_network(c(4, 1)), weights)
  expect_printed(evaluate_policy(env, candidates, episodes = 10, seed = 1, level = 0.999))
})

test_that("a search that found and one that did not, and their summaries", {
  found <- search_random(one_step(reward_threshold = 1), episodes = 2, rounds = 50, seed = 4)
  expect_printed(found)
  expect_printed(withr::with_seed(1, summary(found)))
  expect_printed(search_random(one_step(), episodes = 2, rounds = 3, target = 9, seed = 4))
})

test_that("searches with many seeds", {
  searches <- search_random(one_step(), episodes = 2, rounds = 5, target = 1, seeds = 4:6)
  expect_printed(searches)
})

test_that("a decision map", {
  weights <- list(matrix(seq(-0.4, 0.3, by = 0.1), 2), matrix(c(1, -1), 1))
  policy <- policy_network(c(4, 2, 1), weights = weights)
  expect_printed(decision_map(
    policy, env = local_env("CartPole-v1"), x = "pole_angle", y = "cart_position", size = 5
  ))
})

test_that("what gym_sitrep() finds", {
  found <- rbind(
    finding("R", "versions", "gym 1.0.0"), finding("R", "suggested packages", "none", "note"),
    finding("Python", "environment", "none", "wrong", "gym_server_install()")
  )
  class(found) <- c("gym_sitrep", class(found))
  expect_printed(found)
})

test_that("what check_env() finds", {
  walk <- function(reward, ends) {
    gym_env(
      function(self) 0,
      function(self, action) list(observation = 1, reward = reward, terminated = ends),
      observation_space = space_discrete(2), action_space = space_box(-Inf, 1), id = "Walk"
    )
  }
  expect_printed(check_env(walk(NA, TRUE)))
  expect_printed(check_env(walk(1, FALSE), max_steps = 20))
})

test_that("results are printed without times if the user leaves them out", {
  env <- fake_environment(reward = first_action)
  trained <- train_agent(agent_ars(3, 2), env, iterations = 1, seeds = 1:2, target = Inf,
                         eval_episodes = 2)
  search <- search_random(env, rounds = 2, target = 9, seed = 1)
  results <- list(
    trained, trained$trainings[[1]], search, summary(search, episodes = 2, seed = 1),
    provenance(trained), provenance(trained$trainings[[1]])
  )
  times <- "[0-9] (s|min)\\b|[0-9]:[0-9]|elapsed"
  for (result in results) {
    expect_match(capture.output(print(result)), times, all = FALSE)
    withr::with_options(
      list(gym.print_seconds = FALSE),
      expect_no_match(capture.output(print(result)), times)
    )
  }
})
