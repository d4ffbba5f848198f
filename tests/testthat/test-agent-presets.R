test_that("every preset makes its agent, and says where it comes from", {
  presets <- read_presets()
  expect_identical(anyDuplicated(presets[c("env_id", "kwargs", "agent")]), 0L)
  expect_true(all(nzchar(presets$source[presets$origin == "paper"])))
  expect_true(all(presets$origin %in% c("paper", "ours")))
  for (row in seq_len(nrow(presets))) {
    agent <- preset_agent(presets[row, ])
    expect_s3_class(agent, "gym_agent")
    given <- Filter(Negate(is.function), preset_arguments(preset_settings(presets[row, ])))
    # The agent's own `memory` is the memory itself.
    names(given)[names(given) == "memory"] <- "memory_size"
    expect_equal(agent[names(given)], given)
  }
  ppo <- preset_agent(presets[presets$agent == "ppo" & presets$env_id == "CartPole-v1", ])
  expect_equal(ppo$learning_rate(c(0, 5e4, 1e5)), c(1e-3, 5e-4, 0))
  pendulum <- agent_presets("Pendulum-v1")
  expect_identical(
    from_json(pendulum$arguments[pendulum$agent == "SAC"]), list(learning_rate = 0.001)
  )
  swimmer <- agent_presets("Swimmer-v5")
  expect_identical(unique(swimmer$env_id), "Swimmer-v5")
  expect_identical(nrow(agent_presets("None-v0")), 0L)
  expect_error(agent_presets(3), class = "gym_error_argument")
})

test_that("a preset belongs to an id with the same arguments", {
  expect_identical(find_preset("ars", "LunarLander-v3", list())$bias, TRUE)
  continuous <- find_preset("ars", "LunarLander-v3", list(continuous = TRUE))
  expect_identical(continuous$kwargs, "{\"continuous\":true}")
  expect_null(find_preset("ars", "LunarLander-v3", list(continuous = FALSE)))
  expect_null(find_preset("ars", "LunarLander-v3", list(continuous = TRUE, gravity = -5)))
  expect_null(find_preset("cem", "CartPole-v1", list()))
  expect_null(find_preset("ars", fake_environment(id = "CartPole-v1"), list()))
})

test_that("the preset of an agent that follows gradients may change the network", {
  policy_of <- function(agent, env_id) {
    preset <- find_preset(agent, env_id, list())
    preset_policy(preset, preset_agent(preset))
  }
  expect_identical(policy_of("ppo", "Acrobot-v1")$moments, no_moments())
  expect_null(policy_of("ppo", "CartPole-v1")$moments)
  of_car <- policy_of("dqn", "MountainCar-v0")
  expect_identical(of_car$sizes, c(NA, 256L, 256L, NA))
  expect_identical(of_car$init, "uniform")
  car <- fake_environment(
    observation_space = box_space(c(-1, -1), c(1, 1)), action_space = discrete_space(3L)
  )
  bound <- policy_bind(of_car, car)
  expect_identical(lengths(bound$weights), c(3L, 257L, 257L) * c(256L, 256L, 3L))
  # Orthogonal weights are a tenth as large.
  expect_gt(max(abs(bound$weights[[2]])), 0.99)
  expect_identical(policy_of("dqn", "CartPole-v1")[c("sizes", "init")],
                   list(sizes = c(NA, 64L, 64L, NA), init = "orthogonal"))
})

test_that("a search takes its preset, says so, and lets arguments go before it", {
  skip_unless_all()
  client <- test_client()
  expect_message(
    trained <- search_ars("CartPole-v1", total_steps = 500, eval_episodes = 2, seed = 1,
                          client = client),
    "preset for CartPole-v1 .*ours", class = "gym_message_preset"
  )
  preset <- find_preset("ars", "CartPole-v1", list())
  by_hand <- train_agent(
    agent_ars(preset$directions, preset$top, preset$step_size, preset$noise, preset$version),
    "CartPole-v1", policy_linear(bias = preset$bias), total_steps = 500,
    eval_episodes = 2, seed = 1, client = client
  )
  expect_identical(trained$history$mean_return, by_hand$history$mean_return)
  expect_identical(trained$target, 475)
  expect_identical(provenance(trained)$preset$origin, "ours")
  expect_null(provenance(by_hand)$preset)
  own <- suppressMessages(
    search_ars("CartPole-v1", policy_linear(bias = TRUE), directions = 3, top = 1, noise = 0.4,
               target = 5, iterations = 1, eval_episodes = 2, seed = 1, client = client)
  )
  expect_identical(own$agent[c("directions", "top", "noise", "step_size")],
                   list(directions = 3L, top = 1L, noise = 0.4, step_size = preset$step_size))
  expect_length(coef(own), 5)
  expect_setequal(provenance(own)$preset$changed,
                  c("policy", "directions", "top", "noise", "iterations"))
  # Without `top` it is half of them, not the preset's.
  few <- suppressMessages(
    search_ars("CartPole-v1", directions = 2, iterations = 1, eval_episodes = 2, client = client)
  )
  expect_identical(few$agent$top, 1L)
  expect_identical(own$target, 5)
})

test_that("without a preset agents have their own defaults, and training needs a budget", {
  env <- fake_environment(reward = first_action)
  expect_no_message(trained <- search_ars(env, directions = 3, iterations = 2, eval_episodes = 2,
                                          seed = 1))
  expect_identical(trained$agent$step_size, agent_ars()$step_size)
  cem <- search_cem(env, policy_network(c(4, 2, 1)), population = 6, iterations = 2,
                    eval_episodes = 2, seed = 1)
  expect_identical(cem$agent$population, 6L)
  hill <- search_hill_climb(env, noise = 0.3, candidates = 4, iterations = 2, eval_episodes = 2,
                            seed = 1)
  expect_identical(hill$agent$noise, 0.3)
  for (search in list(search_ars, search_cem, search_hill_climb)) {
    expect_error(search(env), "needs a budget", class = "gym_error_argument")
  }
  expect_error(search_ars(env, NULL, 20), "need names", class = "gym_error_argument")
  expect_error(search_ars(env, directions = 0, iterations = 1), class = "gym_error_argument")
  expect_error(search_ars(env, directions = numeric(), iterations = 1),
               class = "gym_error_argument")
  expect_error(search_ars("CartPole-v1", gravity = 1),
               "presets of CartPole-v1 .*\"ars\".*environment: `gravity`",
               class = "gym_error_argument")
  expect_error(search_cem("CartPole-v1"), "another agent: \"ars\"",
               class = "gym_error_argument")
  expect_error(agent_ars(4, 2, version = "V1"), "V1-t", class = "gym_error_argument")
})

test_that("a table takes its preset with its budget, and without one its own defaults", {
  client <- test_client()
  # The first evaluation ends it.
  for (learn in list(learn_q, learn_sarsa)) {
    expect_message(
      taxi <- learn("Taxi-v4", target = -1e6, seed = 1, client = client), "preset for Taxi-v4"
    )
    expect_identical(taxi$agent$learning_rate, 0.5)
    expect_identical(nrow(taxi$history), 1L)
    preset <- find_preset(sub("gym_agent_", "", class(taxi$agent)[[1]]), "Taxi-v4", list())
    expect_equal(taxi$rules$total_steps, preset$total_steps)
  }
  cliff <- suppressMessages(learn_q("CliffWalking-v1", target = -1e6, seed = 1, epsilon = 0.5,
                                    client = client))
  expect_identical(cliff$agent[c("epsilon", "learning_rate")],
                   list(epsilon = 0.5, learning_rate = 0.5))
  expect_equal(cliff$max_steps, 1000)
  own <- learn_q(walk_model(), iterations = 2, seed = 1)
  expect_identical(own$agent$weights,
                   learn_q(walk_model(), iterations = 2, episodes = 10, seed = 1)$agent$weights)
  expect_error(learn_q("Taxi-v4", is_rainy = TRUE, client = client),
               "`total_steps = 100000`.*presets of Taxi-v4", class = "gym_error_argument")
})

test_that("whoever still writes `steps` is told its new name, before anything is made", {
  calls <- list(search_ars, search_cem, search_hill_climb, learn_q, learn_sarsa, learn_monte_carlo)
  for (call in calls) {
    expect_error(call("CartPole-v1", steps = 100, client = no_client()), "`total_steps`",
                 class = "gym_error_argument")
  }
  expect_error(learn_td("Taxi-v4", policy_random(), steps = 100, client = no_client()),
               "`total_steps`", class = "gym_error_argument")
})

test_that("a curve by a preset of PPO has a point for most iterations", {
  skip_unless_all()
  trained <- suppressMessages(learn_ppo(
    "CartPole-v1", iterations = 3, target = Inf, eval_episodes = 2, eval_episodes_curve = 2,
    seed = 1, client = test_client()
  ))
  expect_identical(sum(trained$evaluations$kind == "curve"), 4L)
})
