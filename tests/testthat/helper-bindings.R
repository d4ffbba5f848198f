# Functions of the package replaced until the test ends. testthat's own
# local_mocked_bindings() is younger than the testthat that this package runs on.
local_functions <- function(..., frame = parent.frame()) {
  namespace <- asNamespace("gym")
  replaced <- list(...)
  originals <- mget(names(replaced), envir = namespace)
  set <- function(functions) {
    for (name in names(functions)) {
      unlockBinding(name, namespace)
      assign(name, functions[[name]], envir = namespace)
      lockBinding(name, namespace)
    }
  }
  set(replaced)
  withr::defer(set(originals), envir = frame)
}

# What a session remembers, kept as it was for other tests.
local_session <- function(..., frame = parent.frame()) {
  values <- list(...)
  old <- mget(names(values), envir = the_session, ifnotfound = list(NULL))
  list2env(values, the_session)
  withr::defer(list2env(old, the_session), envir = frame)
}
