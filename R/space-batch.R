# Batches, the spaces of several values of a space: one for each sub-environment of a vector
# environment, or for each element of a Sequence or Graph. Numbers are stacked into one array, whose
# first dimension is the sub-environment. Tuple and Dict are stacked part by part. Texts are a
# character vector. Values without a fixed form are a list.

#' Make the space of several values of a space
#'
#' Like Gymnasium's `batch_space()`, but a MultiDiscrete or MultiBinary space keeps its kind, with
#' one dimension more. The bounds are those of one value, which R recycles in row-major order;
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
spread_bounds <- function(space) UseMethod("spread_bounds")

#' @exportS3Method
spread_bounds.default <- function(space) space

#' @exportS3Method
spread_bounds.gym_space_array <- function(space) {
  space$column <- NULL
  bounds <- intersect(c("low", "high", "nvec", "start"), names(space))
  space[bounds] <- lapply(space[bounds], rep, length.out = prod(space$shape))
  space
}

#' @exportS3Method
spread_bounds.gym_space_tuple <- function(space) {
  space$spaces <- lapply(space$spaces, spread_bounds)
  space
}

#' @exportS3Method
spread_bounds.gym_space_dict <- spread_bounds.gym_space_tuple

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

# Whole numbers as R's integers, `NULL` if they do not fit or if there is anything else.
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
#' All are checked together, because they usually fit. If they do not, they are checked one by one,
#' so that the error names the sub-environment and shows its value.
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
  # A number taken from an integer64 loses the class.
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

# JSON has the values of one sub-environment after the other, for any space.
write_batch <- function(space, values, n) {
  sub_envs <- lapply(seq_len(n), function(sub_env) batch_value(space, values, sub_env))
  json_array(vapply(sub_envs, write_value, "", space = space))
}
