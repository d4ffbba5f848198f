# States and actions with names: in a model they are numbers of spaces that know their names.

#' Number the states and actions of a table
#'
#' @param x A table of transitions or steps.
#' @param state,action The names of the columns of the state and of the action.
#' @return A list: `table`, with whole numbers in `state`, `action` and `next_state`; `states` and
#'   `actions`, spaces with names, `NULL` for those that were numbers.
#' @noRd
coded_transitions <- function(x, state, action, call, arg = "transitions") {
  if (!is.data.frame(x)) {
    return(list(table = x))
  }
  after <- paste0("next_", state)
  check_columns(x, c(state, after, action), arg, call)
  x <- as.data.frame(x)
  from <- x[state]
  to <- stats::setNames(x[after], state)
  coded <- list()
  if (length(state) > 1L || has_names(from[[1L]]) || has_names(to[[1L]])) {
    coded$states <- labelled_space(sorted_rows(unique(both_rows(from, to))))
    x$state <- encoded_values(coded$states, from, "state", call)
    x$next_state <- encoded_values(coded$states, to, "state", call)
  } else {
    x$state <- from[[1L]]
    x$next_state <- to[[1L]]
  }
  taken <- named_as_actions(x[action])
  if (length(action) > 1L || has_names(taken[[1L]])) {
    coded$actions <- labelled_space(sorted_rows(unique(taken)))
    x$action <- encoded_values(coded$actions, taken, "action", call)
  } else {
    x$action <- taken[[1L]]
  }
  coded$table <- x
  coded
}

has_names <- function(x) is.character(x) || is.factor(x) || is.logical(x)

# A factor of the states that were left may lack levels of those that were only reached.
both_rows <- function(from, to) {
  columns <- Map(function(x, y) {
    if (!is.factor(x) && !is.factor(y)) {
      return(c(x, y))
    }
    levels <- union(levels(x) %||% sort(unique(x)), levels(y) %||% sort(unique(y)))
    factor(c(as.character(x), as.character(y)), levels)
  }, from, to)
  data.frame(columns, check.names = FALSE, stringsAsFactors = FALSE)
}

sorted_rows <- function(x) {
  x <- x[do.call(order, unname(as.list(x))), , drop = FALSE]
  row.names(x) <- NULL
  x
}

# The transitions of a model as people read them.
named_transitions <- function(model) {
  table <- model$transitions
  states <- model$observation_space
  from <- table["state"]
  to <- table["next_state"]
  if (!is.null(states$values)) {
    from <- decoded_values(states, table$state)
    to <- decoded_values(states, table$next_state)
    names(to) <- paste0("next_", names(to))
  }
  data.frame(from, decoded_actions(model$action_space, table$action), to,
             table[c("probability", "reward", "terminated")], check.names = FALSE)
}
