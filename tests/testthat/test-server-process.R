test_that("the reason why a server has ended is found in its log", {
  reason <- function(status, ...) {
    log <- withr::local_tempfile(lines = c(...))
    end_reason(list(get_exit_status = function() status), log)
  }
  hang <- "2026-01-02 03:04:05,678 CRITICAL gym_server.cli.stuck: step() of it took more than 3 s"
  expect_identical(reason(1L, "before", hang, "Thread 1", "  File a.py"),
                   "step() of it took more than 3 s.")
  expect_match(reason(1L, "Timeout (0:00:04)!", "Thread 1"), "`max_call_seconds`", fixed = TRUE)
  expect_identical(reason(-11L, "Fatal Python error: Aborted", "", "Thread 1"),
                   "Fatal Python error: Aborted")
  expect_match(reason(-9L, "x"), "max_memory_mb")
  expect_match(reason(-6L, "terminate called after throwing an instance of 'std::bad_alloc'",
                      "Fatal Python error: Aborted"), "max_memory_mb")
  expect_identical(reason(3L, "a", "b", "c", "d"), "Its exit status is 3.\nb\nc\nd")
  expect_null(reason(0L, "a"))
})
