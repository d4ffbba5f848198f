# The names of observations. A space may have an element `names`: for an array of one dimension the
# names of its numbers, for a Tuple those of its parts, for a Discrete space the name of its number
# in tables. Values get their names after reading; code that reads and writes them does not need
# names.

#' Make the function that adds names to values of a space
#'
#' It is made once for an environment, so that each step only sets an attribute.
#' @param space The space of one value.
#' @param batch Whether the function is for batches of values.
#' @return A function of a value, which returns it with names; `NULL` if values have none.
#' @noRd
naming <- function(space, batch = FALSE) {
  labels <- space$names
  if (has_parts(space)) {
    parts <- lapply(unname(space$spaces), naming, batch)
    naming_of_parts(parts, if (inherits(space, "gym_space_tuple")) labels)
  } else if (is.null(labels) || !inherits(space, "gym_space_array")) {
    # A single number has none: it would be printed with its name at each step.
    NULL
  } else if (batch) {
    labels <- list(NULL, labels)
    function(value) {
      dimnames(value) <- labels
      value
    }
  } else {
    function(value) {
      names(value) <- labels
      value
    }
  }
}

# A batch with the names that it has in play.
named_batch <- function(space, batch) {
  name <- naming(space, batch = TRUE)
  if (is.null(name)) batch else name(batch)
}

naming_of_parts <- function(parts, labels) {
  named <- which(!vapply(parts, is.null, NA))
  if (!length(named) && is.null(labels)) {
    return(NULL)
  }
  function(value) {
    for (i in named) {
      value[[i]] <- parts[[i]](value[[i]])
    }
    if (!is.null(labels)) names(value) <- labels
    value
  }
}
