# The companion to Sutton and Barto's book: vignettes/book-*.Rmd, a page for each of its chapters.

book_files <- function() page_files("^book-.*[.]Rmd$")

book_file <- function(name) {
  files <- book_files()
  skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
  file <- files[basename(files) == paste0(name, ".Rmd")]
  skip_if_not(length(file) == 1L, paste0("there is no ", name, ".Rmd"))
  file
}

is_evaluated <- function(chunk) !grepl("eval *= *(FALSE|F)\\b", chunk$header)

is_of_facts <- function(chunk) startsWith(chunk$header, "```{r facts,")

test_that("each page of the book makes its figures by 20 lines of code at most", {
  files <- book_files()
  skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
  for (file in files) {
    chunks <- Filter(Negate(is_of_facts), page_chunks(file))
    expect_gt(length(chunks), 3L)
    lengths <- vapply(chunks, function(chunk) sum(nzchar(trimws(chunk$code))), 0L)
    headers <- vapply(chunks, `[[`, "", "header")
    expect_identical(headers[lengths > 20L], character())
    lines <- unlist(lapply(chunks, `[[`, "code"))
    expect_identical(lines[nchar(lines) > 100L], character())
    # Nobody knows what a condition would be when the page is built.
    expect_false(any(grepl("eval *=", headers) & vapply(chunks, is_evaluated, NA)))
  }
})

test_that("the build of each page of the book compares what it made with the book", {
  files <- book_files()
  skip_if_not(length(files) > 0L, "no vignettes/ beside the tests, and none in the package")
  for (file in files) {
    chunks <- page_chunks(file)
    expect_true(is_of_facts(chunks[[length(chunks)]]), info = file)
    expect_true(is_evaluated(chunks[[length(chunks)]]), info = file)
    expect_false(any(grepl("error *= *TRUE", vapply(chunks, `[[`, "", "header"))), info = file)
  }
})

if (soaks("GYM_TEST_BOOK")) test_that("Gymnasium's car is solved as the page of chapter 10 says", {
  file <- book_file("book-10-mountain-car")
  shown <- unlist(lapply(Filter(Negate(is_evaluated), page_chunks(file)), `[[`, "code"))
  code <- grep("^#>", shown, value = TRUE, invert = TRUE)
  client <- test_client()
  trained <- eval(parse(text = code), new.env(parent = globalenv()))
  expect_true(trained$solved)
  expect_match(shown, paste0("Solved after ", nrow(trained$history), " iterations, ",
                             format(trained$steps, big.mark = ","), " steps"), all = FALSE)
  expect_match(shown, "Mean return in 100 fresh episodes: -103.8", fixed = TRUE, all = FALSE)
  expect_equal(round(trained$final$mean_return, 1), -103.8)
})
