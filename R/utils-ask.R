# Questions to the user of an interactive session.

#' Ask a question that is answered by yes or no
#'
#' Only where [rlang::is_interactive()]. It is asked once: a question asked again and again
#' would swallow, line after line, a script that is pasted into the console.
#' @param question The question; its last line is the prompt, what is above explains it.
#' @param default What just pressing Enter means.
#' @return `TRUE` or `FALSE`; `FALSE` when a dialog was cancelled.
#' @noRd
ask_yes_no <- function(question, default, call = rlang::caller_env()) {
  if (is.function(getOption("askYesNo"))) {
    # R and RStudio on Windows open a dialog, which a pasted script cannot answer by accident.
    return(isTRUE(utils::askYesNo(question, default = default)))
  }
  choices <- if (default) "(Yes/no)" else "(yes/No)"
  # R truncates a long prompt: only the last line is the prompt.
  lines <- strsplit(question, "\n", fixed = TRUE)[[1L]]
  writeLines(utils::head(lines, -1L))
  prompt <- paste0(utils::tail(lines, 1L), " ", choices, " ")
  answer <- trimws(read_answer_line(prompt))
  if (!nzchar(answer)) {
    return(default)
  }
  choice <- pmatch(lower_case(answer), c("yes", "no"))
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

# A function of its own so that tests can replace it.
read_answer_line <- function(prompt) readline(prompt)
