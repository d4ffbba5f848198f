test_that("in a Turkish locale curl's options are found", {
  skip_unless_all()
  server <- test_client()
  locale <- local_locale("LC_CTYPE", "tr_TR", "ISO-8859-9")
  seen <- run_session(
    server, sprintf("Sys.setlocale(\"LC_CTYPE\", \"%s\")", locale),
    "stopifnot(tolower(\"I\") != \"i\")", "env <- gym_make(\"CartPole-v1\", client = server)",
    "cat(length(env$reset()), \"numbers\")",
    # Curl keeps the names that it had first.
    "invisible(Sys.setlocale(\"LC_CTYPE\", \"C\"))",
    "options(httr_config = httr::timeout(5))", "env$step(1)"
  )
  expect_match(seen$stdout, "4 numbers", fixed = TRUE, info = seen$stderr)
  expect_identical(seen$status, 0L, info = seen$stderr)
})
