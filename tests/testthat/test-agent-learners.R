# Learners, one step at a time, against the formulas of Sutton and Barto (2018).

spaces <- function(states = 3, actions = 2) {
  structure(
    list(observation_space = space_discrete(states), action_space = space_discrete(actions),
         spec = list(id = "Three")),
    class = c("gym_policy_unknown", "gym_policy")
  )
}

step_of <- function(state, action, reward, next_state, terminated = FALSE, truncated = FALSE,
                    first = FALSE, sub_env = seq_along(state)) {
  n <- length(state)
  list(
    observation = as.integer(state), action = rep_len(as.integer(action), n), reward = reward,
    next_observation = as.integer(next_state), terminated = rep_len(terminated, n),
    truncated = rep_len(truncated, n), first = rep_len(first, n), sub_env = sub_env
  )
}

q <- rbind(c(1, 2), c(3, 5), c(7, 4))
started <- function(agent, table = q) {
  policy <- spaces()
  policy$q <- table
  agent_start(agent, policy)
}

learner <- function(agent) learner_of(agent, function() stats::runif(1L))

# The agent after some steps. Its learner goes on with it; `chosen` are the actions that it does
# next.
observe <- function(agent, steps) {
  learner <- attr(agent, "learner") %||% learner(agent)
  basis <- agent$basis
  chosen <- vapply(seq_along(steps$reward), function(i) {
    terminated <- steps$terminated[[i]]
    learner$observe(
      basis$one(steps$observation[i]), steps$action[[i]] + 1L, steps$reward[[i]],
      basis$one(steps$next_observation[i]), terminated, terminated || steps$truncated[[i]],
      steps$sub_env[[i]], steps$next_observation[i]
    )
  }, 0L) - 1L
  structure(learner$export(), learner = learner, chosen = chosen)
}

# What it does first in an episode, so many times.
begins <- function(agent, state, times = 1) {
  learner <- attr(agent, "learner") %||% learner(agent)
  x <- agent$basis$one(state)
  vapply(seq_len(times), function(i) as.integer(learner$act(x, 1L, state)) - 1L, 0L)
}

test_that("Q-learning moves a value towards the reward and the best value that follows", {
  agent <- started(agent_q(discount = 0.5, learning_rate = 0.1))
  after <- observe(agent, step_of(0, 1, 10, 1))
  expected <- q
  expected[1, 2] <- 2 + 0.1 * (10 + 0.5 * 5 - 2)
  expect_equal(after$weights, expected)
  expect_identical(after$taken, 1)
})

test_that("what is done next is chosen by what was just learned, in the same state, too", {
  agent <- started(agent_q(discount = 1, learning_rate = 1, epsilon = 0))
  # From state 0 to itself: 2 becomes -5 + 2, which is less than 1. From state 1 the best is 5.
  expect_identical(attr(observe(agent, step_of(0, 1, -5, 0)), "chosen"), 0L)
  expect_identical(attr(observe(agent, step_of(0, 1, -5, 1)), "chosen"), 1L)
})

test_that("nothing follows on a termination, and what would follow on a truncation counts", {
  for (agent in list(
    agent_q(0.5, 0.1), agent_sarsa(0.5, 0.1, epsilon = 0),
    agent_sarsa(0.5, 0.1, epsilon = 0, expected = TRUE),
    agent_sarsa(0.5, 0.1, epsilon = 0, n = 3),
    agent_sarsa(0.5, 0.1, epsilon = 0, lambda = 0.5)
  )) {
    agent <- started(agent)
    ended <- observe(agent, step_of(0, 1, 10, 1, terminated = TRUE, first = TRUE))
    expect_equal(ended$weights[1, 2], 2 + 0.1 * (10 - 2))
    cut <- observe(agent, step_of(0, 1, 10, 1, truncated = TRUE, first = TRUE))
    expect_equal(cut$weights[1, 2], 2 + 0.1 * (10 + 0.5 * 5 - 2))
  }
})

test_that("steps of several sub-environments are learned from one after the other", {
  agent <- started(agent_q(discount = 0.5, learning_rate = 0.1))
  after <- observe(agent, step_of(c(0, 0, 2), c(1, 1, 0), c(10, 4, 1), c(1, 1, 0)))
  once <- 2 + 0.1 * (10 + 0.5 * 5 - 2)
  twice <- once + 0.1 * (4 + 0.5 * 5 - once)
  expect_equal(after$weights[1, 2], twice)
  expect_equal(after$weights[3, 1], 7 + 0.1 * (1 + 0.5 * twice - 7))
  expect_identical(after$taken, 3)
})

test_that("Sarsa does next what it has learned from", {
  set.seed(1)
  agent <- started(agent_sarsa(discount = 0.5, learning_rate = 0.1, epsilon = 0.5))
  chosen <- integer()
  for (i in 1:50) {
    after <- observe(agent, step_of(0, 1, 10, 1))
    action <- attr(after, "chosen")
    expect_equal(after$weights[1, 2], 2 + 0.1 * (10 + 0.5 * q[2, action + 1] - 2))
    chosen <- c(chosen, action)
  }
  expect_setequal(chosen, 0:1)
  # In a new episode it chooses anew.
  ended <- observe(agent, step_of(0, 1, 10, 1, terminated = TRUE))
  expect_identical(attr(ended, "chosen"), NA_integer_)
})

test_that("expected Sarsa takes the mean over what it might do", {
  agent <- started(agent_sarsa(0.5, 0.1, epsilon = 0.2, expected = TRUE))
  after <- observe(agent, step_of(0, 1, 10, 1))
  expect_equal(after$weights[1, 2], 2 + 0.1 * (10 + 0.5 * (0.9 * 5 + 0.1 * 3) - 2))
})

test_that("n steps are looked ahead, and all that is left at the end", {
  agent <- started(agent_sarsa(discount = 0.5, learning_rate = 0.1, epsilon = 0, n = 2))
  one <- observe(agent, step_of(0, 0, 1, 1, first = TRUE))
  expect_identical(one$weights, q)
  two <- observe(one, step_of(1, 1, 3, 2))
  expect_equal(two$weights[1, 1], 1 + 0.1 * (1 + 0.5 * 3 + 0.25 * 7 - 1))
  three <- observe(two, step_of(2, 0, 8, 0, terminated = TRUE))
  expect_equal(three$weights[2, 2], 5 + 0.1 * (3 + 0.5 * 8 - 5))
  expect_equal(three$weights[3, 1], 7 + 0.1 * (8 - 7))
  # Nothing is left for the next episode.
  four <- observe(three, step_of(0, 0, 1, 1, terminated = TRUE))
  value <- three$weights[1, 1]
  expect_equal(four$weights[1, 1], value + 0.1 * (1 - value))
})

test_that("replacing traces fade by the discount and lambda", {
  agent <- started(agent_sarsa(discount = 0.5, learning_rate = 0.1, epsilon = 0, lambda = 0.8))
  one <- observe(agent, step_of(0, 0, 1, 1, first = TRUE))
  first_error <- 1 + 0.5 * 5 - 1
  expect_equal(one$weights[1, 1], 1 + 0.1 * first_error)
  two <- observe(one, step_of(1, 1, 3, 2, truncated = TRUE))
  error <- 3 + 0.5 * 7 - 5
  expect_equal(two$weights[1, 1], 1 + 0.1 * first_error + 0.1 * 0.4 * error)
  expect_equal(two$weights[2, 2], 5 + 0.1 * error)
  # A new episode has no trace of the last one.
  again <- observe(two, step_of(2, 0, 1, 0))
  expect_identical(which(again$weights != two$weights), 3L)
})

test_that("TD learns a state's value, whatever the action", {
  agent <- agent_td(function(state) state, discount = 0.5, learning_rate = 0.1, initial = 2)
  agent <- agent_start(agent, spaces(states = 3, actions = 3))
  expect_identical(c(begins(agent, 1L), begins(agent, 2L)), c(1L, 2L))
  after <- observe(agent, step_of(0, 1, 10, 1))
  expect_equal(after$weights[, 1], c(2 + 0.1 * (10 + 0.5 * 2 - 2), 2, 2))
  expect_equal(state_values(after), c("0" = 2.9, "1" = 2, "2" = 2))
})

test_that("Monte Carlo averages the returns of first visits, or of every one", {
  episode <- function(agent) {
    agent <- observe(agent, step_of(0, 1, 1, 1, first = TRUE))
    agent <- observe(agent, step_of(1, 0, 2, 0))
    observe(agent, step_of(0, 1, 4, 2, terminated = TRUE))
  }
  first <- episode(started(agent_monte_carlo(discount = 0.5)))
  expect_equal(first$weights[1, 2], 1 + 0.5 * 2 + 0.25 * 4)
  expect_equal(first$weights[2, 1], 2 + 0.5 * 4)
  every <- episode(started(agent_monte_carlo(discount = 0.5, visits = "every")))
  expect_equal(every$weights[1, 2], mean(c(3, 4)))
  later <- started(agent_monte_carlo(discount = 0.5, learning_rate = 0.1))
  expect_equal(episode(later)$weights[1, 2], 2 + 0.1 * (3 - 2))
  expect_equal(episode(first)$visited[1, 2], 2)
})

test_that("Monte Carlo learns the same from many episodes at once as from one after the other", {
  set.seed(1)
  episode <- rep(1:20, each = 5)
  x <- sample(3, 100, replace = TRUE)
  column <- sample(2, 100, replace = TRUE)
  reward <- round(stats::rnorm(100), 1)
  for (how in list(list(), list(visits = "every"), list(learning_rate = 0.1, discount = 1))) {
    agent <- started(do.call(agent_monte_carlo, how))
    at_once <- agent_tell(agent, list(trajectories = list(
      observation = x - 1L, action = column - 1L, reward = reward, episode = episode
    )))
    in_turn <- learner(agent)
    for (i in 1:100) {
      in_turn$observe(x[[i]], column[[i]], reward[[i]], 1L, FALSE, i %% 5 == 0, 1L, NULL)
    }
    expect_equal(at_once, in_turn$export())
  }
})

test_that("the policy of an iteration takes one of the actions with equal values, and no other", {
  agent <- started(agent_monte_carlo(epsilon = 0.3), rbind(c(1, 1), c(3, 5), c(-Inf, 2)))
  set.seed(1)
  drawn <- replicate(50, agent_behavior(agent)$q, simplify = FALSE)
  expect_setequal(lapply(drawn, function(q) q[1, ]), list(0:1 + 0, 1:0 + 0))
  expect_identical(unique(lapply(drawn, function(q) q[2:3, ])), list(rbind(0:1 + 0, c(-Inf, 1))))
  expect_identical(agent_behavior(agent)$epsilon, 0.3)
})

test_that("exploring starts draw the first action of an episode, and only that", {
  agent <- started(agent_monte_carlo(epsilon = 0, exploring_starts = TRUE))
  set.seed(1)
  expect_equal(mean(begins(agent, 2L, 200)), 0.5, tolerance = 0.2)
  agent <- observe(agent, step_of(rep(2, 50), 1, rep(0, 50), rep(2, 50), sub_env = rep(1L, 50)))
  expect_true(all(attr(agent, "chosen") == 0L))
})

test_that("double Q-learning chooses by one table and values by the other", {
  agent <- started(agent_q(discount = 0.5, learning_rate = 0.1, double = TRUE))
  agent$second <- q[, 2:1]
  set.seed(3)
  seen <- replicate(40, {
    after <- observe(agent, step_of(0, 1, 10, 1))
    first <- after$weights[1, 2]
    if (first != 2) {
      # The first table's best action is 1, which the second values at 3.
      expect_equal(first, 2 + 0.1 * (10 + 0.5 * 3 - 2))
      expect_identical(after$second, agent$second)
      1
    } else {
      # The second's best is 0, which the first values at 3.
      expect_equal(after$second[1, 2], 1 + 0.1 * (10 + 0.5 * 3 - 1))
      2
    }
  })
  expect_setequal(seen, 1:2)
  expect_equal(action_weights(agent), (q + q[, 2:1]) / 2)
})

test_that("planning learns again from what is remembered, and counts no steps", {
  agent <- started(agent_q(discount = 0.5, learning_rate = 0.1, planning = 3), 0 * q)
  after <- observe(agent, step_of(0, 1, 10, 1, terminated = TRUE))
  # Four times the same, of which three are remembered.
  expect_equal(after$weights[1, 2], 10 * (1 - 0.9^4))
  expect_identical(after$taken, 1)
  expect_identical(after$memory$pair, 4L)
  expect_error(agent_q(planning = 1, double = TRUE), class = "gym_error_argument")
})

test_that("a bonus draws planning to what was not tried for long", {
  # Everything is worth 0, so that a bonus alone moves values.
  agent <- started(agent_q(discount = 1, learning_rate = 1, planning = 50, bonus = 0.1), 0 * q)
  after <- withr::with_seed(1, observe(agent, step_of(0, 1, 0, 1, terminated = TRUE)))
  # In state 0 action 1 was just tried, and action 0 never.
  expect_identical(sort(after$memory$pair), c(1L, 4L))
  expect_equal(after$weights[1, 2], 0)
  # Trying action 0 is taken to stay there.
  expect_gt(after$weights[1, 1], 0.1 * sqrt(1))
  expect_identical(after$weights[2:3, ], 0 * q[2:3, ])
  expect_error(agent_q(bonus = 0.1), "give `planning`", class = "gym_error_argument")
})

test_that("off-policy Monte Carlo weighs returns by what the policy would have done", {
  # The policy takes action 1 with certainty; with epsilon 1 each action has probability 1/2.
  sticks <- policy_table(cbind(rep(0, 3), 1))
  episode <- function(how) {
    agent <- agent_monte_carlo(discount = 1, epsilon = 1, importance = how, target_policy = sticks)
    learner <- learner(started(agent, 0 * q))
    play <- function(actions, rewards) {
      column <- learner$act(1L, 1L, NULL)
      for (i in seq_along(rewards)) {
        last <- i == length(rewards)
        following <- learner$observe(i, column, rewards[[i]], i + 1L, last, last, 1L, NULL)
        actions <- c(actions, column)
        column <- following
      }
      actions
    }
    taken <- withr::with_seed(2, lapply(1:400, function(k) play(integer(), c(1, 2, 4))))
    list(agent = learner$export(), taken = do.call(rbind, taken))
  }
  for (how in c("weighted", "ordinary")) {
    came <- episode(how)
    # Only episodes whose later actions are the policy's count, twice for each of these.
    own <- came$taken[, 1] == 2L
    ratio <- 4 * (came$taken[own, 2] == 2L & came$taken[own, 3] == 2L)
    expected <- if (how == "weighted") 7 else sum(ratio * 7) / sum(own)
    expect_equal(came$agent$weights[1, 2], expected)
    expect_equal(state_values(came$agent)[["0"]], expected)
    visits <- if (how == "weighted") sum(ratio) else sum(own)
    expect_equal(came$agent$visited[1, 2], visits)
  }
  expect_identical(agent_policy(came$agent)$q, sticks$q)
  expect_error(agent_monte_carlo(target_policy = sticks), "needs `importance`",
               class = "gym_error_argument")
})

test_that("off-policy TD moves a value as far as the policy is more likely to act so", {
  often <- policy_table(cbind(rep(log(3), 3), 0), temperature = 1)
  agent <- agent_td(policy_table(cbind(rep(0, 3), 1)), discount = 0.5, learning_rate = 0.1,
                    initial = 2, behavior = often)
  learner <- learner(agent_start(agent, spaces()))
  column <- learner$act(1L, 1L, 0L)
  learner$observe(1L, 2L, 10, 2L, FALSE, FALSE, 1L, 1L)
  # Probabilities of 1 and 1/4.
  once <- 2 + 4 * 0.1 * (10 + 0.5 * 2 - 2)
  expect_equal(state_values(learner$export())[["0"]], once)
  learner$observe(2L, 1L, 10, 1L, FALSE, FALSE, 1L, 0L)
  expect_equal(state_values(learner$export())[["1"]], 2)
  expect_error(agent_td(often, behavior = function(state) 0L), "whose probabilities are known",
               class = "gym_error_argument")
})

test_that("an actor moves towards what came to more than its critic had expected", {
  agent <- agent_start(
    agent_actor_critic(discount = 0.5, learning_rate = 0.1, actor_rate = 0.2, lambda = 0.8,
                       actor_lambda = 0.4), spaces()
  )
  learner <- learner(agent)
  learner$observe(1L, 2L, 10, 2L, FALSE, FALSE, 1L, NULL)
  one <- learner$export()
  expect_equal(one$weights[, 1], c(1, 0, 0))
  expect_equal(one$preferences[1, ], 0.2 * 10 * c(-0.5, 0.5))
  learner$observe(2L, 1L, 4, 1L, FALSE, TRUE, 1L, NULL)
  error <- 4 + 0.5 * 1
  two <- learner$export()
  expect_equal(two$weights[, 1], c(1 + 0.1 * 0.4 * error, 0.1 * error, 0))
  expect_equal(two$preferences[2, ], 0.2 * error * c(0.5, -0.5))
  expect_equal(two$preferences[1, ], (2 + 0.2 * error * 0.2) * c(-0.5, 0.5))
  expect_equal(predict(agent_policy(two), 0L, type = "output")[1, ], two$preferences[1, ])
  expect_identical(agent_policy(two)$temperature, 1)
})

test_that("a step without a choice, or without features, leaves no trace and no warning", {
  policy <- spaces(states = 2)
  policy$possible <- rbind(c(TRUE, FALSE), c(TRUE, TRUE))
  agent <- agent_start(agent_actor_critic(lambda = 0.8, actor_lambda = 0.4), policy)
  learner <- learner(agent)
  expect_silent(learner$observe(1L, 1L, 10, 2L, FALSE, FALSE, 1L, NULL))
  one <- learner$export()
  expect_equal(one$preferences, rbind(c(0, -Inf), c(0, 0)))
  expect_equal(one$weights[, 1], c(1, 0))
  # State 0 has a row of zeros.
  seeing <- agent_start(
    agent_sarsa(features = function(state) cbind(state, state), lambda = 0.8), spaces()
  )
  expect_silent(zeros <- observe(seeing, step_of(0, 1, 10, 1)))
  expect_identical(zeros$weights, matrix(0, 2, 2))
  expect_silent(later <- observe(zeros, step_of(1, 1, 10, 0)))
  expect_true(all(later$weights[, 2] > 0))
})

test_that("values have the names of an observation's parts, and each action's a row", {
  policy <- spaces()
  policy$observation_space <- space_dict(hand = space_discrete(2, 5), last = space_discrete(2))
  policy$q <- cbind(1:4, 4:1)
  agent <- agent_start(agent_q(), policy)
  expect_equal(
    state_values(agent),
    data.frame(hand = c(5L, 5L, 6L, 6L), last = c(0L, 1L, 0L, 1L), value = c(4, 3, 3, 4))
  )
  expect_equal(
    utils::head(state_values(agent, actions = TRUE), 3),
    data.frame(hand = rep(5L, 3), last = c(0L, 0L, 1L), action = c(0L, 1L, 0L), value = c(1, 4, 2))
  )
  expect_identical(state_values(started(agent_q()), actions = TRUE)$state, rep(0:2, each = 2))
})

test_that("planning takes no steps of a schedule", {
  asked <- c()
  rate <- function(taken) {
    asked <<- c(asked, taken)
    0.1
  }
  agent <- started(agent_q(learning_rate = rate, planning = 3))
  observe(agent, step_of(0, 1, 10, 1))
  expect_identical(asked, c(0, 1))
})

test_that("a schedule changes with the steps", {
  expect_equal(schedule_linear(1, 0, 10)(c(0, 5, 20)), c(1, 0.5, 0))
  expect_equal(schedule_exponential(1, 0.01, 10)(c(0, 5, 20)), c(1, 0.1, 0.01))
  agent <- started(agent_q(discount = 0.5, learning_rate = schedule_linear(0.5, 0.1, 1)))
  one <- observe(agent, step_of(0, 1, 10, 1))
  expect_equal(one$weights[1, 2], 2 + 0.5 * 10.5)
  two <- observe(one, step_of(2, 1, 4, 1, terminated = TRUE))
  expect_equal(two$weights[3, 2], 4)
  three <- observe(two, step_of(1, 0, 13, 1, terminated = TRUE))
  expect_equal(three$weights[2, 1], 3 + 0.1 * 10)
})

test_that("a user's features have weights, which move by the features", {
  features <- function(observation) cbind(1, observation)
  agent <- agent_start(
    agent_q(discount = 0.5, learning_rate = 0.1, features = features), spaces()
  )
  one <- observe(agent, step_of(2, 1, 10, 0))
  expect_equal(one$weights, cbind(c(0, 0), c(1, 2)))
  expect_equal(predict(agent_policy(one), 0:2, type = "output")[, 2], c(1, 3, 5))
  expect_identical(act(agent_policy(one), 1L), 1L)
  changing <- agent_start(
    agent_q(features = function(x) if (x[[1]] == 2) diag(2)[1, , drop = FALSE] else diag(1)),
    spaces()
  )
  seen <- observe(changing, step_of(2, 1, 10, 2))
  expect_error(observe(seen, step_of(1, 1, 10, 1)), "2 features at first, and now 1",
               class = "gym_error_argument")
})

test_that("what cannot be learned so is refused", {
  refused <- function(code, text) {
    expect_error(code, text, class = "gym_error_argument", fixed = TRUE)
  }
  refused(agent_q(discount = 1.5), "`discount` must be a number above 0 and at most 1")
  refused(agent_q(learning_rate = 2), "`learning_rate` must be a number above 0 and at most 1")
  refused(agent_q(epsilon = -1), "`epsilon` must be a number from 0 to 1, or a function")
  refused(agent_q(features = 3), "`features` must be NULL")
  refused(agent_sarsa(n = 2, lambda = 0.5), "not both")
  refused(agent_td(3), "`policy` must be a policy")
  refused(agent_q(learning_rate = NULL), "`learning_rate` must be a number above 0 and at most 1")
  refused(agent_q(temperature = 0), "`temperature` must be a number of at least")
  refused(begins(started(agent_q(epsilon = function(taken) 2)), 0L),
          "The function `epsilon` must return a number from 0 to 1, and after 0 steps")
  refused(state_values(agent_q()), "a learner of a table")
  begin <- policy_table(matrix(0, 4, 2))
  refused(learn_q(walk_model(), iterations = 1, policy = begin, features = function(x) cbind(x)),
          "Only a learner of a table with a column for each action")
  refused(agent_monte_carlo(visits = "last"), "one of \"first\", \"every\"")
  box <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)))
  refused(learn_q(box, iterations = 1), "observations that can be counted")
  refused(learn_q(walk_model(), iterations = 1, policy = policy_random()), "a table of values")
  refused(state_values(3), "a learner of a table")
})

test_that("among actions with equal values a learner draws, but not among forbidden ones", {
  equal <- rbind(c(1, 1, -Inf), c(-Inf, 0, 0), c(2, 2, 2))
  policy <- spaces(3, 3)
  policy$q <- equal
  for (learner in list(agent_q(epsilon = 0), agent_sarsa(epsilon = 0))) {
    agent <- agent_start(learner, policy)
    chosen <- withr::with_seed(1, sapply(0:2, function(state) begins(agent, state, 200)))
    shares <- apply(chosen, 2, function(actions) table(factor(actions, 0:2)) / 200)
    expect_true(all(abs(shares - t(equal > -Inf) %*% diag(c(1 / 2, 1 / 2, 1 / 3))) < 0.12))
  }
})

test_that("the best action is taken where it is alone", {
  agent <- started(agent_q(epsilon = 0))
  expect_identical(vapply(0:2, begins, 0L, agent = agent), c(1L, 1L, 0L))
})
