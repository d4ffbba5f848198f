# Spaces composed of other spaces: a value of Tuple or Dict has a value of each of them, a value of
# OneOf has a value of one of them.

#' @exportS3Method
space_label.gym_space_tuple <- function(space) {
  parts <- vapply(space$spaces, space_label, "")
  keys <- names(space$spaces)
  if (!is.null(keys)) parts <- paste0(keys, ": ", parts, recycle0 = TRUE)
  paste0(space$name, " (", paste(parts, collapse = ", "), ")")
}

#' @exportS3Method
space_label.gym_space_dict <- space_label.gym_space_tuple

#' @exportS3Method
space_label.gym_space_oneof <- space_label.gym_space_tuple

# Tuple -----------------------------------------------------------------------------

#' @exportS3Method
decode_value.gym_space_tuple <- function(space, json) {
  check_list(json, length(space$spaces), space$name)
  map_parts(space, decode_value, in_order(space, json))
}

#' @exportS3Method
check_value.gym_space_tuple <- function(space, value, path, call, bounds = FALSE) {
  n <- length(space$spaces)
  if (!is.list(value) || length(value) != n) {
    abort_space(space, value, paste("A value of this Tuple is a list of length", n), call, path)
  }
  for (i in seq_len(n)) {
    check_value(space$spaces[[i]], value[[i]], path_index(path, i - 1L), call, bounds)
  }
}

#' @exportS3Method
write_value.gym_space_tuple <- function(space, value) {
  parts <- mapply(write_value, unname(space$spaces), unname(in_order(space, value)))
  keys <- names(space$spaces)
  if (is.null(keys)) {
    return(json_array(parts))
  }
  paste0("{", paste0(json_string(keys), ":", parts, recycle0 = TRUE, collapse = ","), "}")
}

#' @exportS3Method
space_sample.gym_space_tuple <- function(space) lapply(space$spaces, space_sample)

# Dict ------------------------------------------------------------------------------

#' @exportS3Method
decode_value.gym_space_dict <- decode_value.gym_space_tuple

#' @exportS3Method
write_value.gym_space_dict <- write_value.gym_space_tuple

#' @exportS3Method
space_sample.gym_space_dict <- space_sample.gym_space_tuple

#' @exportS3Method
check_value.gym_space_dict <- function(space, value, path, call, bounds = FALSE) {
  keys <- names(space$spaces)
  if (!is.list(value) || length(value) && is.null(names(value))) {
    abort_space(space, value, "A value of Dict is a list with names", call, path)
  }
  given <- enc2utf8(as.character(names(value)))
  missing <- setdiff(keys, given)
  strange <- setdiff(given, keys)
  problem <- if (length(missing)) {
    paste0("The value has no element named \"", missing[[1L]], "\"")
  } else if (length(strange)) {
    paste0("The value has an element named \"", strange[[1L]], "\", which the space does not have")
  } else if (anyDuplicated(given)) {
    paste0("The value has two elements named \"", given[anyDuplicated(given)], "\"")
  }
  if (!is.null(problem)) {
    abort_space(space, value, problem, call, path)
  }
  at <- match(keys, given)
  for (i in seq_along(keys)) {
    check_value(space$spaces[[i]], value[[at[[i]]]], path_key(path, keys[[i]]), call, bounds)
  }
}

# OneOf -----------------------------------------------------------------------------

#' @exportS3Method
decode_value.gym_space_oneof <- function(space, json) {
  check_list(json, 2L, "OneOf")
  index <- json[[1L]]
  if (!is_number(index) || !are_whole(index, 0, length(space$spaces) - 1)) {
    refuse_field(index, "index", "that of a space")
  }
  list(index, decode_value(space$spaces[[index + 1L]], json[[2L]]))
}

#' @exportS3Method
check_value.gym_space_oneof <- function(space, value, path, call, bounds = FALSE) {
  n <- length(space$spaces)
  if (!is.list(value) || length(value) != 2L) {
    abort_space(space, value, "A value of OneOf is a list of an index and a value", call, path)
  }
  index <- value[[1L]]
  if (!is_number(index) || index != trunc(index) || index < 0 || index >= n) {
    problem <- paste("The index must be a whole number from 0 to", n - 1L)
    abort_space(space, value, problem, call, path_index(path, 0L))
  }
  check_value(space$spaces[[index + 1]], value[[2L]], path_index(path, 1L), call, bounds)
}

#' @exportS3Method
write_value.gym_space_oneof <- function(space, value) {
  index <- value[[1L]]
  json_array(c(whole_text(index), write_value(space$spaces[[index + 1]], value[[2L]])))
}

#' @exportS3Method
space_sample.gym_space_oneof <- function(space) {
  index <- sample.int(length(space$spaces), 1L) - 1L
  list(index, space_sample(space$spaces[[index + 1L]]))
}
