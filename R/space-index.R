# Numbers the values of a space 1, 2, ..., for tables with a row for each value. This works for a
# Discrete space, and for spaces that combine several.

#' Number the values of a space
#'
#' @return A list: `count`, how many values the space has; `index`, a function of a batch and the
#'   count of its values, which returns the number of each value, from 1, and `NA` for a value
#'   outside the space; and `value`, a function of such numbers, which returns a batch of the
#'   values. `NULL` if the values cannot be counted.
#' @noRd
space_index <- function(space) UseMethod("space_index")

#' @exportS3Method
space_index.default <- function(space) NULL

#' @exportS3Method
space_index.gym_space_discrete <- function(space) {
  start <- space$start
  count <- as.double(space$n)
  list(
    count = count,
    index = function(batch, n) as.integer(beyond_start(batch, start, count)) + 1L,
    value = function(number) as.integer(number - 1L + start)
  )
}

# How far numbers are from the first of `n` consecutive whole numbers; NA for any other number.
beyond_start <- function(x, start, n) {
  beyond <- if (is.numeric(x) || is.logical(x)) x - start else rep(NA, length(x))
  beyond[is.na(beyond) | beyond < 0 | beyond >= n | beyond != trunc(beyond)] <- NA
  beyond
}

#' @exportS3Method
space_index.gym_space_multidiscrete <- function(space) {
  digits_index(as.double(space$nvec), as.double(space$start %||% 0), space$shape)
}

#' @exportS3Method
space_index.gym_space_multibinary <- function(space) {
  digits_index(rep(2, prod(space$shape)), 0, space$shape)
}

# The value is a number of several digits. The last digit changes first, as in NumPy's arrays.
digits_index <- function(nvec, start, shape) {
  rank <- length(shape)
  weights <- rev(cumprod(c(1, rev(nvec))))[-1L]
  list(
    count = prod(nvec),
    index = function(batch, n) {
      if (length(batch) != n * length(nvec)) {
        return(rep(NA_integer_, n))
      }
      # `nvec` is row by row, so sort the batch in the same way.
      if (rank > 1L) batch <- aperm(batch, c(1L, rev(seq_len(rank)) + 1L))
      first <- rep(start, each = if (length(start) > 1L) n else 1L)
      digits <- beyond_start(as.vector(batch), first, rep(nvec, each = n))
      as.integer(matrix(digits, n) %*% weights + 1)
    },
    value = function(number) {
      # A column for each value.
      digits <- outer(weights, number - 1, function(weight, beyond) beyond %/% weight) %% nvec
      shape_values(as.integer(digits + start), c(length(number), shape))
    }
  )
}

#' @exportS3Method
space_index.gym_space_tuple <- function(space) {
  parts <- lapply(space$spaces, space_index)
  if (any(vapply(parts, is.null, NA))) {
    return(NULL)
  }
  counts <- vapply(parts, function(part) part$count, 0)
  weights <- rev(cumprod(c(1, rev(counts))))[-1L]
  list(
    count = prod(counts),
    index = function(batch, n) {
      if (!is.list(batch) || length(batch) != length(parts)) {
        return(rep(NA_integer_, n))
      }
      each <- Map(function(part, values) part$index(values, n) - 1, parts, batch)
      as.integer(Reduce(`+`, Map(`*`, each, weights)) + 1)
    },
    value = function(number) {
      each <- Map(function(part, count, weight) {
        part$value((number - 1) %/% weight %% count + 1)
      }, parts, counts, weights)
      stats::setNames(each, names(space$spaces))
    }
  )
}

#' @exportS3Method
space_index.gym_space_dict <- space_index.gym_space_tuple

#' Find the rows of a table for observations
#' @param index The index of their space.
#' @param n The number of observations.
#' @return Their numbers, from 1; a value outside the space is an error.
#' @noRd
rows_of_table <- function(index, space, observation, n, call) {
  row <- index$index(observation, n)
  if (anyNA(row)) {
    wrong <- batch_value(space, observation, which(is.na(row))[[1L]])
    abort_wrong("observation", observation, call,
                "The table has no row for the observation {describe_value(wrong)}.",
                i = "It has one for each value of {format(space)}.")
  }
  row
}

state_numbers <- function(space) seq.int(as.integer(space$start), length.out = as.integer(space$n))

#' List all values of a countable space
#' @return A data frame with a row for each value, in the order of [space_index()], and a column for
#'   each number of a value. The columns have the names of the parts; a Discrete space has one
#'   column, `state`.
#' @noRd
all_values <- function(space) {
  if (!is.null(space$values)) {
    return(space$values)
  }
  columns <- digit_values(space)
  names(columns) <- if (inherits(space, "gym_space_discrete")) {
    "state"
  } else {
    space$names %||% names(space$spaces) %||% part_columns("obs", seq_along(columns))
  }
  # The last column changes first, as in digits_index().
  rev(do.call(expand.grid, c(rev(columns), KEEP.OUT.ATTRS = FALSE)))
}

# A list with the possible values of each number of a value.
digit_values <- function(space) {
  if (inherits(space, "gym_space_discrete")) {
    list(state_numbers(space))
  } else if (inherits(space, "gym_space_multidiscrete")) {
    # Row by row, as in its table.
    Map(function(first, n) as.integer(first + seq_len(n) - 1), as.vector(space$start %||% 0),
        as.vector(space$nvec))
  } else if (inherits(space, "gym_space_multibinary")) {
    rep(list(0:1), prod(space$shape))
  } else {
    unlist(lapply(unname(space$spaces), digit_values), recursive = FALSE)
  }
}

# Numbers the actions of a space with several parts. Returns a Discrete space, whose labels have the
# columns of a table of steps; NULL if the actions cannot be counted.
countable_actions <- function(space) {
  index <- if (!is.null(space)) space_index(space)
  if (is.null(index)) {
    return(NULL)
  }
  if (inherits(space, "gym_space_discrete")) {
    return(space)
  }
  values <- all_values(space)
  names(values) <- names(value_columns(space, index$value(seq_len(index$count)), "action"))
  labelled_space(values)
}

# The index of a space for the rows of a table (`what` is "observations"), or for its columns
# ("actions").
table_index <- function(space, what, call) {
  index <- space_index(space)
  observed <- what == "observations"
  if (is.null(index)) {
    abort_wrong(NULL, space, call,
                "A table needs {what} that can be counted, but {format(space)} cannot.",
                i = "Discrete, MultiDiscrete and MultiBinary can, and a Tuple or Dict of these.",
                i = if (observed) {
                  "For observations in a Box use a network or features."
                } else {
                  "`search_ars()` and `search_cem()` learn actions of a Box."
                })
  }
  if (index$count > most_values) {
    abort_wrong(NULL, space, call,
                "A table for {format(space)} would have {whole_number_text(index$count)}
                 {if (observed) \"rows\" else \"columns\"}; at most
                 {whole_number_text(most_values)} are possible.",
                i = if (observed) {
                  "With `features`, such as `tile_coding()`, observations share a value."
                })
  }
  index
}

# A table with this many rows and four columns takes a third of a gigabyte.
most_values <- 1e7
