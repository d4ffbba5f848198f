# Put batches of values, one for each sub-environment, together and take them apart. Numbers are an
# array whose first dimension is the sub-environment (a vector for single numbers), texts a
# character vector, values of Tuple and Dict a list of such parts, other values a list.

has_parts <- function(space) {
  inherits(space, "gym_space_tuple") || inherits(space, "gym_space_dict")
}

# Calls a function for each part of a Tuple or Dict, with that part of `values`. The list for a
# Tuple keeps its names.
map_parts <- function(space, part, values, ...) {
  parts <- Map(part, unname(space$spaces), unname(values), ...)
  names(parts) <- names(space$spaces) %||% names(values)
  parts
}

#' Make a batch of single values
#' @param values A list of values of the space.
#' @noRd
batch_of <- function(space, values) {
  if (is_stackable(space)) {
    stack_values(space, values)
  } else if (inherits(space, "gym_space_text")) {
    as.character(values)
  } else if (has_parts(space)) {
    each <- lapply(seq_along(space$spaces), function(i) lapply(values, function(v) v[[i]]))
    names(each) <- if (length(values)) names(values[[1L]])
    map_parts(space, batch_of, each)
  } else {
    values
  }
}

#' Take one value from a batch
#' @noRd
batch_value <- function(space, batch, i) {
  if (has_parts(space)) {
    map_parts(space, batch_value, in_order(space, batch), i)
  } else if (is_stackable(space)) {
    value <- rows_of(batch, i)
    labels <- if (length(space$shape) == 1L) colnames(value)
    dim(value) <- if (length(space$shape) > 1L) dim(value)[-1L]
    names(value) <- labels
    value
  } else {
    batch[[i]]
  }
}

#' Take some values of a batch as a smaller batch
#' @param i Their numbers, with or without repetition.
#' @noRd
batch_rows <- function(space, batch, i) {
  if (has_parts(space)) {
    map_parts(space, batch_rows, in_order(space, batch), list(i))
  } else {
    rows_of(batch, i)
  }
}

rows_of <- function(x, i) {
  shape <- dim(x)
  if (is.null(shape)) {
    x[i]
  } else if (length(shape) == 2L) {
    x[i, , drop = FALSE]
  } else {
    dim(x) <- c(shape[[1L]], prod(shape[-1L]))
    x <- x[i, , drop = FALSE]
    dim(x) <- c(length(i), shape[-1L])
    x
  }
}

# The parts in the order of the space: a policy may return those of a Dict in any order.
in_order <- function(space, parts) {
  keys <- names(space$spaces)
  if (is.null(keys) || is.null(names(parts))) parts else parts[match(keys, enc2utf8(names(parts)))]
}

#' Concatenate several batches
#' @param each A list of batches, at least one.
#' @noRd
bind_batches <- function(space, each) {
  if (has_parts(space)) {
    parts <- lapply(seq_along(space$spaces), function(i) {
      lapply(each, function(batch) in_order(space, batch)[[i]])
    })
    names(parts) <- names(each[[1L]])
    map_parts(space, bind_batches, parts)
  } else if (!is_stackable(space)) {
    do.call(c, each)
  } else if (is.null(dim(each[[1L]]))) {
    unlist(each)
  } else {
    shape <- dim(each[[1L]])[-1L]
    rows <- function(batch) matrix(batch, dim(batch)[[1L]], prod(shape))
    flat <- do.call(rbind, lapply(each, rows))
    dim(flat) <- c(nrow(flat), shape)
    if (length(shape) == 1L) colnames(flat) <- colnames(each[[1L]])
    flat
  }
}

#' Replace some values of a batch
#' @param n The number of values in the batch.
#' @param i The numbers of those to replace.
#' @param values The batch of their replacements.
#' @noRd
replace_rows <- function(space, batch, n, i, values) {
  if (!is_stackable(space) || is.object(batch) || is.object(values)) {
    place <- seq_len(n)
    place[i] <- n + seq_along(i)
    return(batch_rows(space, bind_batches(space, list(batch, values)), place))
  }
  shape <- dim(batch)
  if (is.null(shape)) {
    batch[i] <- values
  } else {
    if (length(shape) > 2L) dim(batch) <- c(shape[[1L]], prod(shape[-1L]))
    batch[i, ] <- values
    if (length(shape) > 2L) dim(batch) <- shape
  }
  batch
}

#' Draw a batch of values
#' @noRd
sample_batch <- function(space, n) {
  if (inherits(space, "gym_space_discrete") && is.integer(space$n) && is.integer(space$start)) {
    space$start + sample.int(space$n, n, replace = TRUE) - 1L
  } else if (is_stackable(space)) {
    bounds <- space_bounds(space)
    shape_values(
      draw_numbers(space$dtype, rep(bounds$low, n), rep(bounds$high, n)), c(n, space$shape)
    )
  } else {
    batch_of(space, replicate(n, space_sample(space), simplify = FALSE))
  }
}

#' Put the numbers of each value of a batch into a row of a matrix
#' @return A matrix with numbers in row-major order in each row, as Gymnasium flattens them.
#' @noRd
number_rows <- function(batch) {
  shape <- dim(batch)
  if (length(shape) == 2L) {
    batch
  } else if (is.null(shape)) {
    matrix(batch, ncol = 1L)
  } else {
    t(matrix(row_major(batch), ncol = shape[[1L]]))
  }
}

# Accepts what is almost a batch, such as a vector for a matrix of one column.
as_batch <- function(space, actions) {
  if (has_parts(space)) {
    complete <- is.list(actions) && length(actions) == length(space$spaces)
    return(if (complete) map_parts(space, as_batch, in_order(space, actions)) else actions)
  }
  # For actions of one number each, a vector and a matrix of one column mean the same.
  if (is_stackable(space) && prod(space$shape) == 1 && is.atomic(actions) &&
        length(actions) > 0L && length(actions) == stack_length(actions)) {
    if (is.logical(actions) && !identical(space$dtype, "bool")) actions <- as.integer(actions)
    dim(actions) <- if (length(space$shape)) c(length(actions), space$shape)
  }
  actions
}
