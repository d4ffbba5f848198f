# The server's policies act as act() does: the same discrete actions, and the same ones of a Box as
# float32, which is what environments take.

observed_space <- space_box(rep(-Inf, 4), rep(Inf, 4))

to_float32 <- function(values) {
  read <- readBin(writeBin(as.double(values), raw(), size = 4L), "numeric", length(values), 4L)
  array(read, dim(values) %||% length(values))
}

bound_to <- function(policy, space) {
  policy$action_space <- space
  policy$observation_space <- observed_space
  policy
}

write_case <- function(policy, observation, file) {
  space <- policy$action_space
  data <- policy_data(policy, list(action_space = space))
  described <- if (inherits(space, "gym_space_discrete")) {
    space[c("n", "start")]
  } else {
    list(low = as.list(as.numeric(space$low)), high = as.list(as.numeric(space$high)))
  }
  tensors <- lapply(c(
    list(observation = observation),
    stats::setNames(data$tensors, paste0("policy/", names(data$tensors)))
  ), data_tensor, dtype = "F64")
  writeBin(
    write_tensors(tensors, c(policy = to_json(data$document), space = to_json(described))), file
  )
}

# What the server's policies do, one by one and then in groups: of a Box an action in each row.
acted_on_server <- function(policies, observation) {
  folder <- withr::local_tempdir()
  names <- file.path(folder, seq_along(policies))
  Map(function(policy, name) {
    write_case(policy, observation, paste0(name, ".safetensors"))
  }, policies, names)
  processx::run(
    working_python(), c(test_path("act_on_server.py"), folder),
    env = c("current", PYTHONPATH = server_modules(), OPENBLAS_NUM_THREADS = "1")
  )
  Map(function(policy, name) {
    numbers <- max(1, prod(policy$action_space$shape))
    acted <- readBin(paste0(name, ".acted"), "numeric", 2 * numbers * nrow(observation))
    if (numbers > 1) t(matrix(acted, numbers)) else acted
  }, policies, names)
}

# How many of the actions differ.
differing <- function(policies, observation) {
  unlist(Map(function(policy, theirs) {
    own <- act(policy, observation)
    if (is.matrix(own)) own <- to_float32(own)
    sum(theirs != if (is.matrix(own)) rbind(own, own) else c(own, own))
  }, policies, acted_on_server(policies, observation)))
}

# Where the modules are that the server of the session runs.
server_modules <- function() system.file("server", package = "gym")

actions <- list(
  several = space_discrete(3, start = 2), two = space_discrete(2),
  box = space_box(c(-2, -1), c(1, 3))
)

test_that("networks act the same with every activation, saturated, tied, with a bias, normalized", {
  skip_if_no_server()
  withr::local_seed(1)
  # With make soak PARTS=policies more than a million.
  rows <- if (soaks("GYM_TEST_POLICIES")) 80L else 2L
  observation <- to_float32(matrix(rnorm(rows * 256 * 4), ncol = 4L))
  # Rows of zeros tie all outputs.
  observation[1:3, ] <- 0
  cases <- expand.grid(
    activation = activations, space = names(actions),
    scale = c(1, 1000), stringsAsFactors = FALSE
  )
  policies <- Map(function(activation, space, scale) {
    policy <- policy_network(
      c(4, 5, switch(space, several = 3, two = 1, box = 2)), c("tanh", activation),
      bias = space != "two"
    )
    policy <- with_weights(policy, scale * coef(policy))
    if (scale > 1) policy$moments <- new_moments(9, c(0.1, -0.2, 0, 1), c(1, 2, 3, 0))
    if (activation == "identity") policy$clip_obs <- 1.5
    bound_to(policy, actions[[space]])
  }, cases$activation, cases$space, cases$scale)
  cases$differ <- differing(policies, observation)
  expect_identical(cases[cases$differ > 0, ], cases[0, ])
})

test_that("networks that draw have on the server the probabilities that they have in R", {
  skip_if_no_server()
  withr::local_seed(1)
  n <- 20L * 256L
  observation <- matrix(rep(c(0.5, -1, 0.25, 2), each = n), n)
  outputs <- c("softmax", "epsilon-greedy", "gaussian")
  policies <- lapply(outputs, function(output) {
    gaussian <- output == "gaussian"
    policy <- policy_network(
      c(4, 5, if (gaussian) 2 else 3), bias = TRUE, output = output, log_std = -0.5, epsilon = 0.3
    )
    bound_to(policy, actions[[if (gaussian) "box" else "several"]])
  })
  acted <- acted_on_server(policies, observation)
  for (i in 1:2) {
    wanted <- predict(policies[[i]], observation[1, ], "probability")
    for (part in list(seq_len(n), n + seq_len(n))) {
      expect_lt(max(abs(tabulate(acted[[i]][part] - 1L, 3) / n - wanted)), 0.03)
    }
  }
  # Neither here nor there are they cut at the bounds.
  drawn <- acted[[3]]
  expect_gt(max(abs(drawn)), 3)
  expect_lt(max(abs(colMeans(drawn) - predict(policies[[3]], observation[1, ], "output"))), 0.05)
  expect_lt(max(abs(apply(drawn, 2, sd) - exp(-0.5))), 0.05)
})
