# Sequence: any number of elements of another space. The functions for several elements, which Graph
# also uses, stack elements that are numbers into one array, like the values of sub-environments.
# Other elements are a list.

is_stackable <- function(space) {
  inherits(space, "gym_space_array") || inherits(space, "gym_space_discrete")
}

decode_stack <- function(space, json) {
  if (is_stackable(space)) {
    shape <- c(length(json), space$shape)
    shape_values(check_numbers(decode_numbers(space$dtype, json), space$dtype, shape), shape)
  } else {
    lapply(json, decode_value, space = space)
  }
}

check_stack <- function(space, value, path, call, bounds) {
  if (is_stackable(space)) {
    check_value(batch_space(space, stack_length(value)), value, path, call, bounds)
  } else {
    check_elements(space, value, path, call, bounds)
  }
}

check_elements <- function(space, value, path, call, bounds) {
  if (!is.list(value)) {
    abort_space(space, value, "Several values of this space are a list", call, path)
  }
  for (i in seq_along(value)) {
    check_value(space, value[[i]], path_index(path, i - 1L), call, bounds)
  }
}

stack_length <- function(value) {
  axes <- dim(value)
  if (is.null(axes)) length(value) else axes[[1L]]
}

write_stack <- function(space, value) {
  if (is_stackable(space)) {
    write_value(batch_space(space, stack_length(value)), value)
  } else {
    write_elements(space, value)
  }
}

write_elements <- function(space, value) {
  json_array(vapply(unname(value), write_value, "", space = space))
}

sample_stack <- function(space, n) {
  values <- lapply(seq_len(n), function(i) space_sample(space))
  if (is_stackable(space)) stack_values(space, values) else values
}

stack_values <- function(space, values) {
  rank <- length(space$shape)
  if (length(values) == 1L && rank <= 1L && is.numeric(value <- values[[1L]])) {
    # The usual batch of one, in a fifth of the time.
    labels <- names(value)
    value <- as.vector(value)
    if (rank) value <- matrix(value, 1L, dimnames = if (length(labels)) list(NULL, labels))
    return(value)
  }
  flat <- lapply(values, row_major)
  numbers <- if (length(flat)) unlist(flat) else decode_numbers(space$dtype, list())
  stacked <- shape_values(numbers, c(length(values), space$shape))
  if (length(space$shape) == 1L && length(values)) {
    colnames(stacked) <- names(values[[1L]])
  }
  stacked
}

# Sequence --------------------------------------------------------------------------

#' @exportS3Method
init_space.gym_space_sequence <- function(space) {
  space$space <- new_space(space$space)
  space$stack <- isTRUE(space$stack)
  space
}

#' @exportS3Method
space_label.gym_space_sequence <- function(space) {
  paste0("Sequence of ", space_label(space$space), if (space$stack) ", stacked")
}

#' @exportS3Method
decode_value.gym_space_sequence <- function(space, json) {
  check_list(json, length(json), "Sequence")
  if (space$stack) {
    decode_stack(space$space, json)
  } else {
    lapply(json, decode_value, space = space$space)
  }
}

#' @exportS3Method
check_value.gym_space_sequence <- function(space, value, path, call, bounds = FALSE) {
  check <- if (space$stack) check_stack else check_elements
  check(space$space, value, path, call, bounds)
}

#' @exportS3Method
write_value.gym_space_sequence <- function(space, value) {
  if (space$stack) write_stack(space$space, value) else write_elements(space$space, value)
}

#' @exportS3Method
space_sample.gym_space_sequence <- function(space) {
  n <- 1L + stats::rgeom(1L, 0.25)
  if (space$stack) {
    sample_stack(space$space, n)
  } else {
    lapply(seq_len(n), function(i) space_sample(space$space))
  }
}
