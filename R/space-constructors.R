# Spaces made in R. The constructors check their arguments and make the same objects as new_space()
# makes from a server's description.

#' Make a space
#'
#' A space describes the actions or the observations of an environment. Use these functions for
#' environments written in R, see [gym_env()]. The spaces of Gymnasium's environments come from the
#' server and are the same objects. [space_sample()] draws a value of a space and lists the R values
#' for each kind; [space_contains()] checks whether a value belongs to a space.
#'
#' * `space_box()`: numbers between bounds, such as a position and a velocity.
#' * `space_discrete()`: one of `n` consecutive whole numbers, such as one of four directions.
#' * `space_multi_discrete()`: several such numbers.
#' * `space_multi_binary()`: numbers that are 0 or 1.
#' * `space_text()`: a string.
#' * `space_tuple()`, `space_dict()`: a value of each of several spaces, without and with names.
#'
#' @param low,high The bounds of the numbers of a Box, both included. A single number applies to all
#'   numbers of the Box. To give each number its own bound, use a vector, or an array if the shape
#'   has two dimensions or more. Use `-Inf` and `Inf` for no bound. The names of `low` (or of
#'   `high`, if `low` has none) are the names of the numbers: policies get them as column names of
#'   the observations, as in `observation[, "position"]`.
#' @param shape The size of each dimension: a vector of whole numbers, `integer()` for a single
#'   number without dimensions. For a Box the default, `NULL`, uses the shape of the bounds: one
#'   number if both are single numbers.
#' @param dtype The type of the numbers, a string. The default, `"float64"`, is R's own.
#'   `"float32"`, Gymnasium's own default, and `"float16"` are less precise, and bounds are rounded
#'   to that precision. The others are `"int8"` to `"int64"`, `"uint8"` to `"uint64"`, for whole
#'   numbers, and `"bool"`, for `TRUE` and `FALSE`.
#' @param n The number of values, a whole number of at least 1.
#' @param start The first value, a whole number. For `space_multi_discrete()`, a single number for
#'   all, or an own one for each, in the shape of `nvec`.
#' @param nvec The number of values of each number, a vector or an array of whole numbers of at
#'   least 1.
#' @param max_length,min_length The largest and smallest number of characters in a text.
#' @param characters The characters that a text may contain: a string of them, or a vector of
#'   strings of one character each. The default is the letters from a to z, upper or lower case, and
#'   the digits.
#' @param ... Spaces: without names for `space_tuple()`, with different names for `space_dict()`.
#' @return An object of class `gym_space`, a list with the elements that [space_sample()] lists for
#'   its kind. A Box whose bounds have names also has an element `names`. So does a MultiDiscrete
#'   space if `nvec` has names.
#' @section Errors: `gym_error_argument`, which names the argument and the value.
#' @export
#' @examples
#' # What MountainCar observes, and its three actions.
#' observations <- space_box(
#'   low = c(position = -1.2, velocity = -0.07), high = c(0.6, 0.07)
#' )
#' actions <- space_discrete(3)
#' space_contains(observations, c(0.5, 0.1))
#'
#' set.seed(1)
#' space_sample(observations)
#' space_sample(actions)
#'
#' # An image of 4 x 4 pixels, and a card with its suit.
#' space_box(0, 255, shape = c(4, 4), dtype = "uint8")
#' space_dict(rank = space_discrete(13, start = 1), suit = space_text(1, characters = "CDHS"))
space_box <- function(low, high, shape = NULL, dtype = "float64") {
  check_choice(dtype, c("float64", "float32", "float16", integer_dtypes, "bool"))
  check_bound(low, dtype)
  check_bound(high, dtype)
  if (is.null(shape)) shape <- array_shape(if (is_single(low)) high else low)
  check_shape(shape)
  shape <- as.integer(shape)
  low_values <- spread_bound(low, shape, dtype)
  high_values <- spread_bound(high, shape, dtype)
  crossed <- which(low_values > high_values)[1L]
  if (!is.na(crossed)) {
    must <- paste0("at most `high`, which is ", high_values[[crossed]])
    abort_argument(low_values[[crossed]], must, "low", rlang::current_env())
  }
  space <- make_space("Box", shape = shape, dtype = dtype, low = low_values, high = high_values)
  space$names <- names_of_numbers(low, high, shape)
  space
}

#' @rdname space_box
#' @export
space_discrete <- function(n, start = 0) {
  check_count(n, max = 2^53)
  check_count(start, min = -2^53, max = 2^53)
  make_space("Discrete", n = narrow_whole(n), start = narrow_whole(start), dtype = "int64")
}

#' @rdname space_box
#' @export
space_multi_discrete <- function(nvec, start = 0) {
  check_whole_array(nvec, min = 1)
  check_whole_array(start, min = -2^53)
  shape <- array_shape(nvec)
  if (length(start) != 1L && !identical(array_shape(start), shape)) {
    must <- paste("a single whole number or, as `nvec`,", wanted_shape(shape))
    abort_argument(start, must, "start", rlang::current_env())
  }
  space <- make_space(
    "MultiDiscrete", shape = shape, dtype = "int64", nvec = narrow_whole(row_major(nvec)),
    start = narrow_whole(rep_len(row_major(start), length(nvec)))
  )
  space$names <- names_of_numbers(nvec, start, shape)
  space
}

#' @rdname space_box
#' @export
space_multi_binary <- function(shape) {
  check_shape(shape)
  make_space("MultiBinary", shape = as.integer(shape), dtype = "int8")
}

#' @rdname space_box
#' @export
space_text <- function(max_length, min_length = 1, characters = c(letters, LETTERS, 0:9)) {
  check_count(max_length, min = 0)
  check_count(min_length, min = 0, max = max_length)
  make_space(
    "Text", dtype = NULL, min_length = as.integer(min_length),
    max_length = as.integer(max_length), characters = sorted_characters(characters)
  )
}

#' @rdname space_box
#' @export
space_tuple <- function(...) {
  spaces <- list(...)
  if (!is.null(names(spaces))) {
    abort_wrong("...", spaces, rlang::current_env(),
                "The spaces of a Tuple have no names: `space_dict()` makes a space of spaces with
                 names.")
  }
  check_spaces(spaces)
  make_space("Tuple", dtype = NULL, spaces = spaces)
}

#' @rdname space_box
#' @export
space_dict <- function(...) {
  spaces <- list(...)
  check_dots_named(spaces, "position = space_discrete(4)")
  check_spaces(spaces)
  names(spaces) <- enc2utf8(names(spaces) %||% character())
  make_space("Dict", dtype = NULL, spaces = spaces)
}

make_space <- function(kind, ...) structure(list(name = kind, ...), class = space_class(kind))

# Bounds ----------------------------------------------------------------------------

check_bound <- function(x, dtype, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  is_numbers <- typeof(x) %in% c("double", "integer", "logical") && !is.object(x)
  if (!is_numbers || !length(x) || anyNA(x)) {
    abort_argument(x, "numbers, none of them missing", arg, call)
  }
  unfit <- !fits_dtype(x, dtype)
  if (any(unfit)) {
    range <- dtype_ranges[[dtype]]
    whole <- if (!is.null(range)) paste0("a whole number", range_text(range[[1L]], range[[2L]]))
    must <- whole %||% "infinite, or a number that it can hold"
    abort_argument(x[unfit][[1L]], paste0(must, " where the dtype is \"", dtype, "\""), arg, call)
  }
}

# A single number applies to all numbers of a Box.
is_single <- function(x) length(x) == 1L && is.null(dim(x))

# Returns a bound for each number, row by row.
spread_bound <- function(x, shape, dtype, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (is_single(x)) {
    x <- rep_len(x, prod(shape))
  } else if (!identical(array_shape(x), shape)) {
    must <- paste("a single number or", wanted_shape(shape))
    abort_argument(x, must, arg, call)
  }
  round_to_dtype(as.double(row_major(x)), dtype)
}

# The names of the numbers of a space: those of its first argument or, without these, of its second.
names_of_numbers <- function(x, y, shape, x_arg = rlang::caller_arg(x),
                             y_arg = rlang::caller_arg(y), call = rlang::caller_env()) {
  names <- names(x) %||% names(y)
  if (is.null(names)) {
    return(NULL)
  }
  if (!identical(length(names), shape) || !all(nzchar(names)) || anyDuplicated(names)) {
    arg <- paste0("names(", if (is.null(names(x))) y_arg else x_arg, ")")
    abort_argument(names, "a name of its own for each number", arg, call)
  }
  if (!identical(names(y) %||% names, names)) {
    abort_argument(names(y), paste0("those of `", x_arg, "`"), paste0("names(", y_arg, ")"), call)
  }
  enc2utf8(names)
}

# Checks ----------------------------------------------------------------------------

check_shape <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!are_whole(x, 0, .Machine$integer.max)) {
    abort_argument(x, "a vector of whole numbers, one for each dimension", arg, call)
  }
}

check_whole_array <- function(x, min, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!is.numeric(x) || is.object(x) || !length(x) || !are_whole(as.vector(x), min, 2^53)) {
    abort_argument(x, paste0("an array of whole numbers", range_text(min, 2^53)), arg, call)
  }
}

# Returns the characters like the server: in one string, sorted by their code points.
sorted_characters <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  known <- if (rlang::is_string(x)) strsplit(enc2utf8(x), "")[[1L]] else enc2utf8(as.character(x))
  if (!is.character(x) || anyNA(x) || !length(known) || any(nchar(known) != 1L)) {
    must <- "a string, or a vector of strings of one character each"
    abort_argument(x, must, arg, call)
  }
  intToUtf8(sort(unique(utf8ToInt(paste(known, collapse = "")))))
}

check_spaces <- function(spaces, call = rlang::caller_env()) {
  for (i in seq_along(spaces)) check_space(spaces[[i]], names(spaces)[i] %||% paste0("..", i), call)
}

check_space <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!inherits(x, "gym_space")) {
    abort_wrong(arg, x, call, "`{arg}` must be a space, not {describe_argument(x)}.",
                i = "`space_box()`, `space_discrete()` and others make one.")
  }
}
