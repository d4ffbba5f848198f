test_that("a function that has ended names what replaces it", {
  cnd <- expect_error(search_repeat("CartPole-v0", seeds = 1:3), class = "gym_error_defunct")
  expect_match(conditionMessage(cnd), "`search_repeat()` has ended.", fixed = TRUE)
  expect_match(conditionMessage(cnd), "Instead, use `search_random(seeds = )`.", fixed = TRUE)
  expect_error(gym::search_landscape(), "`search_landscape()` has ended", fixed = TRUE,
               class = "gym_error_defunct")
})
