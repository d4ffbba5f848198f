# Functions that go to a worker use objects of the session: a number, another function, a package.
# Serialized functions leave the global environment behind, so its objects travel beside them.

#' Find what functions use from the global environment
#'
#' @param x Anything that contains functions: a policy, a recipe, the settings of a training.
#' @return A list: `objects`, a list with names, and `packages`, the names of those to attach.
#' @noRd
session_objects <- function(x, found = list(objects = list(), packages = character())) {
  functions <- session_functions(x)
  if (!length(functions)) {
    return(found)
  }
  names(functions) <- paste0("function_", seq_along(functions))
  used <- future::getGlobalsAndPackages(
    as.call(c(quote(list), lapply(names(functions), as.name))),
    envir = list2env(functions, parent = globalenv())
  )
  names <- setdiff(intersect(names(used$globals), names(globalenv())), names(found$objects))
  objects <- mget(names, globalenv())
  found$packages <- union(found$packages, used$packages)
  found$objects <- c(found$objects, objects)
  # These may contain functions themselves, such as a list of them.
  if (length(objects)) session_objects(objects, found) else found
}

# The functions in an object that were written in the session. Those of packages are on the worker,
# too, but may have been made from functions of the session.
session_functions <- function(x, seen = rlang::env(list = list())) {
  if (is.function(x)) {
    if (is.primitive(x)) {
      NULL
    } else if (isNamespace(topenv(environment(x)))) {
      session_functions(environment(x), seen)
    } else {
      list(x)
    }
  } else if (is.environment(x)) {
    functions_of_environment(x, seen)
  } else if (is.list(x)) {
    x <- Filter(function(part) !rlang::is_missing(part), unclass(x))
    unlist(lapply(x, session_functions, seen), recursive = FALSE, use.names = FALSE)
  }
}

functions_of_environment <- function(x, seen) {
  shared <- list(globalenv(), baseenv(), emptyenv())
  if (isNamespace(x) || any(vapply(c(shared, seen$list), identical, NA, x))) {
    return(NULL)
  }
  seen$list <- c(seen$list, x)
  # A class of R6 names the one that it inherits from in an expression.
  parent <- if (inherits(x, "R6ClassGenerator")) as.function(list(x$inherit), x$parent_env)
  session_functions(c(list(parent, parent.env(x)), as.list.environment(x, all.names = TRUE)), seen)
}

# On the worker: where its functions look for them.
take_session_objects <- function(found) {
  for (package in found$packages) {
    suppressPackageStartupMessages(library(package, character.only = TRUE))
  }
  list2env(found$objects, globalenv())
}
