test_that("values that are drawn belong to their space and come back through JSON", {
  skip_unless_all()
  withr::local_seed(4)
  tried <- 0L
  for (i in 1:60) {
    space <- new_space(random_description())
    for (j in 1:3) {
      value <- space_sample(space)
      expect_true(space_contains(space, value))
      text <- paste0("[", encode_value(space, value, NULL), "]")
      back <- decode_value(space, from_json(text)[[1]])
      expect_identical(back, value, info = format(space))
      tried <- tried + 1L
    }
  }
  expect_identical(tried, 180L)
})

test_that("values that are drawn come back through tensors", {
  skip_unless_all()
  withr::local_seed(5)
  tried <- 0L
  while (tried < 100L) {
    space <- new_space(random_description())
    if (!has_tensors(space)) next
    value <- space_sample(space)
    parts <- to_tensors(space, value, "action", NULL)
    texts <- Filter(is.character, parts)
    file <- read_tensors(write_tensors(Filter(is.list, parts), c(request = "{}")))
    back <- from_tensors(space, "action", list(tensors = file$tensors, texts = texts))
    expect_identical(back, value, info = format(space))
    tried <- tried + 1L
  }
})
