test_that("what a program says is returned, and R's generator stays as it was", {
  skip_on_os("windows")
  set.seed(1)
  before <- .Random.seed
  expect_identical(run_quietly("/bin/sh", c("-c", "echo $A; exit 3"), env = c("current", A = "a")),
                   list(status = 3L, stdout = "a\n"))
  expect_identical(run_quietly("/no/such/program", "x"), list(status = NA_integer_, stdout = ""))
  # What it said before it hung is no answer.
  expect_identical(run_quietly("/bin/sh", c("-c", "echo a; exec sleep 60"), timeout = 0.5),
                   list(status = NA_integer_, stdout = ""))
  expect_identical(.Random.seed, before)
})

test_that("finding out what there is leaves R's generator as it was", {
  skip_on_os("windows")
  local_cache()
  # Where R's start put folders in front of it a shell is asked.
  withr::local_envvar(LD_LIBRARY_PATH = "/somewhere")
  set.seed(1)
  before <- .Random.seed
  find_uv()
  probe_python("/bin/sh")
  own_library_path()
  python_candidates()
  tool_environment()
  expect_identical(.Random.seed, before)
})
