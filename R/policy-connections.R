# What a function holds that cannot be saved: connections of R, environments on a server, pointers
# of other packages, such as curl's handles. In another session they are void, and a connection's
# number may be that of another one there.

#' Abort when a policy holds a connection that was lost when it was saved
#' @param policy A function.
#' @noRd
check_connections <- function(policy, arg, call) {
  lost <- lost_connection(policy)
  if (!is.null(lost)) {
    gym_abort(
      c(
        paste0("The function given for `", arg, "` uses `", lost$name, "`, ", lost$what,
               ", which was lost when the function was saved."),
        i = paste0("Make it again in this session, and the function with it, or save a function ",
                   "that does without.")
      ),
      class = "gym_error_argument", argument = arg, value = policy, call = call
    )
  }
}

#' Find a lost connection among the variables that a function uses
#'
#' These are in the environment where it was made, and in those around that one, up to the first
#' that is not saved with it. Functions and lists among them are looked into, too.
#' @param seen The functions that were looked into before.
#' @return A list: `name`, that of the variable or its place in a list, and `what`, words for what
#'   it was; `NULL` for none.
#' @noRd
lost_connection <- function(f, seen = list()) {
  if (any(vapply(seen, identical, NA, f))) {
    return(NULL)
  }
  names <- unique(c(all.names(body(f)), unlist(lapply(formals(f), all.names))))
  frame <- environment(f)
  while (is_saved_frame(frame)) {
    own <- names[vapply(names, exists, NA, envir = frame, inherits = FALSE)]
    lost <- lost_variable(variable_values(frame, own), c(seen, f))
    if (!is.null(lost)) {
      return(lost)
    }
    names <- setdiff(names, own)
    frame <- parent.env(frame)
  }
}

is_saved_frame <- function(frame) {
  !is.null(frame) && !identical(frame, globalenv()) && !identical(frame, emptyenv()) &&
    !isNamespace(frame) && is.null(attr(frame, "name"))
}

# The variables that have a value: looking at others would evaluate code of the user's.
variable_values <- function(frame, names) {
  pending <- rlang::env_binding_are_lazy(frame, names) | rlang::env_binding_are_active(frame, names)
  values <- mget(names[!pending], frame)
  # An argument that was left out is in its frame, too.
  values[!vapply(seq_along(values), function(i) rlang::is_missing(values[[i]]), NA)]
}

lost_variable <- function(values, seen) {
  for (name in names(values)) {
    value <- values[[name]]
    what <- lost_words(value)
    if (!is.null(what)) {
      return(list(name = name, what = what))
    }
    inner <- if (is.function(value)) {
      lost_connection(value, seen)
    } else if (is.list(value) && !is.object(value) && length(value)) {
      places <- names(value) %||% rep("", length(value))
      names(value) <- paste0(name, ifelse(nzchar(places), paste0("$", places),
                                          paste0("[[", seq_along(value), "]]")))
      lost_variable(value, seen)
    }
    if (!is.null(inner)) {
      return(inner)
    }
  }
}

# Words for a value that is a lost connection, NULL for any other.
lost_words <- function(value) {
  if (inherits(value, "connection")) {
    if (is_void(attr(value, "conn_id"))) "a connection of R"
  } else if (typeof(value) == "externalptr") {
    if (is_void(value)) {
      own <- class(value)[[1L]]
      if (own == "externalptr") "an external pointer" else paste("an object of class", own)
    }
  } else if (inherits(value, "gym_server_env")) {
    if (!is_at_home(value$client)) "an environment made by `gym_make()`"
  }
}

# A pointer that was saved is read as one that points nowhere, and only such a one is the same when
# it is saved and read.
is_void <- function(pointer) {
  typeof(pointer) == "externalptr" && identical(pointer, unserialize(serialize(pointer, NULL)))
}

# Whether a client was made in this very process.
is_at_home <- function(client) {
  identical(client$state$session, the_session) && identical(client$state$pid, Sys.getpid())
}
