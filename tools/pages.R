# Builds the vignettes once and installs the package with them into .r-library/, where
# browseVignettes("gym") finds them. Prints the address of their first page.
source("tools/tarball.R")

contents <- file.path(normalizePath(".r-library/gym"), "doc", "index.html")
changed <- function() {
  sources <- list.files("vignettes", full.names = TRUE)
  !file.exists(contents) || any(file.mtime(sources) > file.mtime(contents))
}

# The output is shown only if this fails.
install_pages <- function() {
  folder <- tempfile("pages-")
  dir.create(folder)
  log <- tempfile("pages-log-")
  status <- tryCatch(
    r_cmd("INSTALL", "--no-lock", "--library=.r-library", shQuote(build_tarball(folder, log)),
          output = log),
    error = conditionMessage
  )
  if (!identical(status, 0L)) {
    writeLines(utils::tail(readLines(log), 40))
    stop("The vignettes could not be built (see above).", call. = FALSE)
  }
  Sys.setFileTime(contents, Sys.time())
}

if (!requireNamespace("rmarkdown", quietly = TRUE) || !rmarkdown::pandoc_available()) {
  cat("\nTo build the vignettes, install pandoc, knitr and rmarkdown.\n")
  quit()
}
if (changed()) {
  cat("\nBuilding the vignettes (once, a minute or two).\n")
  install_pages()
}
cat("\nTo read on, open file://", contents, "\n", sep = "")
cat("or call in R (tools/in-env R):  browseVignettes(\"gym\")\n")
