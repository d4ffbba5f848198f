# The updates of the agents against an implementation in NumPy, given the same numbers.

numpy_updates <- function(cases) {
  file <- withr::local_tempfile(fileext = ".json")
  jsonlite::write_json(cases, file, auto_unbox = TRUE, digits = NA, matrix = "rowmajor")
  said <- processx::run(working_python(), c(test_path("update_agents.py"), file))
  jsonlite::fromJSON(said$stdout, simplifyVector = TRUE, simplifyDataFrame = FALSE)
}

box_env <- function() fake_environment(action_space = box_space(c(-1, -1), c(1, 1)))

# Returns and observations as playing might bring them, some of them equal.
some_results <- function(asked) {
  n <- nrow(asked)
  list(
    weights = asked, returns = round(stats::rnorm(n, 10, 3)), lengths = sample(5:9, n, TRUE),
    observations = cbind(stats::rnorm(20, 1e3), stats::rnorm(20), 5, stats::runif(20))
  )
}

# Ten updates: the agent after each, and what it was told.
ten_updates <- function(agent, change = identity) {
  set.seed(7)
  agent <- agent_start(agent, policy_bind(policy_linear(bias = TRUE), box_env()))
  lapply(1:10, function(i) {
    told <- change(some_results(agent_ask(agent)))
    told$moments <- moments_of(told$observations)
    agent <<- agent_tell(agent, told)
    list(agent = agent, told = told)
  })
}

test_that("updates of augmented random search are those of NumPy, in each version", {
  observation <- c(1001, 0.5, 6, 0.1)
  agents <- lapply(c("V1", "V1-t", "V2", "V2-t"), function(version) {
    agent_ars(directions = 6, top = if (endsWith(version, "-t")) 2 else 6, step_size = 0.3,
              noise = 0.1, version = version, shift = 0.7)
  })
  updates <- lapply(agents, ten_updates)
  expected <- numpy_updates(Map(function(agent, ten) {
    odd <- c(TRUE, FALSE)
    list(
      agent = "ars", start = rep(0, 10), top = 2, directions = 6, version = agent$version,
      shift = agent$shift, step_size = agent$step_size, observation = observation,
      updates = lapply(ten, function(one) {
        told <- one$told
        list(
          directions = attr(told$weights, "directions"), along = told$returns[odd],
          against = told$returns[!odd], steps_along = told$lengths[odd],
          steps_against = told$lengths[!odd], observations = told$observations
        )
      })
    )
  }, agents, updates))
  for (version in seq_along(agents)) {
    for (i in 1:10) {
      policy <- agent_policy(updates[[version]][[i]]$agent)
      wanted <- expected[[version]][[i]]
      expect_equal(coef(policy), wanted$weights, tolerance = 1e-12)
      shown <- normalized(rbind(observation), policy$moments, policy$clip_obs)
      expect_equal(as.vector(shown), wanted$shown, tolerance = 1e-9)
      if (!is.null(wanted$count)) {
        expect_equal(policy$moments$count, wanted$count)
        expect_equal(policy$moments$mean, wanted$mean, tolerance = 1e-12)
      }
    }
    expect_false(any(coef(policy) == 0))
  }
  expect_null(agent_policy(updates[[1L]][[10L]]$agent)$moments)
})

test_that("candidates of augmented random search lie on both sides of the weights", {
  agent <- agent_start(agent_ars(directions = 3, noise = 0.5),
                       policy_bind(policy_linear(), box_env()))
  coef(agent$policy) <- 1:8
  set.seed(1)
  asked <- agent_ask(agent)
  set.seed(1)
  directions <- matrix(rnorm(24), 3)
  expect_identical(dim(asked), c(6L, 8L))
  expect_equal(asked[5, ], 1:8 + 0.5 * directions[3, ])
  expect_equal(asked[6, ], 1:8 - 0.5 * directions[3, ])
})

test_that("there is no step where all returns are the same", {
  level <- function(told) modifyList(told, list(returns = rep(4, 12), lengths = rep(3, 12)))
  ten <- ten_updates(agent_ars(directions = 6, shift = 1), level)
  expect_identical(coef(agent_policy(ten[[10]]$agent)), rep(0, 10))
})

test_that("of directions with equal returns the first make up the step", {
  agent <- agent_start(agent_ars(directions = 3, top = 1, version = "V1-t"),
                       policy_bind(policy_linear(), box_env()))
  asked <- agent_ask(agent)
  told <- list(weights = asked, returns = c(0, 1, 5, 2, 5, 1), lengths = rep(1, 6))
  first <- attr(asked, "directions")[2, ]
  # (5 - 2) / the standard deviation of 5 and 2, which is 1.5.
  expect_equal(coef(agent_policy(agent_tell(agent, told))), 0.02 * 2 * first)
})

test_that("updates of the cross-entropy method are those of NumPy", {
  agent <- agent_cem(population = 12, elite = 4, noise = 0.5, extra_noise = 0.4,
                     extra_iterations = 6)
  ten <- ten_updates(agent)
  expected <- numpy_updates(list(list(
    agent = "cem", elite = 4, extra_noise = 0.4, extra_iterations = 6,
    updates = lapply(ten, function(one) {
      list(weights = unclass(one$told$weights), returns = one$told$returns)
    })
  )))[[1L]]
  for (i in 1:10) {
    after <- ten[[i]]$agent
    expect_equal(coef(agent_policy(after)), expected[[i]]$weights, tolerance = 1e-12)
    expect_equal(after$deviation, expected[[i]]$deviation, tolerance = 1e-12)
    set.seed(i)
    asked <- agent_ask(after)
    set.seed(i)
    drawn <- matrix(rnorm(120), 12)
    expect_equal((asked - rep(coef(after$policy), each = 12)) / drawn,
                 matrix(rep(expected[[i]]$drawn_with, each = 12), 12), tolerance = 1e-9)
  }
})

test_that("the first candidates of the cross-entropy method are drawn around the policy", {
  agent <- agent_start(agent_cem(population = 1000, noise = 0.3, extra_noise = 0.4),
                       policy_bind(policy_linear(), box_env()))
  coef(agent$policy) <- 1:8
  set.seed(1)
  asked <- agent_ask(agent)
  expect_equal(colMeans(asked), 1:8, tolerance = 0.02)
  expect_equal(apply(asked, 2, sd), rep(0.5, 8), tolerance = 0.1)
})

test_that("hill climbing keeps what does better, and nothing else", {
  agent <- agent_start(agent_hill_climb(noise = 0.2, candidates = 3),
                       policy_bind(policy_linear(), box_env()))
  set.seed(1)
  tell <- function(returns) {
    asked <- agent_ask(agent)
    expect_true(all(abs(asked - rep(coef(agent$policy), each = 3)) <= 0.2))
    agent <<- agent_tell(agent, list(weights = asked, returns = returns, lengths = rep(1, 3)))
    asked
  }
  asked <- tell(c(-5, -3, -4))
  expect_identical(coef(agent_policy(agent)), asked[2, ])
  tell(c(-3, -6, -9))
  expect_identical(coef(agent_policy(agent)), asked[2, ])
  asked <- tell(c(-3, -2, -2))
  expect_identical(coef(agent_policy(agent)), asked[2, ])
  expect_identical(agent$best_return, -2)
})

test_that("what makes no agent is refused", {
  refused <- function(code, name) {
    expect_error(code, paste0("`", name, "` must be"), fixed = TRUE, class = "gym_error_argument")
  }
  refused(agent_ars(directions = 0), "directions")
  refused(agent_ars(directions = 4, top = 5), "top")
  refused(agent_ars(noise = 0), "noise")
  refused(agent_ars(step_size = -1), "step_size")
  refused(agent_ars(version = "V3"), "version")
  refused(agent_ars(shift = NA), "shift")
  refused(agent_cem(population = 5, elite = 6), "elite")
  refused(agent_cem(population = 1), "population")
  refused(agent_cem(noise = 0), "noise")
  refused(agent_cem(extra_noise = -1), "extra_noise")
  refused(agent_cem(extra_iterations = 0), "extra_iterations")
  refused(agent_hill_climb(noise = Inf), "noise")
  refused(agent_hill_climb(candidates = 0), "candidates")
})

test_that("agents print their settings", {
  expect_output(print(agent_ars()),
                "<agent: ARS V2-t: directions 8, top 4, step_size 0.02, noise 0.05>", fixed = TRUE)
  expect_output(print(agent_ars(version = "V1", shift = 1)),
                "<agent: ARS V1: directions 8, step_size 0.02, noise 0.05, shift 1>", fixed = TRUE)
  expect_output(print(agent_cem()), "CEM: population 40, elite 8, noise 1", fixed = TRUE)
  expect_output(print(agent_hill_climb()), "<agent: hill climbing: noise 0.1>", fixed = TRUE)
})

test_that("random search keeps the best weights, and of equal ones the first", {
  set.seed(1)
  agent <- agent_start(agent_random(3), policy_bind(policy_network(c(4, 2)), box_env()))
  seen <- list()
  for (returns in list(c(1, 5, 5), c(2, 5, 4), c(6, 7, 1))) {
    asked <- agent_ask(agent)
    expect_identical(dim(asked), c(3L, 8L))
    expect_true(all(abs(asked) <= 1))
    seen <- c(seen, list(asked))
    agent <- agent_tell(agent, list(weights = asked, returns = returns))
    if (length(seen) < 3) expect_identical(coef(agent_policy(agent)), seen[[1]][2, ])
  }
  expect_identical(coef(agent_policy(agent)), seen[[3]][2, ])
  expect_identical(agent$best, 8L)
  expect_identical(agent$played, 9L)
})

test_that("an elite of one candidate leaves the deviation as it is", {
  agent <- agent_start(agent_cem(population = 5), policy_network(c(2, 1)))
  set.seed(1)
  told <- agent_tell(agent, list(weights = agent_ask(agent), returns = c(1, 3, 2, 0, 1)))
  expect_identical(told$deviation, agent$deviation)
})
