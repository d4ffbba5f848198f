# Trainings on two other hosts, one of which is struck in the middle: network namespaces where the
# system allows them, else processes. tools/hosts.R of the sources makes the hosts.

# A host that is cut off, the fault that only two hosts can show; where there are no namespaces, a
# worker that is killed. With GYM_TEST_HOSTS=all, as `make soak` has it, every fault.

test_that("a training is the same whatever is lost on a host, where nothing is left", {
  skip_if_not(tests_all(), "left to make test-all")
  skip_on_os(c("windows", "mac", "solaris"))
  top <- normalizePath(file.path(test_path(), "..", ".."))
  skip_if_not(file.exists(file.path(top, "tools", "hosts.R")), "not a source tree")
  skip_if_not_installed("parallelly")
  skip_if_not_installed("future")
  every <- soaks("GYM_TEST_HOSTS")
  parts <- c("faults", if (!every) "one")
  run <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", "tools/hosts.R", parts), wd = top,
    env = c("current", R_LIBS = paste(.libPaths(), collapse = ":")), error_on_status = FALSE
  )
  lines <- strsplit(run$stdout, "\n")[[1]]
  expect_identical(run$status, 0L, info = paste(c(lines, run$stderr), collapse = "\n"))
  namespaces <- !grepl("not allowed here", run$stderr, fixed = TRUE)
  struck <- if (namespaces) "link down" else "worker killed"
  if (every) struck <- unique(c("none", "worker killed", "server killed", struck))
  for (fault in struck) {
    expect_match(lines, paste0("^ *", fault, " +TRUE +[0-9.]+ +[0-9]+ +0 +0 +0 *$"), all = FALSE)
  }
  expect_match(lines, "A worker on gym-[0-9]+-1 was lost", all = FALSE)
})
