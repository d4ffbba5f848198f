# Replaces a function of the package until the test ends. The oldest supported testthat does not
# have local_mocked_bindings().
local_binding <- function(name, value, frame = parent.frame()) {
  space <- asNamespace("gym")
  before <- get(name, space)
  set <- function(value) {
    unlockBinding(name, space)
    assign(name, value, space)
    lockBinding(name, space)
  }
  set(value)
  withr::defer(set(before), envir = frame)
}

local_functions <- function(..., frame = parent.frame()) {
  replaced <- list(...)
  for (name in names(replaced)) {
    local_binding(name, replaced[[name]], frame = frame)
  }
}

# Changes values of the session until the test ends.
local_session <- function(..., frame = parent.frame()) {
  values <- list(...)
  old <- mget(names(values), envir = the_session, ifnotfound = list(NULL))
  list2env(values, the_session)
  withr::defer(list2env(old, the_session), envir = frame)
}
