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
