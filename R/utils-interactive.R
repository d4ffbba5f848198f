# Questions to the user of an interactive session.

#' Ask a yes-or-no question
#'
#' Call this only if [rlang::is_interactive()]. It asks once: repeated questions would take the
#' lines of a pasted script as answers.
#' @param question The question. Its last line is the prompt, and the lines above explain it.
#' @param default The answer for just pressing Enter.
#' @return `TRUE` or `FALSE`; `FALSE` if a dialog was cancelled.
#' @noRd
ask_yes_no <- function(question, default, call = rlang::caller_env()) {
  if (is.function(getOption("askYesNo"))) {
    # R and RStudio on Windows open a dialog, which a pasted script cannot answer by accident.
    return(isTRUE(utils::askYesNo(question, default = default)))
  }
  choices <- if (default) "(Yes/no)" else "(yes/No)"
  # R truncates a long prompt, so only the last line is the prompt.
  lines <- strsplit(question, "\n", fixed = TRUE)[[1L]]
  writeLines(utils::head(lines, -1L))
  prompt <- paste0(utils::tail(lines, 1L), " ", choices, " ")
  answer <- trimws(read_answer_line(prompt))
  if (!nzchar(answer)) {
    return(default)
  }
  choice <- pmatch(tolower(answer), c("yes", "no"))
  if (is.na(choice)) {
    abort_wrong(NULL, NULL, call, "Neither yes nor no: {describe_value(answer)}.",
                i = "Was that the next line of a script? Run this call by itself, answer, then the
                     rest.")
  }
  choice == 1L
}

# This is a separate function so that tests can replace it.
read_answer_line <- function(prompt) readline(prompt)

# Addresses -------------------------------------------------------------------------------

#' Open an address for the user
#'
#' The option `getOption("gym.viewer")` may be a function that opens an address, also in a script,
#' or `FALSE`, which opens nothing. Without the option an interactive session opens the address in
#' RStudio's viewer, otherwise in the browser.
#' @param address A URL, or the path of a file.
#' @param viewer The option's value, already checked.
#' @return A logical: whether the address was opened without an error. A machine may have no
#'   browser, and some browsers fail silently. An error of the option's function is not caught.
#' @noRd
open_address <- function(address, viewer = check_viewer()) {
  if (isFALSE(viewer)) {
    return(FALSE)
  }
  if (is.function(viewer)) {
    viewer(address)
    return(TRUE)
  }
  if (!rlang::is_interactive()) {
    return(FALSE)
  }
  # RStudio's viewer shows only local pages.
  elsewhere <- grepl("^https?://", address) && !is_loopback(address)
  usual <- (if (!elsewhere) getOption("viewer")) %||% utils::browseURL
  tryCatch(
    {
      usual(address)
      TRUE
    },
    error = function(cnd) FALSE
  )
}

# Returns the option's value: a function of the address, FALSE to open nothing, or NULL.
check_viewer <- function(call = rlang::caller_env()) {
  viewer <- getOption("gym.viewer")
  if (!is.null(viewer) && !is.function(viewer) && !isFALSE(viewer)) {
    abort_wrong("gym.viewer", viewer, call,
                "The option `gym.viewer` must be a function of an address, or FALSE, not
                 {describe_argument(viewer)}.")
  }
  viewer
}

# Paths -----------------------------------------------------------------------------------

# Makes a path that still works later: the working directory may change, and other programs have
# their own and do not expand "~".

# normalizePath() would not do. It leaves the path of a missing file as it is, and if a folder above
# the file is a link, it returns another path once the file exists.
absolute_path <- function(path) {
  path <- path.expand(path)
  if (is_windows()) path <- chartr("\\", "/", path)
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
#' @return A list of `host`, in the server's form, and `port`. `NULL` for an address on another
#'   machine, or one that our server cannot have.
#' @noRd
local_place <- function(base) {
  pattern <- "^http://(127([.][0-9]{1,3}){3}|localhost|\\[::1\\]):([0-9]{1,5})$"
  parts <- regmatches(base, regexec(pattern, base))[[1L]]
  port <- as.integer(parts[4L])
  if (port %in% 1:65535) {
    host <- gsub("[][]", "", parts[[2L]])
    list(host = if (host == "localhost") "127.0.0.1" else host, port = port)
  }
}

# The call that starts a server at an address.
start_call <- function(place) {
  host <- if (place$host != "127.0.0.1") paste0(", host = \"", place$host, "\"")
  paste0("gym_server_start(port = ", place$port, host, ")")
}

base_of <- function(url) sub("(//[^/]*).*", "\\1", url)

is_server_address <- function(url) grepl("^https?://[^/]", url)
