# Progress, interrupts, and the results of what ended early.

#' Play until the end or an interrupt
#'
#' @param play Code that plays.
#' @param text A message for an interrupt, for cli, with `{finished}` and, if given, `{total}`.
#' @param count_finished A function that returns the number of finished ones, or a text.
#' @return Whether there was an interrupt, logical.
#' @noRd
until_interrupted <- function(play, text, count_finished, total = NULL) {
  tryCatch(
    {
      play
      FALSE
    },
    interrupt = function(cnd) {
      finished <- count_finished()
      cli::cli_inform(c("!" = text), class = "gym_message_interrupted")
      TRUE
    }
  )
}

#' Show a progress bar until the calling function ends
#'
#' If the package progressr is loaded, its handlers are informed, too.
#' @param unit The unit, a word such as `"Round"`.
#' @param note The text before the remaining time.
#' @param shown Whether to show the bar.
#' @return A function of the number of finished units and the new `note`.
#' @noRd
progress_bar <- function(total, unit, note = "", shown = TRUE, frame = parent.frame()) {
  bar <- if (shown) cli_bar(total, unit, note, frame) else function(finished, note) NULL
  signal <- progress_signal(total, frame)
  function(finished, note = "") {
    bar(finished, note)
    signal(finished, note)
  }
}

cli_bar <- function(total, unit, note, frame) {
  bar <- cli::cli_progress_bar(
    total = total,
    format = paste(
      unit, "{cli::pb_current} of {cli::pb_total} {cli::pb_bar}",
      "{cli::pb_extra$note}{cli::pb_eta_str}"
    ),
    extra = list(note = note),
    .envir = frame
  )
  shown <- 0
  function(finished, note) {
    # A finished bar no longer exists.
    if (shown < total) {
      shown <<- finished
      cli::cli_progress_update(
        id = bar, set = finished, extra = list(note = note), .envir = frame
      )
    }
  }
}

# At most a hundred signals, because each takes a while.
progress_signal <- function(total, frame) {
  if (!"progressr" %in% loadedNamespaces()) {
    return(function(finished, note) NULL)
  }
  progress <- progressr::progressor(steps = total, envir = frame)
  told <- 0
  function(finished, note) {
    if (finished - told >= total / 100 || finished >= total && told < total) {
      progress(note, amount = finished - told)
      told <<- finished
    }
  }
}

# The error keeps the classes and fields of the original one: code that expects a lost connection
# need not know that it was lost during play.
abort_with_result <- function(cnd, what, result, played, class, call, hint = NULL) {
  own <- c("message", "call", "parent", "trace", "body", "header", "footer", "rlang",
           "use_cli_format")
  fields <- unclass(cnd)[setdiff(names(cnd), own)]
  rlang::exec(
    gym_abort,
    c(
      paste0(what, " ended early, after ", played, "."),
      i = "The field `result` of this condition has the finished part.",
      i = hint
    ),
    class = c(class, grep("^gym_error_", class(cnd), value = TRUE)),
    result = result,
    !!!fields,
    parent = cnd,
    call = call
  )
}
