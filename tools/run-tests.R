# Runs tests/testthat against the installed package and closes with one line of counts.
#   Rscript tools/run-tests.R [PATTERN]     PATTERN chooses files: what stands after "test-"
# A test is one test_that() block. It has failed if anything in it failed, and was skipped if it was
# skipped or has no expectation. If GYM_R_LIBRARY names a library of the checkout, the packages in
# that library must be loaded from there. GYM_TEST_CPUS processes run the files, each with its own
# server.

# The package sets this when it loads processx, but testthat loads processx first.
Sys.setenv(PROCESSX_NOTIFY_OLD_SIGCHLD = "true")
library(testthat)
Sys.setenv(
  NOT_CRAN = "true", TESTTHAT_PARALLEL = "TRUE", TESTTHAT_CPUS = Sys.getenv("GYM_TEST_CPUS", "3"),
  # The files already share the cores, so threads of PyTorch would wait for each other.
  OMP_NUM_THREADS = "1"
)
Sys.unsetenv("GYM_SERVER_URL")
options(testthat.summary.max_reports = Inf)

state_of <- function(test) {
  has <- function(class) any(vapply(test$results, inherits, NA, class))
  if (has("expectation_failure") || has("expectation_error")) {
    "failed"
  } else if (has("expectation_skip")) {
    "skipped"
  } else if (isTRUE(nzchar(test$test))) {
    "passed"
  } else {
    "outside of any test"
  }
}

# The processes that run the tests find the same packages, because they have the same libraries.
load_packages <- function(library) {
  for (package in c("gym", if (nzchar(library)) list.files(library))) loadNamespace(package)
}

loaded_from <- function() {
  packages <- setdiff(loadedNamespaces(), "base")
  vapply(packages, function(package) dirname(getNamespaceInfo(package, "path")), "")
}

versions_of <- function(packages) {
  packages <- setdiff(packages, rownames(utils::installed.packages(priority = "base")))
  versions <- vapply(packages, function(package) format(utils::packageVersion(package)), "")
  toString(sort(paste(packages, versions)))
}

# Returns the packages that should have come from `library`, but did not.
not_loaded_from <- function(library) {
  from <- loaded_from()
  held <- intersect(names(from), list.files(library))
  astray <- held[from[held] != normalizePath(library)]
  union(astray, setdiff(c("gym", "httr", "curl", "testthat"), held))
}

run_tests <- function(pattern, library = Sys.getenv("GYM_R_LIBRARY")) {
  load_packages(library)
  results <- test_dir(
    "tests/testthat", filter = pattern, package = "gym", load_package = "installed",
    reporter = "summary", stop_on_failure = FALSE
  )
  states <- vapply(results, state_of, "")
  count <- function(state) sum(states == state)

  cat("\n", R.version.string, "; ", versions_of(loadedNamespaces()), "\n", sep = "")
  astray <- if (nzchar(library)) not_loaded_from(library)
  if (length(astray) > 0) cat("Not loaded from ", library, ": ", toString(astray), "\n", sep = "")
  cat(sprintf(
    "R tests: %d passed, %d failed, %d skipped\n",
    count("passed"), count("failed"), count("skipped")
  ))
  count("passed") > 0 && count("failed") == 0 && length(astray) == 0
}

arguments <- commandArgs(trailingOnly = TRUE)
quit(status = if (run_tests(if (length(arguments)) arguments[[1]])) 0 else 1)
