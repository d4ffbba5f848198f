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

# How many of the actions differ, of those chosen one by one and of those in groups.
differing <- function(policies, observation) {
  folder <- withr::local_tempdir()
  names <- file.path(folder, seq_along(policies))
  Map(function(policy, name) {
    write_case(policy, observation, paste0(name, ".safetensors"))
  }, policies, names)
  processx::run(
    working_python(), c(test_path("act_on_server.py"), folder),
    env = c("current", PYTHONPATH = server_modules(), OPENBLAS_NUM_THREADS = "1")
  )
  unlist(Map(function(policy, name) {
    own <- act(policy, observation)
    if (is.matrix(own)) own <- to_float32(t(own))
    theirs <- readBin(paste0(name, ".acted"), "numeric", 2L * length(own))
    sum(theirs != rep(as.vector(own), 2L))
  }, policies, names))
}

# Where the modules are that the server of the session runs.
server_modules <- function() system.file("server", package = "gym")

actions <- list(
  several = space_discrete(3, start = 2), two = space_discrete(2),
  box = space_box(c(-2, -1), c(1, 3))
)

test_that("networks act the same with every activation, saturated, tied, with a bias, normalized", {
  skip_if_no_server()
  skip_if_not_installed("sigmoid")
  withr::local_seed(1)
  # With make soak PARTS=policies more than a million.
  rows <- if (soaks("GYM_TEST_POLICIES")) 80L else 2L
  observation <- to_float32(matrix(rnorm(rows * 256 * 4), ncol = 4L))
  # Rows of zeros tie all outputs.
  observation[1:3, ] <- 0
  cases <- expand.grid(
    activation = c(base_activations, sigmoid_activations), space = names(actions),
    scale = c(1, 1000), stringsAsFactors = FALSE
  )
  policies <- Map(function(activation, space, scale) {
    policy <- policy_network(
      c(4, 5, switch(space, several = 3, two = 1, box = 2)), c("tanh", activation),
      bias = space != "two"
    )
    policy <- with_weights(policy, scale * coef(policy))
    if (scale > 1) policy$moments <- new_moments(9, c(0.1, -0.2, 0, 1), c(1, 2, 3, 0))
    bound_to(policy, actions[[space]])
  }, cases$activation, cases$space, cases$scale)
  cases$differ <- differing(policies, observation)
  expect_identical(cases[cases$differ > 0, ], cases[0, ])
})
