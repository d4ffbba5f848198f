# Spaces as R objects: what the server says of a space, with one small method
# per kind for reading, writing, drawing and checking its values.

#' Make a space from the server's description
#' @noRd
new_space <- function(description) {
  kind <- description$name
  space <- structure(
    description,
    class = c(paste0("gym_space_", tolower(kind)), "gym_space")
  )
  init_space(space)
}

init_space <- function(space) UseMethod("init_space")

#' @exportS3Method
init_space.default <- function(space) {
  gym_abort(
    paste0("This version of gym does not know the space '", space$name, "'."),
    class = "gym_error_space"
  )
}

#' @exportS3Method
init_space.gym_space_discrete <- function(space) {
  space$start <- space$start %||% 0L
  space
}

#' @exportS3Method
init_space.gym_space_box <- function(space) {
  space$shape <- as.integer(unlist(space$shape))
  space$low <- bound_from_json(space$low)
  space$high <- bound_from_json(space$high)
  space
}

# Infinite bounds travel as +-1e100, which classic clients expect.
bound_from_json <- function(bound) {
  bound <- numbers_from_json(bound)
  bound[bound == 1e100] <- Inf
  bound[bound == -1e100] <- -Inf
  bound
}

#' @export
format.gym_space_discrete <- function(x, ...) {
  start <- if (x$start != 0) paste0(" from ", x$start)
  paste0("<Discrete ", x$n, start, ">")
}

#' @export
format.gym_space_box <- function(x, ...) {
  paste0("<Box ", x$dtype, " [", paste(x$shape, collapse = ", "), "]>")
}

#' @export
print.gym_space <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

# Reading ---------------------------------------------------------------------

#' Turn a value from the wire into an R value
#' @noRd
decode_value <- function(space, json) UseMethod("decode_value")

#' @exportS3Method
decode_value.gym_space_discrete <- function(space, json) {
  integers_from_json(list(json))
}

#' @exportS3Method
decode_value.gym_space_box <- function(space, json) {
  shape <- space$shape
  rank <- length(shape)
  values <- if (space$dtype %in% integer_dtypes) {
    integers_from_json(json)
  } else {
    as.numeric(numbers_from_json(json))
  }
  if (rank > 1L) aperm(array(values, rev(shape))) else values
}

integer_dtypes <- c(
  "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool"
)

# Integers are integer where they fit, double up to 2^53, integer64 beyond.
integers_from_json <- function(elements) {
  integers <- unlist(elements, use.names = FALSE)
  if (is.character(integers)) {
    digits <- rapply(as.list(elements), integer_digits, how = "unlist")
    return(integers_beyond_double(digits))
  }
  if (is.logical(integers)) {
    return(as.integer(integers))
  }
  if (is.null(integers)) integer() else integers
}

integer_digits <- function(x) if (is.character(x)) x else sprintf("%.0f", x)

integers_beyond_double <- function(digits,
                                   has_bit64 = requireNamespace("bit64", quietly = TRUE)) {
  if (!has_bit64) {
    gym_abort(
      c(
        paste0("The integer ", digits[which.max(nchar(digits))], " is beyond 2^53, ",
               "where R's numbers have gaps."),
        i = "With the package bit64 installed it arrives exactly: install.packages(\"bit64\")."
      ),
      class = "gym_error_space"
    )
  }
  bit64::as.integer64(digits)
}

# Writing ---------------------------------------------------------------------

#' Write an R value as JSON for a space
#'
#' Checks type and shape; whether the value lies inside the bounds is for the
#' server to say.
#' @noRd
encode_value <- function(space, value, call) UseMethod("encode_value")

#' @exportS3Method
encode_value.gym_space_discrete <- function(space, value, call) {
  if (is.logical(value)) {
    # As R counts, and Python.
    value <- as.integer(value)
  }
  if (length(value) != 1L || !is.numeric(value) || !is.finite(value) || value != trunc(value)) {
    abort_space(space, value, "A discrete action is one whole number", call)
  }
  json_number(value)
}

#' @exportS3Method
encode_value.gym_space_box <- function(space, value, call) {
  if (!is.numeric(value)) {
    abort_space(space, value, "An action of a Box is numeric", call)
  }
  if (anyNA(value)) {
    abort_space(space, value, "An action of a Box has no missing values", call)
  }
  shape <- space$shape
  if (!identical(value_shape(value, shape), shape)) {
    wanted <- if (length(shape) <= 1L) {
      paste("of length", prod(shape))
    } else {
      paste("an array with dim", paste(shape, collapse = " x "))
    }
    abort_space(space, value, paste("The action must be", wanted), call)
  }
  elements <- json_number(row_major(value))
  if (length(shape) == 0L) elements else json_nested(elements, shape)
}

# A vector without dim is one-dimensional, or a scalar where the space is one.
value_shape <- function(value, shape) {
  if (!is.null(dim(value))) {
    dim(value)
  } else if (length(value) == 1L && length(shape) == 0L) {
    integer()
  } else {
    length(value)
  }
}

# Drawing ---------------------------------------------------------------------

#' Draw a value of a space from R's generator
#'
#' The distributions are Gymnasium's: uniform between two bounds, exponential
#' from a single one, normal without any.
#' @noRd
space_sample <- function(space) UseMethod("space_sample")

#' @exportS3Method
space_sample.gym_space_discrete <- function(space) {
  as.integer(space$start) + sample.int(space$n, 1L) - 1L
}

#' @exportS3Method
space_sample.gym_space_box <- function(space) {
  if (space$dtype %in% integer_dtypes) {
    # A whole number stands for all that is rounded down to it: the highest, too.
    drawn <- mapply(draw_between, space$low, space$high + 1)
    values <- pmin(floor(drawn), space$high)
  } else {
    values <- mapply(draw_between, space$low, space$high)
  }
  if (length(space$shape) > 1L) aperm(array(values, rev(space$shape))) else values
}

draw_between <- function(low, high) {
  if (is.finite(low) && is.finite(high)) {
    stats::runif(1L, low, high)
  } else if (is.finite(low)) {
    low + stats::rexp(1L)
  } else if (is.finite(high)) {
    high - stats::rexp(1L)
  } else {
    stats::rnorm(1L)
  }
}
