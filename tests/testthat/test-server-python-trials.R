test_that("each Python is tried, and what it lacks is reported", {
  skip_unless_all()
  skip_on_os("windows")
  working <- working_python()
  folder <- withr::local_tempdir()
  bare <- fake_program(
    file.path(folder, "python3"), "echo 3.12.1",
    "echo \"gym_server cannot run on this Python (3.12.1, /x (y)): No module named 'flask'\" >&2",
    "exit 78"
  )
  hanging <- fake_program(file.path(folder, "hanging"), "echo 3.11.0; exec sleep 60")
  silent <- fake_program(file.path(folder, "silent"), "exit 1")
  set.seed(1)
  before <- .Random.seed
  trials <- try_pythons(c(bare, working, silent, "/no/such/python"), timeout = 60)
  expect_identical(.Random.seed, before)
  expect_identical(trials$runs, c(FALSE, TRUE, FALSE, FALSE))
  expect_identical(trials$reason, c(
    "No module named 'flask'", NA, "it ended without output", "there is no such file"
  ))
  expect_identical(trials$version[[1]], "3.12.1")
  expect_match(trials$version[[2]], "^3[.][0-9]+[.][0-9]+$")
  expect_identical(trials$version[3:4], c(NA_character_, NA))
  expect_match(trials$extras[[2]], "box2d")
  expect_identical(trials$extras[c(1, 3, 4)], c("", "", ""))

  trial <- try_pythons(hanging, timeout = 0.5)
  expect_identical(trial$runs, NA)
  expect_identical(trial$version, "3.11.0")
})

test_that("no Python is no trial", {
  expect_identical(nrow(try_pythons(character())), 0L)
})
