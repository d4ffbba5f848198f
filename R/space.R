# Spaces as R objects: the server's description of a space, with a small method for each kind that
# reads, checks, writes or draws values. The kinds are in the files space-*.R; this file has the
# shared part.

#' Make a space from the server's description
#' @noRd
new_space <- function(description) {
  kind <- if (is.list(description)) description$name
  if (!rlang::is_string(kind)) {
    refuse_field(description, "space", "a description with a name")
  }
  if (!kind %in% space_kinds) {
    gym_abort(paste0("This version of gym does not know the space '", kind, "'."),
              class = "gym_error_space", call = NULL)
  }
  if (kind == "Dict") {
    keys <- vapply(description$spaces, function(entry) entry$key, "")
    description$spaces <- stats::setNames(lapply(description$spaces, `[[`, "space"), keys)
  }
  for (name in intersect(names(field_readers), names(description))) {
    value <- description[[name]]
    if (!is.null(value)) description[[name]] <- field_readers[[name]](value)
  }
  counts <- description[["n"]] %||% description[["nvec"]]
  if (!is.null(counts)) {
    description$start <- description$start %||% (0L * counts)
    description$dtype <- description$dtype %||% "int64"
  }
  if (kind == "Sequence") description$stack <- isTRUE(description$stack)
  structure(description, class = space_class(kind))
}

space_kinds <- c("Box", "Discrete", "MultiDiscrete", "MultiBinary", "Text", "Tuple", "Dict",
                 "OneOf", "Sequence", "Graph")

# Infinite bounds are sent as +-1e100, which classic clients expect.
bound_from_json <- function(json) {
  bound <- as.numeric(numbers_from_json(json))
  bound[bound == 1e100] <- Inf
  bound[bound == -1e100] <- -Inf
  bound
}

# How the fields of a description are read from JSON. All others stay as they are.
field_readers <- list(
  shape = function(json) as.integer(unlist(json)),
  low = bound_from_json, high = bound_from_json,
  n = whole_from_json, nvec = whole_from_json, start = whole_from_json,
  spaces = function(json) lapply(json, new_space),
  space = new_space, node_space = new_space, edge_space = new_space
)

space_class <- function(kind) {
  array <- if (kind %in% c("Box", "MultiDiscrete", "MultiBinary")) "gym_space_array"
  c(paste0("gym_space_", tolower(kind)), array, "gym_space")
}

# As Gymnasium writes them. `$` is fast, because every step reads elements of spaces.
#' @export
`$.gym_space` <- function(x, name) {
  element <- .subset2(x, name)
  if (is.null(element)) {
    switch(
      name, sample = function() space_sample(x), contains = function(value) space_contains(x, value)
    )
  } else {
    element
  }
}

# In words ------------------------------------------------------------------------

# A space in words, without the brackets that format() adds.
space_label <- function(space) UseMethod("space_label")

#' @export
format.gym_space <- function(x, ..., width = 100L) {
  text <- shown_line(space_label(x), .Machine$integer.max)
  if (nchar(text) > width) text <- paste0(substr(text, 1L, width - 3L), "...")
  paste0("<", text, ">")
}

#' @export
print.gym_space <- function(x, ...) print_line(x)

# Values --------------------------------------------------------------------------

#' Convert a value of an answer to an R value
#' @param json The value as returned by [from_json()].
#' @noRd
decode_value <- function(space, json) UseMethod("decode_value")

#' Check a value's type and shape, including its parts
#'
#' The server checks whether a value lies inside the bounds, because it has the numbers in the
#' space's own dtype.
#' @param path The place of the value in the whole, such as `$position[2]`.
#' @param bounds Whether to check against the bounds, too.
#' @noRd
check_value <- function(space, value, path, call, bounds = FALSE) UseMethod("check_value")

#' Write a checked value as JSON
#' @noRd
write_value <- function(space, value) UseMethod("write_value")

#' Draw a value of a space, or check whether a value belongs to it
#'
#' `space_sample()` draws a value from R's generator, so [set.seed()] fixes it;
#' [env_action_space_sample()] draws on the server. `space_contains()` checks type, shape and bounds
#' of a value. Both work in R without a server.
#'
#' A space has the same parts as in Gymnasium, as list elements: `name` and `dtype`; for Discrete
#' `n` and `start`; for Box `shape`, `low` and `high` (its bounds, row by row); for MultiDiscrete
#' `shape`, `nvec` and `start`; for MultiBinary `shape`; for Text `min_length`, `max_length` and
#' `characters`; for Tuple, Dict and OneOf `spaces`, a list of spaces, with names for Dict; for
#' Sequence `space` and `stack`; for Graph `node_space` and `edge_space`. Bounds of 64-bit integers
#' are doubles, exact up to 2^53. The element `names` has the names of the numbers of an observation
#' (a Box of one dimension), of the parts of a Tuple or of a Discrete value, if there are any, see
#' [gym_make()].
#'
#' # Values in R
#'
#' * Discrete: a whole number.
#' * Box, MultiDiscrete, MultiBinary: a vector; an array if the shape has two dimensions or more.
#' * Text: a string.
#' * Tuple: a list, in order; names are ignored. Dict: a list with names.
#' * Sequence: a list of elements; a stacked one of numbers is an array whose first dimension is the
#'   element.
#' * Graph: a list of `nodes`, `edges` (arrays whose first dimension is the node or edge) and
#'   `edge_links` (a matrix of two columns, counting nodes from 0 as Python does); `edges` and
#'   `edge_links` are `NULL` if there are none.
#' * OneOf: a list of the index of the space, counted from 0, and the value.
#'
#' The values of several sub-environments are put together with the sub-environment first: a vector
#' of whole numbers or of strings, an array with an additional dimension, a Tuple or Dict of such
#' parts, otherwise a list; see [env_reset()].
#'
#' Whole numbers are integer if they all fit, and double up to 2^53 - 1. A number beyond is an
#' error, as is an integer64 of the package bit64; `bit64::as.double.integer64()` converts it. A Box
#' of dtype bool is logical. For Discrete, MultiDiscrete and MultiBinary, `TRUE` and `FALSE` count
#' as 1 and 0.
#'
#' # The place of a wrong value
#'
#' Errors of class `gym_error_space` name the place inside a nested value, such as `$position[2]`:
#' the element `position`, and in it the number with index 2. Indices start at 0, as on the server
#' and in Python, so that a place has one name everywhere. In R it is `value$position[3]`. Only the
#' words "Sub-environment 3" before a message count from 1, like the argument `which` of
#' [env_step()].
#'
#' The distributions are Gymnasium's: uniform between two bounds, exponential with a single one,
#' normal without any; the length of a sequence is geometric.
#'
#' `space$sample()` and `space$contains(value)` are the same functions, named as in Gymnasium.
#'
#' @param space A space, such as `gym_make("CartPole-v1")$action_space`.
#' @param value The value to check: any R object.
#' @return `space_sample()` returns a value as listed above, `space_contains()` `TRUE` or `FALSE`.
#' @section Errors: `gym_error_argument` if `space` is not a space.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1")
#' env$action_space
#' set.seed(1)
#' space_sample(env$action_space)
#' space_contains(env$action_space, 1)
#' space_contains(env$action_space, 2)
#' space_contains(env$observation_space, c(0, 0, 0, 0))
#' env$observation_space$high
#' env$close()
space_sample <- function(space) UseMethod("space_sample")

#' @export
space_sample.default <- function(space) check_space(space, call = rlang::caller_env())

#' @rdname space_sample
#' @export
space_contains <- function(space, value) {
  check_space(space)
  fits_space(space, value, bounds = TRUE)
}

fits_space <- function(space, value, bounds = FALSE) {
  tryCatch(
    {
      check_value(space, value, "", NULL, bounds)
      TRUE
    },
    gym_error_space = function(cnd) FALSE
  )
}

# Places inside a value --------------------------------------------------------------

path_key <- function(path, key) {
  syntactic <- grepl("^[A-Za-z.][A-Za-z0-9._]*$", key)
  paste0(path, "$", if (syntactic) key else paste0("`", key, "`"))
}

# `index` counts from 0; one number for each dimension.
path_index <- function(path, index) {
  paste0(path, paste0("[", index, "]", recycle0 = TRUE, collapse = ""))
}
