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

# Addresses of servers --------------------------------------------------------------------

is_loopback <- function(base) {
  grepl("^https?://(127[.][0-9.]+|localhost|\\[::1\\])(:[0-9]+)?(/|$)", base)
}

#' Find the host and port of a server on this machine
#' @return A list of `host`, in the server's form, and `port`; `NULL` for any other address and one
#'   that a server of ours cannot have.
#' @noRd
local_place <- function(base) {
  pattern <- "^http://(127([.][0-9]{1,3}){3}|localhost|\\[::1\\]):([0-9]{1,5})$"
  parts <- regmatches(base, regexec(pattern, base))[[1L]]
  if (!length(parts)) {
    return(NULL)
  }
  port <- as.integer(parts[[4L]])
  if (port < 1L || port > 65535L) {
    return(NULL)
  }
  host <- gsub("[][]", "", parts[[2L]])
  list(host = if (host == "localhost") "127.0.0.1" else host, port = port)
}

# The call that starts a server at an address.
start_call <- function(place) {
  host <- if (place$host != "127.0.0.1") paste0(", host = \"", place$host, "\"")
  paste0("gym_server_start(port = ", place$port, host, ")")
}

base_of <- function(url) sub("(//[^/]*).*", "\\1", url)

is_server_address <- function(url) grepl("^https?://[^/]", url)
