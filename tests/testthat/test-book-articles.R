# The companion to Sutton and Barto's book: vignettes/articles/book-*.Rmd, a page for each of its
# chapters. The last chunk of each compares what the page made with the book.

book_files <- function() {
  files <- list.files(file.path(test_path(), "../../vignettes/articles"), "^book-.*[.]Rmd$",
                      full.names = TRUE)
  skip_if_not(length(files) > 0L, "not a source tree")
  files
}

is_evaluated <- function(chunk) !grepl("eval *= *(FALSE|F)\\b", chunk$header)

is_of_facts <- function(chunk) startsWith(chunk$header, "```{r facts,")

test_that("each page of the book makes its figures by 20 lines of code at most", {
  for (file in book_files()) {
    chunks <- page_chunks(file)
    expect_true(is_of_facts(chunks[[length(chunks)]]), info = file)
    chunks <- chunks[-length(chunks)]
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

for (chapter in c("02", "04", "05", "06", "07", "08", "09", "10", "13")) {
  test_that(paste("the page of chapter", chapter, "runs, and shows what the book shows"), {
    skip_unless_all()
    file <- grep(paste0("book-", chapter), book_files(), value = TRUE)
    withr::local_pdf(NULL)
    chunks <- Filter(is_evaluated, page_chunks(file))
    # The first one sets up how pictures are made.
    code <- parse(text = unlist(lapply(chunks[-1L], `[[`, "code")), keep.source = FALSE)
    made <- new.env(parent = globalenv())
    expect_no_error(withr::with_preserve_seed(utils::capture.output(
      source(exprs = code, local = made, print.eval = TRUE)
    )))
  })
}

if (soaks("GYM_TEST_BOOK")) test_that("Gymnasium's car is solved as the page of chapter 10 says", {
  file <- grep("book-10", book_files(), value = TRUE)
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
