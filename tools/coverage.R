# Measures which lines of R/ the tests run. Prints the files below 80 %. A test that fails here may
# pass in make test, because the measured code is slow.
tests <- sprintf(
  "setwd(%s)
  Sys.setenv(NOT_CRAN = 'true', TESTTHAT_PARALLEL = 'TRUE', TESTTHAT_CPUS = '2')
  testthat::test_dir('tests/testthat', package = 'gym', load_package = 'installed',
                     reporter = 'summary', stop_on_failure = FALSE)",
  deparse1(getwd())
)
measured <- covr::package_coverage(type = "none", code = tests)
share <- function(value) 100 * mean(value > 0)
lines <- covr::tally_coverage(measured, by = "line")
files <- sort(tapply(lines$value, basename(lines$filename), share))
cat("\nThe R package, below 80 %:\n")
below <- files[files < 80]
if (length(below) > 0) cat(sprintf("  %.0f%% %s\n", below, names(below)), sep = "")
cat(sprintf("The R package, all of it: %.0f%%\n", share(lines$value)))
