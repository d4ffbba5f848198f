# Builds the package with its vignettes.

# `output` names the file for what the command prints; "" shows it.
r_cmd <- function(..., output = "") {
  r <- file.path(R.home("bin"), "R")
  system2(r, c("CMD", ...), stdout = output, stderr = output, stdin = "")
}

# R CMD build would first copy the folders of the tools and then drop them, so leave them out from
# the start.
copy_of_checkout <- function(into) {
  left_behind <- c(".git", ".venv", ".r-library", ".cran-library", "pictures", "site", "server")
  files <- setdiff(list.files(all.files = TRUE, no.. = TRUE), left_behind)
  dir.create(into)
  stopifnot(file.copy(files, into, recursive = TRUE))
}

# Builds the checkout in `folder`; returns the tarball's path.
build_tarball <- function(folder, output = "") {
  copy_of_checkout(file.path(folder, "gym"))
  here <- setwd(folder)
  on.exit(setwd(here))
  if (r_cmd("build", "gym", output = output) != 0) stop("R CMD build failed", call. = FALSE)
  file.path(folder, list.files(pattern = "^gym_.*[.]tar[.]gz$"))
}
