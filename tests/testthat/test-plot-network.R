autoplot <- ggplot2::autoplot

small_network <- function(...) {
  policy_network(c(4, 2, 1), weights = list(
    rbind(c(-1, 0.5, 0, 0.25), c(0.1, -0.2, 0.3, -0.4)), matrix(c(0.8, -0.6), nrow = 1)
  ))
}

test_that("each weight is a line between its neurons, as wide as it is far from 0", {
  policy <- small_network()
  weights <- network_plot_data(policy)$weights
  expect_identical(nrow(weights), 10L)
  for (i in seq_len(nrow(weights))) {
    weight <- policy$weights[[weights$layer[i]]][weights$to[i], weights$from[i]]
    expect_identical(weights$weight[i], weight)
  }
  expect_equal(weights$width, abs(weights$weight) / 1)
  expect_identical(weights$sign == "negative", weights$weight < 0)
  expect_identical(weights$x, weights$layer - 1)
  expect_identical(weights$xend, as.numeric(weights$layer))
})

test_that("lines begin and end where the neurons stand", {
  data <- network_plot_data(small_network())
  place <- function(layer, neuron) {
    key <- paste(data$neurons$layer, data$neurons$neuron)
    data$neurons$y[match(paste(layer, neuron), key)]
  }
  expect_identical(data$weights$y, place(data$weights$layer, data$weights$from))
  expect_identical(data$weights$yend, place(data$weights$layer + 1, data$weights$to))
  expect_identical(data$neurons$y[1:4], c(0.875, 0.625, 0.375, 0.125))
  expect_identical(data$layers$label, c("observation", "tanh", "logistic"))
})

test_that("few weights have numbers, which lie apart; many have none unless asked", {
  weights <- network_plot_data(small_network())$weights
  expect_identical(weights$label[weights$weight == -0.4], "-0.40")
  for (layer in split(weights, weights$layer)) {
    expect_gt(min(diff(sort(layer$label_y))), 0.04)
  }
  expect_identical(unique(network_plot_data(small_network(), digits = 0)$weights$label), "")
  expect_identical(network_plot_data(small_network(), digits = 1)$weights$label[[1]], "-1.0")
  expect_identical(unique(network_plot_data(policy_network(c(9, 3)))$weights$label), "")
})

test_that("of big layers the first neurons and the last are drawn, and dots between", {
  data <- network_plot_data(policy_network(c(100, 12, 2)))
  first <- data$neurons[data$neurons$layer == 1, ]
  expect_identical(first$neuron, c(1:10, 100L))
  expect_identical(first$label[c(1, 11)], c("obs_1", "obs_100"))
  expect_identical(nrow(data$dots), 1L)
  expect_lt(data$dots$y, first$y[[10]])
  expect_gt(data$dots$y, first$y[[11]])
  expect_identical(sum(data$neurons$layer == 2), 12L)
  expect_identical(nrow(data$weights), 11L * 12L + 12L * 2L)
  few <- network_plot_data(policy_network(c(100, 2)), most = 5)
  expect_identical(sum(few$neurons$layer == 1), 4L)
})

test_that("the width is relative to all weights, drawn or not", {
  policy <- policy_network(c(100, 1), weights = list(matrix(c(rep(1, 49), -4, rep(2, 50)), 1)))
  expect_identical(unique(network_plot_data(policy)$weights$width), c(0.25, 0.5))
  zero <- policy_network(c(2, 1), weights = list(matrix(0, 1, 2)))
  expect_identical(network_plot_data(zero)$weights$width, c(0, 0))
})

test_that("inputs and outputs have the environment's names where the policy knows it", {
  labels <- function(policy) network_plot_data(policy)$neurons$label
  expect_identical(labels(small_network())[c(1, 4, 7)],
                   c("obs_1", "obs_4", "above 0.5:\n1\n\notherwise:\n0"))
  env <- fake_environment(id = "CartPole-v1")
  bound <- policy_bind(small_network(), env)
  expect_identical(bound$env_id, "CartPole-v1")
  expect_identical(labels(bound)[c(3, 7)],
                   c("pole_angle", "above 0.5:\n1: push right\n\notherwise:\n0: push left"))
  found <- search_random(env, rounds = 2, seed = 1)$policy
  expect_identical(labels(found)[[1]], "cart_position")
})

test_that("outputs of other kinds say what they decide", {
  last <- function(policy, env) {
    data <- network_plot_data(policy_bind(policy, env))
    data$neurons$label[data$neurons$layer == max(data$neurons$layer)]
  }
  choice <- fake_environment(id = "MountainCar-v0", action_space = discrete_space(3L),
                             observation_space = box_space(c(-1, -1), c(1, 1)))
  expect_identical(last(policy_network(c(2, 3)), choice),
                   c("0: push left", "1: no push", "2: push right"))
  shifted <- fake_environment(action_space = discrete_space(3L, start = 5L))
  expect_identical(last(policy_network(c(4, 3)), shifted), c("5", "6", "7"))
  box <- fake_environment(action_space = box_space(c(-2, 0), c(2, 1)))
  expect_identical(last(policy_network(c(4, 2)), box), c("action_1\n-2 to 2", "action_2\n0 to 1"))
  tanh <- policy_network(c(4, 1), c("tanh", "tanh")[c(1, 2)])
  expect_identical(last(tanh, fake_environment()), "above 0:\n1\n\notherwise:\n0")
  lake <- fake_environment(observation_space = discrete_space(3L), id = "FrozenLake-v1")
  bound <- policy_bind(policy_network(c(3, 1)), lake)
  expect_identical(network_plot_data(bound)$neurons$label[1:3],
                   c("position 0", "position 1", "position 2"))
})

test_that("any network is drawn, positive weights solid and negative ones dashed", {
  policy <- small_network()
  picture <- drawn(autoplot(policy))
  lines <- layers_of(picture, "GeomSegment")[[1]]
  weights <- unlist(policy$weights)
  expect_setequal(round(lines$linewidth / 2.5, 6), abs(weights)[weights != 0])
  expect_identical(sum(lines$linetype == "31"), 4L)
  expect_identical(lines$linetype == "31", lines$colour == gym_colours[["gold"]])
  expect_identical(picture$labels$subtitle, "network 4-2-1, wider lines are further from 0")
  left <- ggplot2::ggplot_build(picture)$layout$panel_params[[1]]$y$get_labels()
  expect_identical(sort(left), paste0("obs_", 1:4))
  drawn(autoplot(policy_network(c(1, 1))))
  drawn(autoplot(policy_network(c(30, 15, 10)), neurons = 8, digits = 3))
  drawn(autoplot(policy_network(c(2, 1), weights = list(matrix(0, 1, 2)))))
})

test_that("the environment may be named in the call, and must fit", {
  env <- fake_environment(id = "CartPole-v1")
  expect_identical(drawn(autoplot(small_network(), env))$labels$title, "CartPole-v1")
  expect_length(env$seeds, 0)
  expect_identical(env$closed, 0L)
  expect_error(plot(policy_network(c(3, 1)), env), "takes 3 inputs", class = "gym_error_argument")
  expect_error(plot(small_network(), env = 3), "`env`", class = "gym_error_argument")
  expect_error(plot(small_network(), neurons = 2), "`neurons` must be a whole number of at least 3",
               class = "gym_error_argument")
  expect_error(plot(small_network(), digits = -1), "`digits`", class = "gym_error_argument")
})

test_that("a policy without weights says that it cannot be drawn", {
  expect_error(plot(policy_random()), "Only a network can be drawn, not a policy that is random.",
               fixed = TRUE, class = "gym_error_argument")
})

test_that("an environment named by its id is made for its names and closed", {
  client <- local_server()
  local_device()
  plot(small_network(), "CartPole-v1", client = client)
  expect_length(env_list_all(client), 0)
})

test_that("biases are the weights of a constant, the last of its layer", {
  policy <- policy_network(c(3, 2, 1), bias = TRUE, weights = list(
    rbind(c(1, 2, 3, 0.5), c(4, 5, 6, -0.5)), rbind(c(7, 8, 0.25))
  ))
  data <- network_plot_data(policy)
  expect_identical(as.vector(table(data$neurons$layer)), c(4L, 3L, 1L))
  expect_identical(data$neurons$neuron[data$neurons$bias], c(4L, 3L))
  expect_identical(data$neurons$label[4], "bias")
  expect_identical(nrow(data$weights), 11L)
  expect_identical(sort(data$weights$weight), sort(unlist(policy$weights)))
  of_bias <- data$weights[data$weights$layer == 1 & data$weights$from == 4, ]
  expect_identical(of_bias$weight, c(0.5, -0.5))
  expect_identical(of_bias$y, rep(data$neurons$y[4], 2))
  texts <- layers_of(drawn(autoplot(policy)), "GeomText")
  expect_identical(texts[[1]]$label, c("1", "1"))
})
