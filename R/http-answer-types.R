# Checks of the fields of answers: values of another type are refused, from any server.

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
#' A wrong answer can cause various errors in R. They become an error that says what was wrong in
#' the answer.
#' @noRd
read_values <- function(expr, what) {
  # This runs in each step: tryCatch() takes three times as long as a calling handler.
  withCallingHandlers(expr, error = function(cnd) {
    if (inherits(cnd, "gym_error_connection")) {
      abort_answer(paste0(what, ": ", cnd$problem))
    } else if (!inherits(cnd, "gym_error")) {
      abort_answer(paste0(what, " cannot be read: ", conditionMessage(cnd)))
    }
  })
}

is_object <- function(x) is.list(x) && (!length(x) || !is.null(names(x)))

string_or_null <- function(x) if (rlang::is_string(x)) x

# Checks a field that may be missing.
check_optional <- function(answer, name, is_right, must) {
  value <- answer[[name]]
  if (!is.null(value) && !is_right(value)) {
    refuse_field(value, name, must)
  }
}

# Fields --------------------------------------------------------------------------

number_from <- function(x, name) {
  if (!is_json_number(x)) {
    refuse_field(x, name, "one number")
  }
  number_from_json(x)
}

#' @param result A list of `reward`, `terminated` and `truncated`, with `n` elements each.
#' @noRd
check_answer_results <- function(result, n) {
  if (!is.numeric(result$reward) || length(result$reward) != n) {
    refuse_field(result$reward, "reward", paste(n, "numbers"))
  }
  for (name in c("terminated", "truncated")) {
    flags <- result[[name]]
    if (!is.logical(flags) || length(flags) != n || anyNA(flags)) {
      refuse_field(flags, name, paste(n, "times true or false"))
    }
  }
}

check_final_sub_envs <- function(sub_envs, n) {
  if (!is.null(sub_envs) && !(are_whole(sub_envs, 0, n - 1) && !anyDuplicated(sub_envs))) {
    refuse_field(sub_envs, "final_sub_envs", paste("numbers from 0 to", n - 1))
  }
}

# Ids become part of an address.
check_instance_id <- function(id) {
  if (!rlang::is_string(id) || !grepl("^[!-~]{1,100}$", id)) {
    refuse_field(id, "instance_id", "a string of visible characters")
  }
}

#' Check the description of an instance
#'
#' No answer could contain the values of more than 2^24 sub-environments.
#' @noRd
check_about <- function(about) {
  is_num_envs <- function(x) is_number(x) && are_whole(x, 1, 2^24)
  check_optional(about, "num_envs", is_num_envs, "a whole number")
  is_num_workers <- function(x) is_number(x) && are_whole(x, 0, 2^24)
  check_optional(about, "num_workers", is_num_workers, "a whole number")
  check_optional(about, "max_episode_steps", is_number, "a number")
  for (name in c("env_id", "vectorization_mode", "autoreset_mode", "render_mode")) {
    check_optional(about, name, rlang::is_string, "a string")
  }
}

#' Get a column from a list of objects in an answer
#' @param is_right,must A function that checks a value, and its description in words.
#' @param missing The value for a missing field.
#' @noRd
listed_column <- function(listed, name, missing, is_right, must) {
  if (!is.list(listed) || !all(vapply(listed, is_object, NA))) {
    abort_answer("It is not a list of objects")
  }
  vapply(listed, function(one) {
    value <- one[[name]] %||% return(missing)
    if (!is_right(value)) {
      refuse_field(value, name, must)
    }
    if (is.character(value)) shown_line(value) else value
  }, missing, USE.NAMES = FALSE)
}

listed_texts <- function(listed, name, missing = NA_character_) {
  listed_column(listed, name, missing, rlang::is_string, "a string")
}

listed_flags <- function(listed, name) {
  listed_column(listed, name, NA, rlang::is_bool, "true or false")
}

# JSON writes a whole number without a point, as an integer.
listed_numbers <- function(listed, name) {
  as_numbers <- lapply(listed, function(one) {
    if (is.list(one) && is.numeric(one[[name]])) one[[name]] <- as.numeric(one[[name]])
    if (is.list(one) && is_number_word(one[[name]])) one[[name]] <- number_from_json(one[[name]])
    one
  })
  listed_column(as_numbers, name, NA_real_, function(x) is.double(x) && length(x) == 1L, "a number")
}

listed_counts <- function(listed, name) {
  listed_column(
    listed, name, NA_integer_, function(x) is.integer(x) && length(x) == 1L, "a whole number"
  )
}

# Values of spaces ----------------------------------------------------------------

#' Check the numbers read for a space
#' @param shape Its shape, or that of several values of it.
#' @noRd
check_numbers <- function(values, shape) {
  # Only words for NaN and the infinities are read as numbers.
  if (length(values) != prod(shape) || !is.numeric(values) && !is.logical(values)) {
    abort_answer(paste("A value is not an array of numbers of shape", shape_text(shape)))
  }
  values
}

check_tensor <- function(value, space, name) {
  shape <- space$shape
  if (length(value) != prod(shape) || !identical(dim(value), if (length(shape) > 1L) shape)) {
    abort_answer(paste0(
      "Its tensor \"", name, "\" has the shape ", shape_text(dim(value) %||% length(value)),
      ", not ", shape_text(shape %||% integer())
    ))
  }
  value
}

check_text <- function(value) {
  if (!rlang::is_string(value)) {
    refuse_field(value, "text", "a string")
  }
  value
}

check_list <- function(value, n, what) {
  if (!is.list(value) || length(value) != n) {
    abort_answer(paste("A value of", what, "is not a list of", n))
  }
}

# Pictures ------------------------------------------------------------------------

check_frame <- function(values) {
  shape <- dim(values)
  if (!is.integer(values) || length(shape) != 3L || !shape[[3L]] %in% c(1L, 3L, 4L)) {
    refuse_field(values, "frame", "a picture of height x width x 1, 3 or 4")
  }
  values
}

# Checks a PNG file by its header: the decoded pixels may need much more memory.
check_png <- function(file) {
  signature <- as.raw(c(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a))
  if (!is.raw(file) || length(file) < 24L || !identical(file[1:8], signature)) {
    abort_answer("It is not a PNG file")
  }
  size <- png_size(file)
  if (anyNA(size) || any(size < 1L) || 4 * prod(size) > max_answer_bytes()) {
    abort_answer(paste("It is a picture of", paste(size, collapse = " x "), "pixels"))
  }
  file
}

# The header of the file has width and height.
png_size <- function(file) readBin(file[17:24], "integer", 2L, endian = "big")
