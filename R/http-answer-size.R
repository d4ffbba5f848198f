# How much of this session's memory an answer may take, whatever a server sends.

# 5,000 pictures of Atari's games, and as JSON some millions of numbers. R takes up to eight times
# the bytes of a tensor, and seventy times those of JSON.
default_answer_bytes <- 2^29
json_share <- 1 / 16

answer_bytes_option <- function() getOption("gym.max_answer_bytes", default_answer_bytes)

max_answer_bytes <- function(call = NULL) {
  bytes <- answer_bytes_option()
  check_number(bytes, min = 1, arg = "options(gym.max_answer_bytes)", call = call)
  bytes
}

# Which is taken whatever the option says: each call pays for looking at it.
small_answer <- 2^16

#' Have a handle stop an answer that is too large
#'
#' Nothing is unpacked: how much a few bytes become cannot be known beforehand, and libcurl
#' unpacks all that has come before it looks at the clock. libcurl tells how much has come about
#' ten times in a call.
#' @param state The client's, which hears in `overlong` why a call was ended.
#' @noRd
bound_answers <- function(handle, state) {
  curl::handle_setopt(
    handle,
    accept_encoding = NULL,
    noprogress = FALSE,
    xferinfofunction = function(down, up) {
      down[[2L]] <= small_answer || {
        # Where the option is no number that is said when the call has ended.
        most <- answer_bytes_option()
        state$overlong <- !is_number(most) || down[[2L]] > most
        !state$overlong
      }
    }
  )
}

# Before it is parsed.
check_json_size <- function(content) {
  if (length(content) > small_answer && length(content) > max_answer_bytes() * json_share) {
    abort_overlong(json_share, "It is JSON, of which R makes much: that may have a sixteenth.")
  }
}

abort_overlong <- function(share = 1, reason = NULL, base = NULL, call = NULL) {
  most <- max_answer_bytes(call) * share
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
