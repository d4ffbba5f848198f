# The table of learners, which tools/learn-table.R makes.

read_learned <- function() {
  utils::read.csv(system.file("extdata", "learn-table.csv", package = "gym"))
}

test_that("each seed has one row, failures included", {
  table <- read_learned()
  for (own in split(table, table$env_id)) {
    expect_identical(own$seed, 1000L + seq_len(nrow(own)))
    expect_length(unique(own$learner), 1)
  }
  expect_identical(table$reached, table$value >= table$goal)
  expect_false(anyNA(table))
})

test_that("nothing has learned more than can be earned", {
  table <- read_learned()
  best <- c(
    "CliffWalking-v1" = -13, "Blackjack-v1" = -0.0431,
    "FrozenLake-v1" = solve_mdp(env_model("FrozenLake-v1"), horizon = 100)$start_value,
    "FrozenLake8x8-v1" = solve_mdp(env_model("FrozenLake8x8-v1"), horizon = 200)$start_value,
    "Taxi-v4" = solve_mdp(env_model("Taxi-v4"), horizon = 200)$start_value
  )
  exact <- table[table$measure == "exact", ]
  expect_setequal(unique(exact$env_id), names(best))
  expect_true(all(exact$value <= best[exact$env_id] + 1e-4))
})

# test-solve-table.R has the same of the other table in `make test-all`.
if (soaks("GYM_TEST_TABLES")) test_that("a row of the table comes out the same again", {
  skip_unless_all()
  folder <- file.path(test_path(), "../../tools/learn")
  skip_if_not(dir.exists(folder), "no tools/ beside the tests: not a source tree")
  jobs <- new.env()
  sys.source(file.path(folder, "blackjack.R"), jobs)
  sys.source(file.path(folder, "jobs.R"), jobs)
  table <- read_learned()
  row <- table[table$env_id == "CliffWalking-v1" & table$seed == 1001, ]
  job <- jobs$learn_jobs[["CliffWalking-v1"]]
  learned <- job$learn(1001)
  expect_equal(job$judge(learned), row$value)
  expect_equal(learned$steps, row$steps)
  expect_identical(format(learned$agent), row$learner)
})

test_that("the model that judges blackjack plays as Gymnasium does", {
  skip_unless_all()
  folder <- file.path(test_path(), "../../tools/learn")
  skip_if_not(dir.exists(folder), "no tools/ beside the tests: not a source tree")
  blackjack <- new.env()
  sys.source(file.path(folder, "blackjack.R"), blackjack)
  model <- blackjack$blackjack_model()
  expect_equal(solve_mdp(model)$start_value, -0.0431131, tolerance = 1e-5)
  # Takes a card below 17, and at 17 with an ace that counts 11.
  rows <- expand.grid(ace = 0:1, shown = 0:10, total = 0:31)
  hit <- as.numeric(rows$total < 17 + rows$ace)
  policy <- policy_table(cbind(1 - hit, hit))
  played <- rollout("Blackjack-v1", policy, episodes = 20000, seed = 1)
  returns <- played$episodes$return
  se <- stats::sd(returns) / sqrt(length(returns))
  expect_lt(abs(mean(returns) - blackjack$blackjack_value(policy)), 4 * se)
})
