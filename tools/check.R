# Builds the package and checks it, both in a temporary folder, and says what the check found. The
# vignettes are computed once, by the build. Fails on errors, warnings and notes, except for notes
# about the machine.

excusable <- c(
  "unable to verify current time",
  "Packages? suggested but not available for checking:( *'(av|sigmoid)',?)+ *$"
)

source("tools/tarball.R")

inexcusable <- function(log) {
  found <- tools::check_packages_in_dir_details(logs = log, drop_ok = TRUE)
  text <- gsub("[\u2018\u2019]", "'", gsub("\\s+", " ", found$Output))
  excused <- grepl(paste(excusable, collapse = "|"), text) & found$Status == "NOTE"
  found[!excused & found$Check != "*", ]
}

check_package <- function(folder) {
  tarball <- build_tarball(folder)
  here <- setwd(folder)
  on.exit(setwd(here))
  # In .ci/run the tests share the cores: PyTorch's threads would wait for each other.
  Sys.setenv("_R_CHECK_FORCE_SUGGESTS_" = "false", OMP_NUM_THREADS = "1")
  status <- r_cmd("check", "--no-manual", "--no-vignettes", tarball)
  log <- file.path("gym.Rcheck", "00check.log")
  bad <- inexcusable(log)
  for (output in list.files("gym.Rcheck", "[.]fail$", recursive = TRUE, full.names = TRUE)) {
    cat("\n", output, "\n", sep = "")
    writeLines(utils::tail(readLines(output), 60))
  }
  if (nrow(bad) > 0) cat("\nTo fix:", paste(bad$Status, bad$Check), sep = "\n  ")
  cat("\nR CMD check: ", sub("Status: ", "", utils::tail(readLines(log), 1)), "\n", sep = "")
  status == 0 && nrow(bad) == 0
}

# Byte-compiling takes most of the time of an installation. Here are two installations, which run
# little code.
Sys.setenv(R_COMPILE_PKGS = "0")
# This folder is outside of tempdir(), which is deleted with this process: the files of a failed
# check must stay.
folder <- tempfile("gym-check-", tmpdir = dirname(tempdir()))
dir.create(folder)
good <- check_package(folder)
if (good) unlink(folder, recursive = TRUE) else cat("All of it is in ", folder, "\n", sep = "")
quit(status = if (good) 0 else 1)
