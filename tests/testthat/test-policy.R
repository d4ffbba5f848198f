test_that("what is no policy cannot act", {
  expect_error(act("left", 1:4), "`policy` must be a policy", class = "gym_error_argument")
  expect_error(act(structure(list(), class = c("mine", "gym_policy")), 1),
               "no method of `act()` for a policy of class mine", fixed = TRUE)
})

test_that("a vector is one observation, a matrix has one in each row", {
  space <- box_space(rep(-1, 3), rep(1, 3))
  for (known in list(NULL, space)) {
    expect_identical(
      observation_rows(c(1, 2, 3), known), list(values = rbind(c(1, 2, 3)), one = TRUE)
    )
    rows <- matrix(c(1, 2, 3, 4, 5, 6), nrow = 2)
    expect_identical(observation_rows(rows, known), list(values = rows, one = FALSE))
    expect_identical(observation_rows(rows[1, , drop = FALSE], known)$one, FALSE)
  }
})

test_that("arrays are flattened row by row, as Gymnasium does", {
  space <- box_space(rep(-1, 6), rep(1, 6), shape = c(2L, 3L))
  one <- rbind(1:3, 4:6)
  expect_identical(observation_rows(one, space), list(values = rbind(1:6), one = TRUE))
  two <- array(0L, c(2, 2, 3))
  two[1, , ] <- one
  two[2, , ] <- one + 10L
  expect_identical(
    observation_rows(two, space), list(values = rbind(1:6, 11:16), one = FALSE)
  )
})

test_that("of single numbers a vector is many observations", {
  for (space in list(discrete_space(16L), box_space(0, 1, shape = integer()))) {
    expect_identical(observation_rows(3, space), list(values = matrix(3), one = TRUE))
    expect_identical(observation_rows(c(3, 4), space), list(values = cbind(c(3, 4)), one = FALSE))
  }
})

test_that("a function sees the names of a single observation, too", {
  seen <- NULL
  follow <- function(observation) {
    seen <<- observation
    as.integer(observation[, "angle"] > 0)
  }
  expect_identical(act(follow, c(position = 1, angle = 2)), 1L)
  expect_identical(seen, cbind(position = 1, angle = 2))
})

test_that("a data frame of observations is as good as the matrix of them, to every policy", {
  seeing <- function(space, actions = 2L) {
    fake_environment(observation_space = space, action_space = discrete_space(actions))
  }
  box <- seeing(box_space(c(-1, -1), c(1, 1)))
  basis <- basis_of(tile_coding(2, 2), box$observation_space, NULL)
  policies <- list(
    policy_random(discrete_space(2L)), policy_bind(policy_random(), box),
    policy_network(c(2, 3, 2)), policy_bind(policy_linear(), box),
    new_feature_policy(basis, matrix(runif(2 * basis$count), ncol = 2), box),
    function(observation) as.integer(observation[, "b"] > 0),
    policy_bind(policy_table(diag(4)), seeing(space_multi_discrete(c(2, 2)), 4L))
  )
  for (policy in policies) {
    rows <- cbind(a = c(0, 1, 1), b = c(1, 0, 1))
    answer <- function(observation) {
      set.seed(1)
      act(policy, observation)
    }
    expect_length(answer(rows), 3L)
    expect_identical(answer(as.data.frame(rows)), answer(rows))
    expect_identical(answer(as.data.frame(rows)[2, ]), answer(rows[2, , drop = FALSE]))
  }
  table <- policy_table(diag(4))
  expect_identical(act(table, data.frame(state = 3:1)), 3:1)
  # Of observations with parts, each column is a part.
  parts <- policy_bind(policy_random(), seeing(space_tuple(space_discrete(2), space_discrete(3))))
  expect_length(act(parts, data.frame(0:1, c(0, 0))), 2L)
  expect_length(act(parts, list(0, 0)), 1L)
})

test_that("no observations get no actions, from a policy of any kind", {
  seeing <- function(actions, space = box_space(c(-1, -1), c(1, 1))) {
    fake_environment(observation_space = space, action_space = actions)
  }
  two <- seeing(discrete_space(2L))
  numbers <- seeing(box_space(c(-1, -1), c(1, 1)))
  basis <- basis_of(tile_coding(2, 2), two$observation_space, NULL)
  # A function that gives one row for none.
  one_row <- basis_of(function(observation) cbind(1, observation[, 1]), two$observation_space, NULL)
  steps <- data.frame(obs_1 = c(0.1, 0.9), obs_2 = 0, action = 0:1)
  none <- list(matrix(0, 0, 2), steps[0, c("obs_1", "obs_2")])
  choosing <- list(
    policy_bind(policy_random(), two),
    policy_bind(policy_network(c(2, 3, 1)), two),
    policy_bind(policy_network(c(2, 3, 2), output = "softmax", bias = TRUE), two),
    policy_bind(policy_network(c(2, 2), output = "epsilon-greedy", normalize = TRUE), two),
    new_feature_policy(basis, matrix(0, basis$count, 2), two),
    new_feature_policy(one_row, matrix(0, 2, 2), two),
    policy_bind(as_policy(lm(action ~ obs_1, steps)), two),
    function(observation) as.integer(observation[, 2] > 0)
  )
  for (policy in choosing) for (observation in none) {
    expect_identical(act(policy, observation), integer())
    if (!is.function(policy) && !inherits(policy, "gym_policy_random")) {
      expect_identical(predict(policy, observation), integer())
    }
  }
  drawing <- list(
    policy_bind(policy_random(), numbers),
    policy_bind(policy_network(c(2, 3, 2)), numbers),
    policy_bind(policy_network(c(2, 2), output = "gaussian"), numbers),
    policy_bind(as_policy(lm(cbind(action, obs_2) ~ obs_1, steps)), numbers)
  )
  for (policy in drawing) for (observation in none) {
    expect_identical(dim(act(policy, observation)), c(0L, 2L))
  }
  expect_identical(dim(predict(choosing[[3]], none[[2]], type = "probability")), c(0L, 2L))
  expect_identical(predict(choosing[[2]], none[[2]], type = "output"), numeric())
  expect_identical(act(policy_table(diag(3)), integer()), integer())
  expect_identical(act(policy_table(diag(3)), data.frame(state = integer())), integer())
  pixels <- seeing(discrete_space(2L), space_box(0, 1, shape = c(2, 3)))
  expect_identical(act(policy_bind(policy_linear(), pixels), array(0, c(0, 2, 3))), integer())
})

test_that("observations of another length than the environment's have no features", {
  env <- fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)))
  basis <- basis_of(tile_coding(2, 2), env$observation_space, NULL)
  policy <- new_feature_policy(basis, matrix(0, basis$count, 2), env)
  expect_error(act(policy, c(0, 0, 0, 0)), "2 numbers", class = "gym_error_argument")
})

test_that("a training plays as its policy, trainings as the policies of their seeds", {
  training <- structure(
    list(policy = function(observation) rep(1L, nrow(observation))), class = "gym_training"
  )
  trainings <- structure(list(trainings = list(`3` = training, `4` = training)),
                         class = "gym_trainings")
  play <- function(policy) {
    rollout(fake_vector_env(2), policy, episodes = 2, seed = 1, steps = TRUE)$steps
  }
  alone <- play(training$policy)
  expect_identical(play(training), alone)
  expect_identical(unique(play(trainings)$candidate), 1:2)
  expect_identical(unique(play(list(a = training, b = policy_random()))$candidate), 1:2)
})

test_that("predicting with a policy is predicting with the search that found it", {
  search <- search_random(fake_environment(id = "CartPole-v1"), rounds = 2, target = Inf, seed = 1)
  played <- rollout(fake_environment(id = "CartPole-v1"), search$policy, seed = 1, steps = TRUE)
  for (newdata in list(played$steps, as.matrix(played$steps[3:6]), unlist(played$steps[1, 3:6]))) {
    for (type in c("action", "output")) {
      expect_identical(
        predict(search$policy, newdata, type = type), predict(search, newdata, type = type)
      )
    }
  }
  expect_error(predict(policy_random(), 1:4), "needs the policy to be a network",
               class = "gym_error_argument")
  expect_error(predict(search$policy, 1:4, type = "weights"), "`type`",
               class = "gym_error_argument")
})
