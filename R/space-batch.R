# A batch has several values of a space: one for each sub-environment of a vector environment, or
# for each element of a Sequence or Graph. This file has the spaces of batches, and functions for
# their values. Numbers are stacked into one array, whose first dimension is the sub-environment.
# Tuple and Dict are stacked part by part. Texts are a character vector. Values without a fixed form
# are a list.

#' Make the space of several values of a space
#'
#' Like Gymnasium's `batch_space()`, but a MultiDiscrete or MultiBinary space keeps its kind, with
#' one dimension more. The batch has the bounds of one value, which R recycles in row-major order;
#' [spread_bounds()] repeats them for each value.
#' @param n The number of values.
#' @noRd
batch_space <- function(space, n) UseMethod("batch_space")

#' @exportS3Method
batch_space.default <- function(space, n) make_space("Tuple", spaces = rep(list(space), n))

#' @exportS3Method
batch_space.gym_space_array <- function(space, n) {
  space$column <- identical(space$shape, 1L)
  space$shape <- c(as.integer(n), space$shape)
  space
}

#' @exportS3Method
batch_space.gym_space_discrete <- function(space, n) {
  batch <- list(name = "MultiDiscrete", shape = as.integer(n), dtype = space$dtype,
                nvec = space$n, start = space$start)
  structure(batch, class = c("gym_space_discretes", space_class("MultiDiscrete")))
}

#' @exportS3Method
batch_space.gym_space_text <- function(space, n) {
  texts <- batch_space.default(space, n)
  class(texts) <- c("gym_space_texts", class(texts))
  texts
}

#' @exportS3Method
batch_space.gym_space_tuple <- function(space, n) {
  space$spaces <- lapply(space$spaces, batch_space, n = n)
  space
}

#' @exportS3Method
batch_space.gym_space_dict <- batch_space.gym_space_tuple

#' Give a batch a bound for each of its numbers
#' @noRd
spread_bounds <- function(space) {
  if (has_parts(space)) {
    space$spaces <- lapply(space$spaces, spread_bounds)
  } else if (inherits(space, "gym_space_array")) {
    space$column <- NULL
    bounds <- intersect(c("low", "high", "nvec", "start"), names(space))
    space[bounds] <- lapply(space[bounds], rep, length.out = prod(space$shape))
  }
  space
}

# Several Discrete --------------------------------------------------------------------

#' @exportS3Method
check_value.gym_space_discretes <- function(space, value, path, call, bounds = FALSE) {
  if (is.logical(value)) {
    # As for a single Discrete: `observation[, 3] > 0` is a vector of actions.
    storage.mode(value) <- "integer"
  }
  quick <- !bounds && length(value) == space$shape && is.null(dim(value)) &&
    !is.null(small_integers(value))
  if (!quick) check_value.gym_space_array(space, value, path, call, bounds)
}

# Converts whole numbers to R's integers. `NULL` if a number does not fit or is not whole.
small_integers <- function(x) {
  if (is.object(x)) {
    NULL
  } else if (is.integer(x) || is.logical(x)) {
    if (!anyNA(x)) as.integer(x)
  } else if (is.double(x) && within_integer(x)) {
    whole <- as.integer(x)
    if (all(whole == x)) whole
  }
}

# Write numbers that fit R's integers as int32: writing int64 takes ten times as long.
#' @exportS3Method
to_tensors.gym_space_discretes <- function(space, value, name, call, path = "") {
  unsigned <- space$dtype == "uint64"
  whole <- if (!unsigned) small_integers(value)
  if (is.null(whole)) {
    space$dtype <- if (unsigned) "uint64" else "int64"
    return(to_tensors.default(space, value, name, call, path))
  }
  bytes <- writeBin(whole, raw(), endian = "little")
  stats::setNames(list(list(dtype = "I32", shape = space$shape, bytes = bytes)), name)
}

# Several texts -----------------------------------------------------------------------

#' @exportS3Method
decode_value.gym_space_texts <- function(space, json) {
  check_list(json, length(space$spaces), "Text in all sub-environments")
  vapply(json, check_text, "", USE.NAMES = FALSE)
}

#' @exportS3Method
check_value.gym_space_texts <- function(space, value, path, call, bounds = FALSE) {
  if (is.character(value) && is.null(dim(value))) value <- as.list(value)
  check_value.gym_space_tuple(space, value, path, call, bounds)
}

#' @exportS3Method
space_sample.gym_space_texts <- function(space) {
  as.character(unlist(space_sample.gym_space_tuple(space)))
}

#' @exportS3Method
from_tensors.gym_space_texts <- function(space, name, answer) {
  vapply(part_names(space, name), function(part) check_text(answer$texts[[part]]), "",
         USE.NAMES = FALSE)
}

#' @exportS3Method
to_tensors.gym_space_texts <- function(space, value, name, call, path = "") {
  stats::setNames(as.list(enc2utf8(as.character(value))), part_names(space, name))
}

# Values of a batch -------------------------------------------------------------------

#' Check a value for each sub-environment
#'
#' Values usually fit, so this first checks all together. If one does not fit, it checks them one by
#' one, so that the error names the sub-environment and shows its value.
#' @param space The space of one sub-environment.
#' @param batch The space of all `n`.
#' @param sub_envs Their numbers; `NULL` for 1 to `n`.
#' @param bounds Whether to check against the bounds, too.
#' @noRd
check_batch <- function(space, batch, values, n, call, sub_envs = NULL, bounds = FALSE) {
  if (fits_space(batch, values, bounds)) {
    return(invisible())
  }
  given <- batch_length(space, values)
  if (!is.na(given) && given != n) {
    problem <- paste0("One value for each of the sub-environments is needed: ", n, ", not ", given)
    abort_space(batch, values, problem, call)
  }
  # Selecting a number of an integer64 drops the class, so check such a batch only as a whole.
  if (!is.na(given) && !is_integer64(values)) {
    for (i in seq_len(n)) {
      tryCatch(
        check_value(space, batch_value(space, values, i), "", call, bounds),
        gym_error_space = function(cnd) {
          cnd$sub_env <- if (is.null(sub_envs)) i else sub_envs[[i]]
          cnd$message <- paste0("Sub-environment ", cnd$sub_env, ": ", cnd$message)
          rlang::cnd_signal(cnd)
        }
      )
    }
  }
  check_value(batch, values, "", call, bounds)
}

#' Count the values of a batch
#' @return A number; `NA` for anything that does not have the form of several values of the space.
#' @noRd
batch_length <- function(space, values) UseMethod("batch_length")

#' @exportS3Method
batch_length.default <- function(space, values) {
  if (is.list(values)) length(values) else NA_integer_
}

#' @exportS3Method
batch_length.gym_space_text <- function(space, values) {
  if (is.character(values) || is.list(values)) length(values) else NA_integer_
}

#' @exportS3Method
batch_length.gym_space_discrete <- function(space, values) {
  if (is.atomic(values) && is.null(dim(values))) length(values) else NA_integer_
}

#' @exportS3Method
batch_length.gym_space_array <- function(space, values) {
  shape <- if (is.atomic(values)) value_shape(values, batch_space(space, 1L))
  if (identical(shape[-1L], space$shape)) shape[[1L]] else NA_integer_
}

#' @exportS3Method
batch_length.gym_space_tuple <- function(space, values) {
  keys <- names(space$spaces) %||% seq_along(space$spaces)
  if (!is.list(values) || length(values) != length(keys)) {
    return(NA_integer_)
  }
  if (is.character(keys)) values <- values[match(keys, enc2utf8(as.character(names(values))))]
  counts <- unique(unlist(Map(batch_length, unname(space$spaces), unname(values))))
  if (length(counts) == 1L) counts else NA_integer_
}

#' @exportS3Method
batch_length.gym_space_dict <- batch_length.gym_space_tuple

# In JSON, a batch is an array with the value of each sub-environment, for any space.
write_batch <- function(space, values, n) {
  sub_envs <- lapply(seq_len(n), function(sub_env) batch_value(space, values, sub_env))
  json_array(vapply(sub_envs, write_value, "", space = space))
}

# Putting batches together and taking them apart -------------------------------------------------

# A batch of single numbers is a vector. See the top of this file for the other forms.

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
#' @param i The numbers of the values, with or without repetition.
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

# Sorts parts in the order of the space, because a policy may return the parts of a Dict in any
# order.
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
#' @param i The numbers of the values to replace.
#' @param values A batch of the new values.
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

# Converts what is almost a batch to a batch, such as a vector to a matrix of one column.
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
