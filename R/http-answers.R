# Reads an answer: its JSON or tensors, or the error that it reports.

#' Read an answer or raise the error that it reports
#' @return The parsed answer, `NULL` for an empty one.
#' @noRd
read_answer <- function(response, method, call = rlang::caller_env()) {
  response <- with_answer(response)
  answer <- response$answer
  if (response$status_code >= 400L) {
    abort_http(response, method, call)
  }
  if (response$status_code != 204L && is.null(answer)) {
    abort_no_answer(response, call)
  }
  check_fields(answer)
  answer
}

# Adds `answer`, a list, to a response: `NULL` if there is no answer, or nobody can read it. Errors
# of this package say more, so they are raised.
with_answer <- function(response) {
  read <- function(content, type) {
    if (response$status_code == 204L) {
      NULL
    } else if (isTRUE(type %in% c(tensors_type, column_tensors_type))) {
      tensors_answer(content, type == column_tensors_type)
    } else if (identical(type, "image/png")) {
      list(png = content)
    } else {
      check_json_size(content)
      json_answer(content)
    }
  }
  answer <- tryCatch(
    read(response$content, response$type),
    error = function(cnd) if (inherits(cnd, "gym_error")) rlang::cnd_signal(cnd)
  )
  response["answer"] <- list(answer)
  response
}

# Returns the answer, or NULL if it is not a JSON object. A field `tensors` is removed: only
# read_tensors() may make it.
json_answer <- function(content) {
  answer <- from_json(rawToChar(content))
  if (is.list(answer)) {
    answer$tensors <- NULL
    answer
  }
}

# An answer with tensors has the fields of the JSON answer that it replaces, and also the tensors
# and texts by their names.
tensors_answer <- function(bytes, by_column) {
  file <- read_tensors(bytes, by_column)
  field <- function(name) {
    text <- file$metadata[[name]]
    if (!is.null(text)) from_json(text)
  }
  list(
    tensors = file$tensors,
    texts = field("texts"),
    info = if (identical(file$metadata$info, "{}")) empty_object else field("info"),
    final_sub_envs = field("final_sub_envs"),
    error = field("error")
  )
}

empty_object <- structure(list(), names = character())

# Types ---------------------------------------------------------------------------------------

# The types of the fields that answers may have.
field_types <- c(
  env_id = "string", instance_id = "string", vectorization_mode = "string",
  autoreset_mode = "string", render_mode = "string", processor = "string", server = "string",
  num_envs = "count", num_workers = "count", group = "count", processes = "count",
  max_episode_steps = "number", reward_threshold = "number", member = "flag",
  needs_max_steps = "flag", watched = "flag", all_envs = "object", info = "object", spec = "object"
)
type_checks <- list(
  string = rlang::is_string, count = function(x) is_number(x) && are_whole(x, 0, 2^24),
  number = function(x) is_json_number(x), flag = rlang::is_bool,
  object = function(x) is.list(x) && (!length(x) || !is.null(names(x)))
)
type_words <- c(
  string = "a string", count = "a whole number", number = "one number", flag = "true or false",
  object = "an object"
)

# Checks all fields of an answer by their names.
check_fields <- function(answer) {
  for (name in intersect(names(answer), names(field_types))) {
    type <- field_types[[name]]
    value <- answer[[name]]
    if (!is.null(value) && !type_checks[[type]](value)) {
      refuse_field(value, name, type_words[[type]])
    }
    if (name == "spec") check_fields(value)
  }
}

abort_answer <- function(problem, call = NULL) {
  gym_abort(
    c("The server's answer is invalid.", x = paste0(problem, ".")),
    class = "gym_error_connection", problem = problem, call = call
  )
}

refuse_field <- function(value, name, must) {
  abort_answer(paste0("Its `", name, "` is ", describe_value(value), ", not ", must))
}

#' Read the values of an answer
#'
#' A wrong answer can cause any error in R. This replaces it by an error that says what is wrong
#' with the answer.
#' @noRd
read_values <- function(expr, what) {
  # This runs in each step: tryCatch() takes three times as long as a calling handler.
  withCallingHandlers(expr, error = function(cnd) {
    if (!is.null(cnd$problem)) {
      abort_answer(paste0(what, ": ", cnd$problem))
    } else if (!inherits(cnd, "gym_error")) {
      abort_answer(paste0(what, " cannot be read: ", conditionMessage(cnd)))
    }
  })
}

#' Read a column of a table from a list of objects
#' @param missing The value for an object without the field; it sets the column's type.
#' @noRd
listed_column <- function(listed, name, missing) {
  read_values(
    vapply(listed, function(one) {
      value <- one[[name]] %||% missing
      if (!is.character(value)) {
        value
      } else if (is.character(missing)) {
        shown_line(value)
      } else {
        number_from_json(value)
      }
    }, missing, USE.NAMES = FALSE),
    paste0("Its `", name, "`")
  )
}

# Values of spaces ----------------------------------------------------------------

check_numbers <- function(values, shape) {
  # An array with other text than NaN and the infinities is not numeric here.
  if (length(values) != prod(shape) || !is.numeric(values) && !is.logical(values)) {
    abort_answer(paste("A value is not an array of numbers of shape", shape_text(shape)))
  }
  values
}

check_text <- function(value) {
  if (!rlang::is_string(value)) refuse_field(value, "text", "a string")
  value
}

check_list <- function(value, n, what) {
  if (!is.list(value) || length(value) != n) {
    abort_answer(paste("A value of", what, "is not a list of", n))
  }
}

# The size of an answer ---------------------------------------------------------------------

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

# Answers up to this size are always accepted: to read the option for each call takes time.
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
