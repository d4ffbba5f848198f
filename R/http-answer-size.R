# Limits the size of an answer, so that no server can fill this session's memory.

# Enough for 5,000 frames of Atari games, or some millions of numbers as JSON. R needs up to eight
# times the bytes of a tensor, and up to seventy times those of JSON.
default_answer_bytes <- 2^29
json_share <- 1 / 16

answer_bytes_option <- function() getOption("gym.max_answer_bytes", default_answer_bytes)

max_answer_bytes <- function(call = NULL) {
  bytes <- answer_bytes_option()
  check_number(bytes, min = 1, arg = "options(gym.max_answer_bytes)", call = call)
  bytes
}

# Answers up to this size are always accepted, because reading the option takes time in each call.
small_answer <- 2^16

# Checks the size of a JSON text before it is parsed.
check_json_size <- function(content) {
  if (length(content) > small_answer && length(content) > max_answer_bytes() * json_share) {
    abort_too_large(json_share, "R needs much memory for JSON: its limit is a sixteenth.")
  }
}

abort_too_large <- function(share = 1, reason = NULL, base = NULL, call = NULL) {
  most <- max_answer_bytes(call) * share
  gym_abort(
    c(
      paste0("The answer of the server", if (!is.null(base)) paste0(" at ", base),
             " is larger than ", count_of(floor(most), "byte"), "."),
      x = reason,
      i = "`options(gym.max_answer_bytes = )` sets the limit."
    ),
    class = "gym_error_connection", url = base, call = call
  )
}
