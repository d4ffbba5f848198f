# Paths that are used later than they are given: the working directory may be another one by then,
# and tools are run in one of their own and do not expand "~".

# normalizePath() leaves the path of a file that does not exist yet as it is, and returns another
# one after it was made, if a folder above it is a link.
absolute_path <- function(path) {
  path <- path.expand(path)
  if (is_windows()) {
    path <- chartr("\\", "/", path)
  }
  if (grepl("^(/|[A-Za-z]:/)", path)) path else file.path(getwd(), path)
}

is_windows <- function() .Platform$OS.type == "windows"

# tempfile(), also where the session's temporary folder is gone: systems that clean /tmp delete it
# after some days. It is made again then.
temporary_file <- function(pattern = "file", fileext = "") {
  tempfile(pattern, tempdir(check = TRUE), fileext)
}
