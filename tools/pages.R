# Builds the vignettes once and installs the package with them into .r-library/, where
# browseVignettes("gym") finds them. Prints where they begin.
source("tools/tarball.R")

contents <- file.path(normalizePath(".r-library/gym"), "doc", "index.html")
changed <- function() {
  sources <- list.files("vignettes", full.names = TRUE)
  !file.exists(contents) || any(file.mtime(sources) > file.mtime(contents))
}

# What it says is shown only when it fails.
install_pages <- function() {
  folder <- tempfile("pages-")
  dir.create(folder)
  log <- tempfile("pages-log-")
  r <- file.path(R.home("bin"), "Rscript")
  steps <- 'source("tools/tarball.R"); folder <- commandArgs(TRUE)
    tarball <- build_tarball(folder)
    quit(status = r_cmd("INSTALL", "--no-lock", "--library=.r-library", shQuote(tarball)))'
  status <- system2(r, c("--no-init-file", "-e", shQuote(steps), shQuote(folder)), log, log)
  if (status != 0) {
    writeLines(utils::tail(readLines(log), 40))
    stop("The pages could not be built (see above).", call. = FALSE)
  }
  Sys.setFileTime(contents, Sys.time())
}

if (!requireNamespace("rmarkdown", quietly = TRUE) || !rmarkdown::pandoc_available()) {
  cat("\nWith pandoc and the R packages knitr and rmarkdown, `make demo` builds the vignettes.\n")
  quit()
}
if (changed()) {
  cat("\nBuilding the vignettes, once: a minute or two.\n")
  install_pages()
}
cat("\nWhere to go on: file://", contents, "\n", sep = "")
cat("or, in R (tools/in-env R):  browseVignettes(\"gym\")\n")
