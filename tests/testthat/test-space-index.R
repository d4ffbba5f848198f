# Values of countable spaces and their numbers.

test_that("a number and its value belong together", {
  spaces <- list(
    space_discrete(3, start = -1), space_multi_discrete(2:4), space_multi_binary(3),
    space_multi_discrete(rbind(c(2, 3), c(1, 2)), start = rbind(c(0, 5), c(-1, 2))),
    space_dict(a = space_multi_binary(c(2, 1)), b = spaces_of_parts[[2]])
  )
  for (space in spaces) {
    index <- space_index(space)
    numbers <- seq_len(index$count)
    batch <- index$value(numbers)
    expect_identical(index$index(batch, index$count), numbers)
    values <- lapply(numbers, function(i) batch_value(space, batch, i))
    for (value in values) check_value(space, value, "", NULL, TRUE)
    expect_identical(anyDuplicated(values), 0L)
    # The last one changes first, as in the table of all values.
    expect_identical(unname(rapply(values, row_major)), as.integer(t(all_values(space))))
    expect_identical(batch_length(space, index$value(integer())), 0L)
  }
})
