other_session <- function(code, frame = parent.frame()) {
  process <- processx::process$new(
    file.path(R.home("bin"), "Rscript"), c("-e", code),
    stdout = "|", stderr = "2>&1", env = c("current", R_LIBS = paste(.libPaths(), collapse = ":"))
  )
  withr::defer(process$kill(), envir = frame)
  process
}

test_that("the turn is given back, also after an error", {
  local_cache()
  expect_identical(in_turn(7), 7)
  expect_error(in_turn(stop("broken")), "broken")
  expect_false(dir.exists(turn_folder()))
  expect_identical(in_turn(8), 8)
})

test_that("a session waits for another one, with a message", {
  skip_on_cran()
  local_cache()
  done <- file.path(install_root(), "done")
  other <- other_session(
    "gym:::in_turn({Sys.sleep(2); writeLines('', file.path(gym:::install_root(), 'done'))})"
  )
  wait_until(function() file.exists(turn_owner()))
  expect_message(found <- in_turn(file.exists(done)), "Another R session is installing")
  expect_true(found)
})

test_that("a session that was killed keeps nobody waiting", {
  skip_on_cran()
  skip_on_os("windows")
  local_cache()
  other <- other_session("gym:::in_turn(Sys.sleep(60))")
  wait_until(function() isTRUE(file.size(turn_owner()) > 0))
  expect_true(dir.exists(turn_folder()))
  expect_false(turn_is_void())
  other$kill()
  expect_identical(in_turn(7), 7)
})

test_that("the sign of another machine's session is void when nobody touches it", {
  local_cache()
  dir.create(turn_folder(), recursive = TRUE)
  writeLines(c("another-machine", "1"), turn_owner())
  # It is not this session's to touch.
  keep_turn()
  expect_false(turn_is_void())
  Sys.setFileTime(turn_owner(), Sys.time() - turn_patience - 10)
  keep_turn()
  expect_true(turn_is_void())
})

test_that("a dead session's sign is void also where another process has its number", {
  skip_on_os("windows")
  local_cache()
  other <- processx::process$new("sleep", "60")
  withr::defer(other$kill())
  dir.create(turn_folder(), recursive = TRUE)
  writeLines(c(Sys.info()[["nodename"]], other$get_pid()), turn_owner())
  expect_false(turn_is_void())
  Sys.setFileTime(turn_owner(), Sys.time() - turn_patience - 10)
  expect_true(turn_is_void())
  # This session's own number, as in a container where R is always process 1.
  writeLines(own_name(), turn_owner())
  local_session(has_turn = FALSE)
  expect_true(turn_is_void())
  expect_identical(in_turn(7), 7)
})

test_that("a session that was taken for dead leaves the sign of the next alone", {
  local_cache()
  in_turn(writeLines(c("another-machine", "1"), turn_owner()))
  expect_true(file.exists(turn_owner()))
  unlink(turn_folder(), recursive = TRUE)
  # One that could not be written, as on a full disk, is its own.
  in_turn(writeLines("", turn_owner()))
  expect_false(dir.exists(turn_folder()))
})

test_that("programs and downloads keep the turn", {
  skip_on_os("windows")
  local_cache()
  aged <- function(code) {
    Sys.setFileTime(turn_owner(), Sys.time() - 100)
    force(code)
    difftime(Sys.time(), file.mtime(turn_owner()), units = "secs")
  }
  file <- withr::local_tempfile(lines = "uv")
  in_turn({
    expect_lt(aged(run_quietly("/bin/sh", c("-c", "exit 0"))), 50)
    expect_lt(aged(run_tool("/bin/sh", c("-c", "exit 0"))), 50)
    expect_lt(aged(download_uv(paste0("file://", file), withr::local_tempfile(), NULL)), 50)
  })
})
