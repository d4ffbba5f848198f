# The steps of a rollout as arrays by time, for people who write learners.

#' Put the steps of batches into arrays by time and sub-environment
#'
#' The episodes of a sub-environment follow one another. If it played fewer steps than another, its
#' arrays end with `NA`.
#' @inheritParams steps_table
#' @return An object of class `gym_arrays`, a list of arrays.
#' @noRd
steps_arrays <- function(batches, episodes, vector_env, several = FALSE,
                         next_observation = FALSE) {
  steps <- unlist(lapply(batches, function(batch) batch$steps), recursive = FALSE)
  each <- function(name) lapply(steps, function(step) step[[name]])
  row <- step_rows(batches)
  cells <- cells_in_time(row, episodes, lengths(each("at")))
  observed <- vector_env$observation_space
  arrays <- list(
    observation = array_in_time(observed, each("observation"), cells),
    action = array_in_time(vector_env$action_space, each("action"), cells),
    reward = numbers_in_time(as.numeric(unlist(each("reward"))), cells),
    terminated = numbers_in_time(unlist(each("terminated")), cells),
    truncated = numbers_in_time(unlist(each("truncated")), cells),
    candidate = if (several) numbers_in_time(episodes$candidate[row], cells),
    episode = numbers_in_time(episodes$episode[row], cells),
    next_observation = if (next_observation) {
      array_in_time(observed, each("next_observation"), cells)
    }
  )
  # An episode that `max_steps` cuts off is truncated in its last step.
  arrays$truncated[cells$last] <- episodes$truncated
  structure(arrays[lengths(arrays) > 0L], class = "gym_arrays")
}

#' Find the place of each step in arrays by time and sub-environment
#' @param row The row of its episode in the table of episodes, for each step.
#' @param counts The number of steps taken together, in the order of play.
#' @return A list: `dim`, the numbers of times and sub-environments; `at`, the place of each step,
#'   one sub-environment after the other; `to`, the last step of those taken together; `counts`; and
#'   `last`, the places of the episodes' last steps.
#' @noRd
cells_in_time <- function(row, episodes, counts) {
  ended <- stats::ave(episodes$length, episodes$sub_env, FUN = cumsum)
  step <- integer(length(row))
  step[order(row, method = "radix")] <- sequence(episodes$length)
  time <- as.numeric(max(ended))
  before <- (episodes$sub_env - 1) * time + ended - episodes$length
  list(
    dim = c(time, max(episodes$sub_env)), at = before[row] + step, to = cumsum(counts),
    counts = counts, last = before + episodes$length
  )
}

numbers_in_time <- function(values, cells) {
  numbers <- rep(values[NA_integer_], prod(cells$dim))
  numbers[cells$at] <- values
  with_time(numbers, cells)
}

#' Put batches of values into an array by time and sub-environment
#'
#' Each batch is copied directly to its place, without another large copy.
#' @param values A list of batches, one for each time that steps were taken together.
#' @return An array; a list of arrays for the parts of a Tuple or Dict.
#' @noRd
array_in_time <- function(space, values, cells) {
  if (has_parts(space)) {
    parts <- lapply(seq_along(space$spaces), function(i) {
      lapply(values, function(batch) in_order(space, batch)[[i]])
    })
    names(parts) <- names(values[[1L]])
    return(map_parts(space, array_in_time, parts, list(cells)))
  }
  numbers <- matrix(
    vector(typeof(values[[1L]]), 1L)[2L], prod(cells$dim), prod(space$shape)
  )
  for (i in seq_along(values)) {
    at <- cells$to[[i]] - cells$counts[[i]] + seq_len(cells$counts[[i]])
    numbers[cells$at[at], ] <- values[[i]]
  }
  with_time(numbers, cells, space)
}

with_time <- function(numbers, cells, space = NULL) {
  dim(numbers) <- c(cells$dim, space$shape)
  rank <- length(space$shape)
  parts <- if (rank == 1L) list(space$names) else vector("list", rank)
  dimnames(numbers) <- c(list(time = NULL, sub_env = NULL), parts)
  numbers
}

# Checks before play whether the steps fit into arrays.
check_fits_arrays <- function(vector_env) {
  for (what in c("observation", "action")) {
    space <- vector_env[[paste0(what, "_space")]]
    if (!fits_arrays(space)) {
      gym_abort(
        c(paste0("`steps = \"arrays\"` keeps values of one shape, and the ", what, "s of ",
                 environment_label(vector_env), " are of ", format(space), "."),
          i = "`steps = TRUE` keeps them in a table."),
        class = "gym_error_argument", argument = "steps", value = "arrays",
        call = vector_env$call
      )
    }
  }
}

fits_arrays <- function(space) {
  if (has_parts(space)) {
    all(vapply(space$spaces, fits_arrays, NA))
  } else {
    is_stackable(space) || inherits(space, "gym_space_text")
  }
}

# Printing --------------------------------------------------------------------------

#' @export
format.gym_arrays <- function(x, ...) {
  shape <- dim(x$reward)
  c(
    paste0("<gym_arrays: ", count_of(shape[[1L]], "time"), ", ",
           count_of(shape[[2L]], "sub-environment"), ">"),
    paste0("  ", array_lines(unclass(x)))
  )
}

#' @export
print.gym_arrays <- function(x, ...) {
  writeLines(format(x))
  invisible(x)
}

array_lines <- function(arrays) {
  flat <- flat_arrays(arrays)
  kinds <- vapply(flat, function(x) if (is.object(x)) class(x)[[1L]] else typeof(x), "")
  shapes <- vapply(flat, function(x) shape_text(dim(x)), "")
  paste(format(paste0(names(flat), ":")), kinds, shapes)
}

# The arrays of Tuple and Dict, named by their parts, such as `observation$position`.
flat_arrays <- function(arrays, prefix = "") {
  parts <- names(arrays) %||% seq_along(arrays)
  each <- lapply(seq_along(arrays), function(i) {
    name <- paste0(prefix, parts[[i]])
    if (is.list(arrays[[i]])) {
      flat_arrays(arrays[[i]], paste0(name, "$"))
    } else {
      stats::setNames(arrays[i], name)
    }
  })
  unlist(each, recursive = FALSE)
}
