# Trainings on two other hosts, one of which is struck in the middle: network namespaces where the
# system allows them, else processes. tools/hosts.R of the sources makes the hosts.

test_that("a training is the same whatever is lost on a host, where nothing is left", {
  skip_if_not(tests_all(), "left to make test-all")
  skip_on_os(c("windows", "mac", "solaris"))
  top <- normalizePath(file.path(test_path(), "..", ".."))
  skip_if_not(file.exists(file.path(top, "tools", "hosts.R")), "not a source tree")
  skip_if_not_installed("parallelly")
  skip_if_not_installed("future")
  run <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", "tools/hosts.R", "faults"), wd = top,
    env = c("current", R_LIBS = paste(.libPaths(), collapse = ":")), error_on_status = FALSE
  )
  lines <- strsplit(run$stdout, "\n")[[1]]
  expect_identical(run$status, 0L, info = paste(c(lines, run$stderr), collapse = "\n"))
  namespaces <- !grepl("not allowed here", run$stderr, fixed = TRUE)
  struck <- c("worker killed", "server killed", if (namespaces) "link down")
  for (fault in c("none", struck)) {
    expect_match(lines, paste0("^ *", fault, " +TRUE +[0-9.]+ +[0-9]+ +0 +0 +0 *$"), all = FALSE)
  }
  expect_match(lines, "A worker on gym-[0-9]+-1 was lost", all = FALSE)
})
