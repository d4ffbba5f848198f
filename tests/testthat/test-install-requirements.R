test_that("every part is locked, each package with its hashes", {
  for (path in lock_files(server_extras)) {
    lines <- readLines(path)
    pinned <- grep("==", lines, fixed = TRUE)
    expect_true(all(grepl("^[a-z0-9-]+==[0-9][^ ]*( ; [^\\\\]+)? \\\\$", lines[pinned])))
    expect_true(all(grepl("^    --hash=sha256:[0-9a-f]{64}( \\\\)?$", lines[pinned + 1L])))
  }
  expect_lt(sum(file.size(lock_files(server_extras))), 1e6)
})

test_that("the lock's hash does not depend on the ends of lines", {
  hash <- lock_hash()
  expect_match(hash, "^[0-9a-f]{12}$")
  folder <- withr::local_tempdir()
  for (path in lock_files(server_extras)) {
    con <- file(file.path(folder, basename(path)), "wb")
    writeLines(readLines(path), con, sep = "\r\n")
    close(con)
  }
  local_binding("lock_file", function(part = "base") file.path(folder, paste0(part, ".txt")))
  expect_identical(lock_hash(), hash)
  cat("one more\n", file = file.path(folder, "box2d.txt"), append = TRUE)
  expect_false(lock_hash() == hash)
})

test_that("an extra adds to what is downloaded", {
  base <- lock_megabytes(character())
  more <- lock_megabytes(c("box2d", "atari"))
  expect_true(all(base > 10))
  expect_true(all(more > base))
})

test_that("extras are checked", {
  expect_error(check_extras("box3d"), "box2d", class = "gym_error_argument")
  expect_error(check_extras(NA_character_), class = "gym_error_argument")
  expect_error(check_extras(1), class = "gym_error_argument")
  local_binding("system_name", function() "linux-aarch64")
  expect_error(check_extras("box2d"), "cannot be installed on this system",
               class = "gym_error_install")
  expect_error(check_extras("mujoco"), NA)
})
