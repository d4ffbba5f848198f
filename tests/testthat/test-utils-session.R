test_that("a program's output is returned, and R's generator stays as it was", {
  skip_on_os("windows")
  set.seed(1)
  before <- .Random.seed
  expect_identical(run_quietly("/bin/sh", c("-c", "echo $A; exit 3"), env = c("current", A = "a")),
                   list(status = 3L, stdout = "a\n", stderr = ""))
  nothing <- list(status = NA_integer_, stdout = "", stderr = "")
  expect_identical(run_quietly("/no/such/program", "x"), nothing)
  # What it said before it hung is no answer.
  expect_identical(run_quietly("/bin/sh", c("-c", "echo a; exec sleep 60"), timeout = 0.5),
                   nothing)
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
  python_problem("/bin/sh")
  own_library_path()
  python_candidates()
  expect_identical(.Random.seed, before)
})

test_that("the end of one process is not that of others", {
  skip_unless_all()
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  trials <- lapply(1:2, function(i) {
    set.seed(1)
    start_python(fake_program(file.path(folder, i), "exec sleep 60"), character())
  })
  trials[[1L]]$kill_tree()
  expect_true(trials[[2L]]$is_alive())
  trials[[2L]]$kill_tree()

  set.seed(1)
  server <- local_server()
  set.seed(1)
  run_quietly("/bin/sh", c("-c", "exit 0"))
  expect_type(env_list_all(server), "list")
})

# What a session says at its end. It loads these packages first, plays on a server of its own, and
# leaves a forked child behind.
last_words <- function(packages, ...) {
  script <- withr::local_tempfile(lines = c(
    paste0(".libPaths(", deparse1(.libPaths()), ")"),
    "Sys.unsetenv('PROCESSX_NOTIFY_OLD_SIGCHLD')",
    paste0("invisible(loadNamespace('", packages, "'))"),
    ...,
    "cat(length(gym::env_list_all(gym::gym_client())))",
    "child <- parallel::mcparallel(Sys.sleep(60))"
  ))
  rscript <- file.path(R.home("bin"), "Rscript")
  run <- processx::run(rscript, c("--no-init-file", script), timeout = 120)
  expect_identical(run$stdout, "0")
  run$stderr
}

test_that("a session that forks ends in order with a server, too", {
  skip_unless_all()
  skip_on_os("windows")
  skip_if_no_server()
  # The package parallel complains when it has waited for its children in vain.
  expect_identical(last_words(c("parallel", "processx")), "")
  fork <- "answers <- parallel::mclapply(1:2, identity, mc.cores = 2)"
  expect_identical(last_words("parallel", fork), "")
})
