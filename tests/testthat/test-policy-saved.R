policies_to_save <- function() {
  withr::local_seed(1)
  table <- matrix(runif(32), 16)
  steps <- data.frame(position = 0:15, action = rep(c(1, 2), 8))
  network <- policy_network(c(16, 4))
  list(
    network = network,
    drawing = policy_network(c(16, 4), output = "softmax"),
    random = policy_random(),
    table = function(observation) max.col(table[observation + 1L, , drop = FALSE], "first"),
    glm = as_policy(glm(factor(action) ~ position, binomial, steps)),
    candidates = policy_candidates(network, rbind(coef(network), -coef(network))),
    list = list(network, policy_random()),
    tree = if (requireNamespace("rpart", quietly = TRUE)) {
      as_policy(rpart::rpart(factor(action) ~ position, steps, minsplit = 2))
    },
    nnet = if (requireNamespace("nnet", quietly = TRUE)) {
      as_policy(nnet::nnet(factor(action) ~ position, steps, size = 1, trace = FALSE))
    }
  )
}

test_that("policies of every kind are saved and play the same in another session", {
  client <- test_client()
  policies <- Filter(Negate(is.null), policies_to_save())
  play <- function(policy) {
    rollout("FrozenLake-v1", policy, 5, seed = 1, max_steps = 50, client = client)$episodes
  }
  saved <- withr::local_tempfile(fileext = ".rds")
  played <- withr::local_tempfile(fileext = ".rds")
  saveRDS(policies, saved)
  run <- run_session(
    client,
    sprintf("policies <- readRDS(\"%s\")", saved),
    "play <- function(policy) {",
    "  rollout(\"FrozenLake-v1\", policy, 5, seed = 1, max_steps = 50, client = server)$episodes",
    "}",
    sprintf("saveRDS(lapply(policies, play), \"%s\")", played)
  )
  expect_identical(run$status, 0L, info = run$stderr)
  elsewhere <- readRDS(played)
  expect_named(elsewhere, names(policies))
  for (name in names(policies)) {
    expect_identical(elsewhere[[name]], play(policies[[name]]), info = name)
  }
})

# All types of objects inside of a value, as it is saved: environments and attributes, too.
has_pointer <- function(x, seen = new.env()) {
  if (typeof(x) == "externalptr") {
    return(TRUE)
  }
  parts <- if (is.environment(x)) {
    key <- format.default(x)
    if (isNamespace(x) || identical(x, globalenv()) || exists(key, seen, inherits = FALSE)) {
      return(FALSE)
    }
    assign(key, TRUE, seen)
    as.list(x, all.names = TRUE)
  } else if (is.function(x)) {
    list(environment(x))
  } else if (is.list(x)) {
    unclass(x)
  }
  any(vapply(c(parts, attributes(x)), has_pointer, NA, seen = seen))
}

test_that("the policy in a rollout holds no connection, and little else", {
  client <- test_client()
  for (policy in policies_to_save()[c("network", "random", "candidates", "list")]) {
    played <- rollout("FrozenLake-v1", policy, 2, seed = 1, max_steps = 5, client = client)
    expect_false(has_pointer(played$policy))
    expect_lt(length(serialize(played$policy, NULL)), 8000)
  }
  expect_true(has_pointer(list(local_env())))
})
