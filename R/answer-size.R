# How much of this session's memory an answer may take, whatever a server sends.

# 5,000 pictures of Atari's games, and as JSON some millions of numbers. R takes up to eight times
# the bytes of a tensor, and seventy times those of JSON.
default_answer_bytes <- 2^29
json_share <- 1 / 16

max_answer_bytes <- function(call = rlang::caller_env()) {
  bytes <- getOption("gym.max_answer_bytes", default_answer_bytes)
  check_number(bytes, min = 1, arg = "options(gym.max_answer_bytes)", call = call)
  bytes
}

#' Have a handle stop an answer that is too large
#'
#' Nothing is unpacked: how much a few bytes become cannot be known beforehand, and libcurl
#' unpacks all that has come before it looks at the clock. libcurl tells how much has come about
#' ten times in a call.
#' @param state The client's; it has the limit, and hears in `overlong` why a call was ended.
#' @noRd
bound_answers <- function(handle, state) {
  state$most_bytes <- max_answer_bytes()
  curl::handle_setopt(
    handle,
    accept_encoding = NULL,
    noprogress = FALSE,
    xferinfofunction = function(down, up) {
      down[[2L]] <= state$most_bytes || {
        state$overlong <- TRUE
        FALSE
      }
    }
  )
}

# Before it is parsed.
check_json_size <- function(content) {
  most <- max_answer_bytes() * json_share
  if (length(content) > most) {
    abort_overlong(most, "It is JSON, which may take a sixteenth of that: R makes much of it.")
  }
}

abort_overlong <- function(most, reason = NULL, base = NULL, call = NULL) {
  gym_abort(
    c(
      paste0("The answer of the server", if (!is.null(base)) paste0(" at ", base),
             " is larger than ", count_of(floor(most), "byte"), "."),
      x = reason,
      i = "`options(gym.max_answer_bytes = )` sets how large an answer may be."
    ),
    class = "gym_error_connection", url = base, call = call
  )
}
