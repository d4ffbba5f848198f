# Questions to the user of an interactive session.

#' Ask a yes-or-no question
#'
#' Only if [rlang::is_interactive()]. It asks once: repeated questions would swallow a pasted script
#' line by line.
#' @param question The question; its last line is the prompt, the lines above explain it.
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
    gym_abort(
      c(
        paste0("Neither yes nor no: ", describe_value(answer), "."),
        i = "Was that the next line of a script? Run this call by itself, answer, then the rest."
      ),
      class = "gym_error_argument",
      call = call
    )
  }
  choice == 1L
}

# A separate function, so that tests can replace it.
read_answer_line <- function(prompt) readline(prompt)

# Addresses -------------------------------------------------------------------------------

# Open an address in RStudio's viewer, in a browser, or by the option `gym.viewer`.

#' Open an address for the user
#'
#' The option `getOption("gym.viewer")` may be a function of an address, which opens it, also in a
#' script, or `FALSE`, which opens nothing. Without the option an interactive session opens the
#' address in RStudio's viewer, otherwise in the browser.
#' @param address A URL, or the path of a file.
#' @param viewer The option's value, already checked.
#' @return Whether something opened it without an error, logical: a machine may have no browser, and
#'   some browsers fail silently. An error of the option's function is raised.
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
    gym_abort(
      paste0("The option `gym.viewer` must be a function of an address, or FALSE, not ",
             describe_argument(viewer), "."),
      class = "gym_error_argument", argument = "gym.viewer", value = viewer, call = call
    )
  }
  viewer
}
