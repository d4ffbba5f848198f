# Paths that are used later: the working directory may have changed by then, and tools have their
# own one and do not expand "~".

# normalizePath() does not change the path of a missing file, and returns another one after the file
# was made if a folder above it is a link.
absolute_path <- function(path) {
  path <- path.expand(path)
  if (is_windows()) {
    path <- chartr("\\", "/", path)
  }
  if (grepl("^(/|[A-Za-z]:/)", path)) path else file.path(getwd(), path)
}

is_windows <- function() .Platform$OS.type == "windows"

# Like tempfile(), but recreates the session's temporary folder, which some systems delete after
# some days.
temporary_file <- function(pattern = "file", fileext = "") {
  tempfile(pattern, tempdir(check = TRUE), fileext)
}
