other_session <- function(code, frame = parent.frame()) {
  process <- processx::process$new(
    file.path(R.home("bin"), "Rscript"), c("-e", code),
    stdout = "|", stderr = "2>&1", env = c("current", R_LIBS = paste(.libPaths(), collapse = ":"))
  )
  withr::defer(process$kill(), envir = frame)
  process
}

test_that("the lock is released, also after an error", {
  local_cache()
  expect_identical(with_install_lock(7), 7)
  expect_error(with_install_lock(stop("broken")), "broken")
  expect_false(dir.exists(install_lock()))
  expect_identical(with_install_lock(8), 8)
})

test_that("a session waits for another one, with a message", {
  skip_unless_all()
  skip_on_cran()
  local_cache()
  done <- file.path(install_root(), "done")
  other <- other_session(paste(
    "done <- file.path(gym:::install_root(), 'done')",
    "gym:::with_install_lock({Sys.sleep(2); writeLines('', done)})",
    sep = "\n"
  ))
  wait_until(function() file.exists(install_lock_owner()))
  expect_message(found <- with_install_lock(file.exists(done)), "Another R session is installing")
  expect_true(found)
})

test_that("a session that was killed keeps no other waiting", {
  skip_on_cran()
  skip_on_os("windows")
  local_cache()
  other <- other_session("gym:::with_install_lock(Sys.sleep(60))")
  wait_until(function() isTRUE(file.size(install_lock_owner()) > 0))
  expect_true(dir.exists(install_lock()))
  expect_false(install_lock_is_stale())
  other$kill()
  expect_identical(with_install_lock(7), 7)
})

test_that("the lock of another machine's session is stale when it is not touched", {
  local_cache()
  dir.create(install_lock(), recursive = TRUE)
  writeLines(c("another-machine", "1"), install_lock_owner())
  # It is not this session's to touch.
  touch_install_lock()
  expect_false(install_lock_is_stale())
  Sys.setFileTime(install_lock_owner(), Sys.time() - install_lock_timeout - 10)
  touch_install_lock()
  expect_true(install_lock_is_stale())
})

test_that("a dead session's lock is stale also where another process has its number", {
  skip_on_os("windows")
  local_cache()
  other <- processx::process$new("sleep", "60")
  withr::defer(other$kill())
  dir.create(install_lock(), recursive = TRUE)
  writeLines(c(Sys.info()[["nodename"]], other$get_pid()), install_lock_owner())
  expect_false(install_lock_is_stale())
  Sys.setFileTime(install_lock_owner(), Sys.time() - install_lock_timeout - 10)
  expect_true(install_lock_is_stale())
  # This session's own number, as in a container where R is always process 1.
  writeLines(own_name(), install_lock_owner())
  local_session(holds_install_lock = FALSE)
  expect_true(install_lock_is_stale())
  expect_identical(with_install_lock(7), 7)
})

test_that("a session that was taken for dead leaves the lock of the next alone", {
  local_cache()
  with_install_lock(writeLines(c("another-machine", "1"), install_lock_owner()))
  expect_true(file.exists(install_lock_owner()))
  unlink(install_lock(), recursive = TRUE)
  # One that could not be written, as on a full disk, is its own.
  with_install_lock(writeLines("", install_lock_owner()))
  expect_false(dir.exists(install_lock()))
})

test_that("programs and downloads keep the lock fresh", {
  skip_on_os("windows")
  local_cache()
  aged <- function(code) {
    Sys.setFileTime(install_lock_owner(), Sys.time() - 100)
    force(code)
    difftime(Sys.time(), file.mtime(install_lock_owner()), units = "secs")
  }
  file <- withr::local_tempfile(lines = "uv")
  with_install_lock({
    expect_lt(aged(ask_program("/bin/sh", c("-c", "exit 0"))), 50)
    expect_lt(aged(run_tool("/bin/sh", c("-c", "exit 0"))), 50)
    expect_lt(aged(download_uv(paste0("file://", file), withr::local_tempfile(), NULL)), 50)
  })
})
