known <- observation_parts$CartPole

# The spaces of CartPole, with its names or without.
four_named <- function(names = known) {
  space <- box_space(rep(-9, 4), rep(9, 4))
  space$names <- names
  list(
    spec = list(id = "CartPole-v1"), observation_space = space, action_space = discrete_space(2L)
  )
}

several <- withr::with_seed(1, matrix(rnorm(40), ncol = 4, dimnames = list(NULL, known)))
turned <- several[, c(3, 1, 4, 2)]

drawn_network <- function(...) withr::with_seed(1, policy_network(...))

# The forms in which the same observations can be given, and the expected answer to all of them.
expect_by_name <- function(ask, ordered = several, mixed = turned) {
  expected <- ask(unname(ordered))
  expect_identical(ask(mixed), expected)
  expect_identical(ask(data.frame(step = 1, mixed, action = 7)), expected)
  expect_identical(ask(mixed[1, ]), ask(unname(ordered[1, ])))
}

test_that("every policy takes observations by name where names are known", {
  env <- four_named()
  q <- drawn_network(c(4, 3, 2))
  drawing <- drawn_network(c(4, 3, 2), output = "softmax", activation = c("tanh", "identity"))
  action <- rep(0:1, 5)
  tiles <- new_feature_policy(
    basis_of(tile_coding(2, 3), env$observation_space, NULL),
    withr::with_seed(1, matrix(rnorm(1024), ncol = 2)), env
  )
  q <- policy_bind(q, env)
  drawing <- policy_bind(drawing, env)
  expect_by_name(function(o) act(q, o))
  expect_by_name(function(o) predict(q, o, type = "output"))
  expect_by_name(function(o) predict(drawing, o, type = "probability"))
  expect_by_name(function(o) policy_log_prob(drawing, o, if (is.null(dim(o))) 0 else action))
  expect_by_name(function(o) {
    policy_log_prob_gradient(drawing, o, if (is.null(dim(o))) 0 else action)
  })
  expect_by_name(function(o) policy_output_gradient(q, o))
  expect_by_name(function(o) act(tiles, o))
  expect_by_name(function(o) predict(tiles, o, type = "output"))
  parts <- four_named()
  parts$observation_space <- new_space(list(
    name = "MultiDiscrete", shape = list(4L), dtype = "int64", nvec = list(2L, 3L, 2L, 2L)
  ))
  parts$observation_space$names <- known
  table <- policy_bind(policy_table(withr::with_seed(1, matrix(rnorm(48), ncol = 2))), parts)
  digits <- t(sapply(1:10, function(i) c(i %% 2, i %% 3, i %/% 5 %% 2, i %/% 3 %% 2)))
  colnames(digits) <- known
  expect_by_name(function(o) act(table, o), digits, digits[, c(3, 1, 4, 2)])
  expect_by_name(function(o) predict(table, o, type = "output"), digits, digits[, c(3, 1, 4, 2)])
})

test_that("a model takes observations by name, with a formula or without", {
  skip_if_not_installed("nnet")
  steps <- data.frame(several, action = as.integer(several[, 3] > 0))
  by_formula <- policy_bind(as_policy(lm(action ~ ., steps)), four_named())
  expect_by_name(function(o) act(by_formula, o))
  fit <- withr::with_seed(1, nnet::nnet(several, steps$action, size = 2, trace = FALSE))
  by_matrix <- policy_bind(as_policy(fit), four_named())
  expect_by_name(function(o) predict(by_matrix, o, type = "output"))
})

test_that("missing names are errors that list them all, further ones only outside of data frames", {
  policy <- policy_bind(drawn_network(c(4, 1)), four_named())
  refused <- function(observation, ...) {
    for (ask in list(act, predict, policy_output_gradient)) {
      cnd <- expect_error(ask(policy, observation), class = "gym_error_argument")
      for (text in c(...)) expect_match(conditionMessage(cnd), text, fixed = TRUE)
    }
  }
  absent <- "it has no `cart_velocity`, `pole_angular_velocity`"
  refused(as.data.frame(several[, c(1, 3)]), absent, "Their names are `cart_position`,")
  refused(several[, c(1, 3)], absent)
  refused(several[1, c(1, 3)], absent)
  refused(data.frame(a = 1, b = 2, c = 3, d = 4), "it has no `cart_position`, `cart_velocity`, ")
  refused(cbind(several, angle = 1, speed = 2), "it has `angle`, `speed`", "`unname()`")
  refused(c(several[1, ], pole_angle = 1), "it has `pole_angle`")
  expect_error(predict(policy, data.frame(a = 1)), "`newdata` must have the names")
  expect_error(act(policy, data.frame(a = 1)), "`observation` must have the names")
})

test_that("where no names are known, numbers are taken by position, or by the table's names", {
  free <- drawn_network(c(4, 1))
  bound <- policy_bind(free, four_named(NULL))
  numbered <- `colnames<-`(several, paste0("obs_", 1:4))
  for (policy in list(free, bound)) {
    ask <- function(o) predict(policy, o, type = "output")
    expected <- ask(unname(several))
    expect_identical(ask(several), expected)
    expect_identical(ask(as.data.frame(several)), expected)
    expect_by_name(ask, numbered, numbered[, 4:1])
    expect_error(ask(numbered[, 1:3]), "it has no `obs_4`", class = "gym_error_argument")
  }
})

test_that("a name that another column of the table of steps has is found by both of its names", {
  space <- box_space(c(-9, -9), c(9, 9))
  space$names <- c("x", "reward")
  env <- four_named()
  env$observation_space <- space
  policy <- policy_bind(drawn_network(c(2, 1)), env)
  ask <- function(o) predict(policy, o, type = "output")
  expect_identical(ask(c(reward = 2, x = 1)), ask(c(1, 2)))
  expect_identical(ask(data.frame(reward = 9, obs_reward = 2, x = 1)), ask(c(1, 2)))
})

test_that("the state in a table of steps is found beside its other columns", {
  field <- four_named()
  field$observation_space <- discrete_space(3L)
  field$observation_space$names <- "position"
  policy <- policy_bind(policy_table(rbind(0:1, 1:0, 0:1)), field)
  steps <- data.frame(episode = 1L, position = c(2L, 1L, 0L), reward = 0)
  expect_identical(act(policy, steps), c(1L, 0L, 1L))
  expect_identical(predict(policy, steps), c(1L, 0L, 1L))
  expect_error(act(policy, steps["reward"]), "it has no `position`", class = "gym_error_argument")
  # Labels of states are not names of numbers.
  expect_identical(act(policy, c(left = 2L, right = 1L)), c(1L, 0L))
})

test_that("the parts of a Tuple and a Dict are taken by name", {
  parts <- lapply(c(4L, 3L, 2L), discrete_space)
  cards <- four_named()
  cards$observation_space <- space_tuple(parts[[1]], parts[[2]], parts[[3]])
  cards$observation_space$names <- observation_parts$Blackjack
  q <- withr::with_seed(1, matrix(rnorm(48), ncol = 2))
  by_key <- cards
  by_key$observation_space <- space_dict(
    player_sum = parts[[1]], dealer_card = parts[[2]], usable_ace = parts[[3]]
  )
  hands <- data.frame(player_sum = 0:3, dealer_card = c(2L, 0L, 1L, 2L), usable_ace = c(0L, 1L))
  expected <- max.col(q[hands$player_sum * 6 + hands$dealer_card * 2 + hands$usable_ace + 1, ]) - 1L
  for (env in list(cards, by_key)) {
    policy <- policy_bind(policy_table(q), env)
    expect_identical(act(policy, hands), expected)
    expect_identical(predict(policy, data.frame(episode = 1, hands[3:1])), expected)
    expect_identical(act(policy, as.list(hands[2, 3:1])), expected[[2]])
    expect_error(act(policy, hands["usable_ace"]), "it has no `.*player_sum`, `.*dealer_card`",
                 class = "gym_error_argument")
    model <- policy_bind(as_policy(lm(
      action ~ ., data.frame(observation_columns(env$observation_space, as.list(hands)),
                             action = 0:1)
    )), env)
    expect_identical(act(model, as.list(hands[3:1])), act(model, as.list(hands)))
  }
  expect_error(act(policy_bind(policy_table(q), cards), list(sum = 1, card = 1, ace = 0)),
               "it has `sum`, `card`, `ace`", class = "gym_error_argument")
})

test_that("features of a user's function see the names of play, asked by hand, too", {
  env <- four_named()
  lean <- function(observation) cbind(observation[, "pole_angle"] > 0, 1)
  policy <- new_feature_policy(
    basis_of(lean, env$observation_space, NULL), rbind(c(0, 2), c(1, 0)), env
  )
  expect_identical(act(policy, unname(several)), as.integer(several[, 3] > 0))
  expect_by_name(function(o) act(policy, o))
})
