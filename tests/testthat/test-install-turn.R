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
