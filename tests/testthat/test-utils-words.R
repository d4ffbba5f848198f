test_that("numbers are rounded for printing, one by one where they stand apart", {
  expect_identical(number_text(12345.678), "12,346")
  expect_identical(number_text_each(c(5e4, 1e5, 1e12)), c("50,000", "100,000", "1e+12"))
  expect_identical(number_text_each(c(a = 1, b = 0.125)), c("1", "0.125"))
  expect_identical(percent_text(0.331), "33%")
  expect_identical(se_text(0.5), " (standard error 0.5)")
  expect_null(se_text(NA_real_))
})

test_that("what is counted has its plural, and long times are minutes", {
  expect_identical(count_of(1, "step"), "1 step")
  expect_identical(count_of(0, "step"), "0 steps")
  expect_identical(count_of(1e6, "step"), "1,000,000 steps")
  expect_identical(seconds_text(3), "3.0 s")
  expect_identical(seconds_text(600), "10 min")
})

test_that("thousands are not marked by the session's decimal mark", {
  withr::local_options(OutDec = ",", warn = 2)
  expect_identical(number_text(12345.678), "12.346")
  expect_identical(number_text(0.125), "0,125")
  expect_identical(count_of(1e6, "step"), "1.000.000 steps")
  expect_output(print(schedule_linear(1, 0.5, 10000)), "to 0,5 in 10.000 steps", fixed = TRUE)
  withr::local_options(scipen = -10)
  expect_identical(count_of(1e6, "step"), "1.000.000 steps")
})

test_that("ids and names of arguments keep their case at the start of a sentence", {
  expect_identical(sentence("instance lost"), "Instance lost.")
  expect_identical(sentence("it's full, sorry"), "It's full, sorry.")
  for (text in c("phys2d/CartPole-v1 needs jax.", "frame_skip must be 1.", "walker-v0 is gone.",
                 "max_steps is missing.", "step() needs an episode.")) {
    expect_identical(sentence(text), text)
  }
})

test_that("other libraries' names of arguments lead to ours", {
  ppo <- names(formals(agent_ppo))
  expect_identical(nearest_name("lr", ppo), "learning_rate")
  expect_identical(nearest_name("n_steps", ppo), "batch_steps")
  expect_identical(nearest_name("batch_size", ppo), "batch")
  expect_identical(nearest_name("discount", ppo), "gamma")
  expect_identical(nearest_name("alpha", names(formals(agent_q))), "learning_rate")
  expect_identical(nearest_name("n", names(formals(rollout))), "episodes")
  # A name of ours is not replaced by one that is there, too.
  expect_identical(nearest_name("stepsize", names(formals(agent_ars))), "step_size")
  # Each leads to an argument that some function has.
  exported <- mget(getNamespaceExports("gym"), asNamespace("gym"), "function", list(NULL))
  known <- unlist(lapply(Filter(is.function, exported), function(f) names(formals(f))))
  expect_identical(setdiff(unlist(other_names), known), character())
  expect_identical(names(other_names), plain_name(names(other_names)))
})
