# The table of the vignette "From Gymnasium's documentation to R", which lies in the source
# tree only.
gymnasium_table <- function() {
  path <- file.path(test_path(), "../../vignettes/gymnasium.csv")
  skip_if_not(file.exists(path), "no vignettes/ beside the tests: not a source tree")
  utils::read.csv(path, encoding = "UTF-8")
}

run_python_column <- function(table) {
  client <- test_client()
  python <- the_session$servers[[client$remote_base]]$python
  lines <- tempfile(fileext = ".json")
  withr::defer(unlink(lines))
  writeLines(jsonlite::toJSON(data.frame(
    python = table$python, compared = table$compared == "yes"
  )), lines)
  output <- tempfile(fileext = ".json")
  withr::defer(unlink(output))
  run <- processx::run(
    python, test_path("run_python_column.py"), stdin = lines, stdout = output,
    env = c("current", own_library_path()), error_on_status = FALSE
  )
  expect_identical(run$status, 0L, info = run$stderr)
  text <- paste(readLines(output, warn = FALSE), collapse = "")
  # Python's JSON has a bare Infinity.
  jsonlite::parse_json(gsub("(-?Infinity)", "\"\\1\"", text))
}

as_number <- function(x) {
  if (is.character(x)) c(Infinity = Inf, `-Infinity` = -Inf)[[x]] else as.numeric(x)
}

as_python_prints <- function(value) {
  if (is.character(value)) {
    return(value)
  }
  # Python counts rows first.
  if (length(dim(value)) > 1L) value <- aperm(value)
  as.numeric(value)
}

test_that("what the table writes in R gives what it writes in Python", {
  skip_unless_all()
  table <- gymnasium_table()
  wanted <- run_python_column(table)
  place <- new.env(parent = globalenv())
  at <- 0L
  for (i in seq_len(nrow(table))) {
    value <- eval(parse(text = table$r[[i]]), place)
    if (table$compared[[i]] == "yes") {
      at <- at + 1L
      python <- wanted[[at]]
      if (!is.character(value)) python <- vapply(python, as_number, 0)
      expect_identical(as_python_prints(value), unlist(python), info = table$r[[i]])
    }
  }
  expect_gt(at, 15L)
})
