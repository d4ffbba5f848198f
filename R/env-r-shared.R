# Values that several sub-environments would share: R copies no environment, and so no object of R6.
# What functions enclose is not looked at.

#' Refuse values that all sub-environments would share
#'
#' @param values A list with names: the values with which each `self` starts, or the arguments of an
#'   entry point.
#' @param where Where each sub-environment can make its own.
#' @noRd
check_not_shared <- function(values, where = "`reset`", call = rlang::caller_env()) {
  for (name in names(values)) {
    shared <- shared_object(values[[name]], name)
    if (!is.null(shared)) abort_shared(shared, name, where, call)
  }
}

# The first environment in a value or, if it is a list, in its elements: a list of `path` and
# `object`. A class of R6 is an environment whose state nobody changes, and so are objects of this
# package in a list, such as a client.
shared_object <- function(value, path) {
  if (is.environment(value) && !inherits(value, "R6ClassGenerator")) {
    return(list(path = path, object = value))
  }
  if (is.list(value) && !any(startsWith(class(value), "gym_"))) {
    keys <- rlang::names2(value)
    for (i in seq_along(value)) {
      inside <- if (nzchar(keys[[i]])) path_key(path, keys[[i]]) else paste0(path, "[[", i, "]]")
      found <- shared_object(.subset2(value, i), inside)
      if (!is.null(found)) {
        return(found)
      }
    }
  }
}

abort_shared <- function(shared, name, where, call) {
  object <- shared$object
  class <- if (is.object(object)) class(object)[[1L]]
  again <- if (is_playable(object)) {
    paste0("gym_make(\"", object$spec$id, "\", seed = 1)")
  } else if (inherits(object, "R6")) {
    paste0(class, "$new()")
  } else {
    "new.env()"
  }
  what <- if (is.null(class)) "an environment of R" else paste("an object of class", class)
  gym_abort(
    c(paste0("`", shared$path, "` is ", what, ", which all sub-environments would share."),
      i = paste0("Let each make its own in ", where, ": `if (is.null(self$", name, ")) self$", name,
                 " <- ", again, "`."),
      i = "If nothing changes it, the functions can use it without `self`."),
    class = "gym_error_argument", argument = name, value = object, call = call
  )
}

# The fields that a class of R6 has from its definition are made once, for all of its objects.
check_fields_not_shared <- function(class, call) {
  while (inherits(class, "R6ClassGenerator")) {
    fields <- c(class$public_fields, class$private_fields)
    check_not_shared(fields, "`initialize()`", call)
    class <- class$get_inherit()
  }
}
