test_that("a failure says what to do", {
  advice <- function(...) paste(install_advice(c(...)), collapse = " ")
  # The words are those of uv 0.13.9.
  expect_match(advice(
    "error: Failed to install: numpy-2.5.5-cp312-cp312-manylinux_2_28_x86_64.whl (numpy==2.5.5)",
    "cause: failed to copy file: No space left on device (os error 28)"
  ), "disk is full")
  expect_match(advice(
    "error: Failed to fetch: `https://index.example/simple/blinker/`",
    "cause: client error (Connect)", "cause: invalid peer certificate: UnknownIssuer"
  ), "SSL_CERT_FILE")
  expect_match(advice(
    "cause: tunnel error: failed to create underlying connection", "cause: tcp connect error"
  ), "HTTPS_PROXY")
  expect_match(advice(
    "cause: dns error", "cause: failed to lookup address information: Name or service not known"
  ), "gym_server_bundle")
  expect_match(advice(
    "error: No solution found when resolving dependencies:",
    "cause: Because numpy==2.5.5 has no wheels with a matching Python ABI tag (e.g., `cp39`)"
  ), "Python 3.10 to 3.13")
  expect_match(advice(
    "error: Hash mismatch for `blinker==1.9.0`", "Expected:", "  sha256:0", "Computed:"
  ), "refused")
  expect_identical(install_advice("something else"), character())
})

test_that("an error shows the lines that name it", {
  lines <- c("Resolved 14 packages", "error: Failed to fetch", "cause: dns error", "")
  expect_identical(error_lines(lines), c("error: Failed to fetch", "cause: dns error"))
  expect_identical(error_lines(c(letters, "")), tail(letters, 6L))
})

test_that("a tool gets nothing of another Python's, and its words go into the log", {
  skip_on_os("windows")
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  withr::local_envvar(PYTHONPATH = "/else", PYTHONHOME = "/else", VIRTUAL_ENV = "/else")
  output <- run_tool("/bin/sh", c("-c", "echo \"<$PYTHONPATH$PYTHONHOME$VIRTUAL_ENV>\"; exit 3"))
  expect_identical(as.character(output), "<>")
  expect_true(failed(output))
  expect_false(failed(run_tool("/bin/sh", c("-c", "echo $OWN"), env = c(OWN = "own"))))
  expect_identical(tail(readLines(install_log()), 1L), "own")
  expect_true(failed(run_tool("/no/such/tool", "x")))
})

test_that("an interrupt ends the tool", {
  skip_unless_all()
  skip_on_os("windows")
  local_cache()
  dir.create(install_root(), recursive = TRUE)
  pid <- withr::local_tempfile()
  tryCatch(
    {
      setTimeLimit(elapsed = 3, transient = TRUE)
      run_tool("/bin/sh", c("-c", "echo $$ > \"$0\"; exec sleep 60", pid))
    },
    error = identity
  )
  setTimeLimit()
  # Until it is reaped its number is taken.
  expect_true(wait_until(function() !pid_runs(as.integer(readLines(pid)))))
})
