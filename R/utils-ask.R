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
