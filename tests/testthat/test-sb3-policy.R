skip_unless_sb3 <- function() {
  skip_unless_all()
  skip_if_not(has_sb3(), "Stable-Baselines3 is not installed")
}

read_actions <- function(folder) {
  file <- file.path(folder, "actions.safetensors")
  read_tensors(readBin(file, "raw", file.size(file)))$tensors
}

# Models of all algorithms, once for this file.
sb3_models <- local({
  folder <- NULL
  function() {
    if (is.null(folder)) {
      made <- tempfile("sb3-models-")
      dir.create(made)
      run <- run_quietly(
        sb3_python(NULL), c(test_path("sb3_models.py"), made, "10000"), 300, server_environment()
      )
      expect_identical(run$stderr, "")
      folder <<- made
    }
    folder
  }
})

expect_same_actions <- function(policy, actions) {
  discrete <- length(dim(actions$predicted)) < 2L
  outputs <- predict(policy, actions$observations, type = "output")
  # That of DQN and of a softmax: the values or the logits.
  expect_lt(max(abs(outputs - actions$outputs)), 1e-10)
  policy$action_space <- if (discrete) space_discrete(2) else space_box(-2, 2)
  own <- act(policy, actions$observations, draw = FALSE)
  if (discrete) {
    close <- abs(actions$outputs[, 1] - actions$outputs[, 2]) < 1e-5
    expect_identical(own[!close], as.integer(actions$predicted)[!close])
    expect_true(all(0:1 %in% own))
  } else {
    expect_lt(max(abs(own - actions$predicted)), 4 * 1e-5)
    expect_gt(stats::sd(own), 0.01)
  }
}

test_that("policies of every algorithm act in R as they do in Python", {
  skip_unless_sb3()
  cases <- list.dirs(sb3_models(), recursive = FALSE)
  expect_length(cases, 16)
  for (folder in cases) {
    expect_same_actions(sb3_policy(folder), read_actions(folder))
  }
  gaussian <- sb3_policy(file.path(sb3_models(), "PPO of a Box"))
  expect_identical(gaussian$output, "gaussian")
})

test_that("a zip file is read by its weights and its plain text", {
  skip_unless_sb3()
  for (case in c("SAC", "PPO of a Box", "QRDQN", "A2C with LeakyReLU")) {
    folder <- file.path(sb3_models(), case)
    expect_equal(sb3_policy(file.path(folder, "zip"))$weights, sb3_policy(folder)$weights)
  }
})

test_that("moments are an argument of a zip file, and missed if they are known to exist", {
  skip_unless_sb3()
  folder <- withr::local_tempdir()
  file <- file.path(folder, "model.zip")
  file.copy(file.path(sb3_models(), "SAC", "model.zip"), file)
  writeLines("", file.path(folder, "vecnormalize.pkl"))
  expect_error(as_policy(file), "moments = list", class = "gym_error_argument")
  without <- as_policy(file, moments = FALSE)
  expect_null(without$moments)
  expect_equal(without$weights, sb3_policy(file.path(sb3_models(), "SAC"))$weights)
  policy <- as_policy(file, moments = list(mean = 1:3, variance = c(1, 4, 9), epsilon = 0))
  expect_equal(policy$moments[c("mean", "scale")], list(mean = 1:3, scale = 1 / (1:3)))
  expect_error(as_policy(file, moments = list(mean = 1, variance = 1)), "3 numbers")
})

test_that("a pickle is refused, with what it could do", {
  file <- withr::local_tempfile(fileext = ".pkl")
  writeLines("", file)
  expect_error(as_policy(file), "can run any program", class = "gym_error_argument")
  expect_error(as_policy("no.zip"), "a file that exists", class = "gym_error_argument")
})
