# Slips with tables and their learners: an error names what is wrong, and what to type instead.

walk <- gym_model(data.frame(
  state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3), reward = c(0, 0, 0, 1)
), start = 1)

# State 2 lacks action 1.
lacks <- gym_model(
  data.frame(state = c(1, 1, 2), action = c(0, 1, 0), next_state = c(0, 2, 3), reward = c(0, 0, 1)),
  start = 1
)

refused <- function(code, ...) {
  cnd <- expect_error(code, class = "gym_error_argument")
  for (text in c(...)) expect_match(conditionMessage(cnd), text, fixed = TRUE)
}

test_that("a schedule that never explores is refused, the number 0 is not", {
  refused(
    agent_q(epsilon = schedule_linear(0, 0, 100)), "`epsilon` is a schedule that is 0",
    "schedule_linear(1, 0.1", "give 0"
  )
  refused(learn_sarsa(walk, iterations = 1, epsilon = function(taken) 0), "never explores")
  expect_s3_class(agent_q(epsilon = 0), "gym_agent")
  expect_s3_class(agent_q(epsilon = schedule_linear(0, 0.1, 100)), "gym_agent")
  # Another way of exploring.
  starts <- agent_monte_carlo(epsilon = function(taken) 0, exploring_starts = TRUE)
  expect_s3_class(starts, "gym_agent")
})

test_that("a model that ends nowhere, or not from everywhere, needs `max_steps` to learn from", {
  loop <- gym_model(data.frame(state = 0:1, action = 0, next_state = 1:0, reward = 1), id = "Loop")
  cnd <- expect_error(learn_q(loop, iterations = 1), "Episodes of Loop never end")
  # At once, and not as a training that broke off.
  expect_false(inherits(cnd, "gym_error_training"))
  refused(solve_mdp(loop), "With a discount of 1 some values are infinite", "Give a `discount`")
  trap <- gym_model(data.frame(
    state = c(0, 0, 1), action = c(0, 1, 0), next_state = c(1, 2, 1), reward = 1
  ), id = "Trap")
  refused(
    learn_q(trap, iterations = 1), "An episode of Trap that reaches state 1 never ends",
    "Give `max_steps`"
  )
  expect_identical(nrow(learn_q(trap, iterations = 2, max_steps = 5, seed = 1)$history), 2L)
  # A policy that was given need not go there.
  ends <- policy_table(rbind(c(0, 1), c(0, -Inf), c(0, 0)))
  expect_identical(learn_td(trap, ends, iterations = 1, max_steps = 9, seed = 1)$steps > 0, TRUE)
})

test_that("an action that a state lacks is never learned, and refused with those it has", {
  given <- learn_q(lacks, policy = policy_table(matrix(0, 4, 2)), iterations = 20, seed = 1)
  expect_identical(given$agent$weights[3L, 2L], -Inf)
  refused(
    learn_td(lacks, function(state) rep(1L, length(state)), iterations = 1, seed = 1),
    "Action 1 cannot be taken in state 2", "Valid actions there: 0."
  )
})

test_that("more pairs than fit are refused before memory is asked for", {
  wide <- data.frame(state = c(0, 1e6), action = c(0, 1e3), next_state = 0, reward = 0,
                     terminated = TRUE)
  refused(gym_model(wide), "1,000,001 states with 1,001 actions", "Number states and actions")
  many <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
    observation_space = space_discrete(1e6), action_space = space_discrete(1e3), id = "Many"
  )
  refused(learn_q(many, iterations = 1), "1,000 actions in 1,000,000 states", "tile_coding()")
  refused(
    learn_q(gym_env(
      reset = function(self) 0,
      step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
      observation_space = space_discrete(2e9), action_space = space_discrete(2)
    ), iterations = 1), "2,000,000,000 rows", "tile_coding()"
  )
})

test_that("a table of another size, and seeds that repeat, are refused with both", {
  refused(
    learn_q(walk, iterations = 1, policy = policy_table(matrix(0, 5, 2))),
    "has 5 rows and 2 columns", "4 states and 2 actions", "a row for each state"
  )
  refused(
    learn_monte_carlo(walk, iterations = 1, importance = "weighted",
                      target_policy = policy_table(matrix(0, 5, 2))), "has 5 rows"
  )
  refused(learn_q(walk, iterations = 1, seeds = c(1, 2, 1)), "but 1 occurs", "unique(seeds)")
})

test_that("a learning rate of 0, by which nothing is learned, is refused by every agent", {
  for (make in list(agent_ppo, agent_reinforce, agent_dqn, agent_q, agent_sarsa, agent_monte_carlo,
                    agent_actor_critic, \(...) agent_td(policy_random(), ...))) {
    expect_error(make(learning_rate = 0), "`learning_rate` must be a number above 0",
                 class = "gym_error_argument")
    expect_s3_class(make(learning_rate = schedule_linear(0.1, 0, 100)), "gym_agent")
  }
  expect_error(agent_reinforce(value_learning_rate = 0), "above 0", class = "gym_error_argument")
})
