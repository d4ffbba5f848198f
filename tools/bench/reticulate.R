# The contender reticulate: a process of its own, as one R process takes one Python.
# Reads one line a turn and answers with one, env steps a second (or what was asked for):
#
#   versions                            as JSON
#   forms KIND                          the ways to call it, KIND is single or vector
#   single FORM SECONDS                 FORM counts the ways from 1
#   vector FORM SECONDS NUM_ENVS MODE   MODE is Gymnasium's vectorization_mode

source("tools/bench/turns.R")
suppressMessages(library(reticulate))
gymnasium <- import("gymnasium")
numpy <- import("numpy", convert = FALSE)
builtins <- import_builtins()

# reticulate 1.28 makes R arrays of the arrays of NumPy 1 and leaves those of NumPy 2 as they
# are: then the results are converted here, as an R user has to.
converts <- is.numeric(import("numpy")$zeros(2L))

# Through a Python list.
by_list <- function(x) {
  values <- unlist(x$tolist())
  if (x$ndim == 2L) matrix(values, ncol = x$shape[[2L]], byrow = TRUE) else values
}

# Through the bytes, column by column.
by_bytes <- function(x) {
  size <- x$itemsize
  bytes <- builtins$bytearray(x$tobytes("F"))
  values <- if (size == 1L) as.logical(bytes) else readBin(bytes, "double", x$size, size)
  if (x$ndim == 2L) matrix(values, ncol = x$shape[[2L]]) else values
}

# A single sub-environment has a row, too.
numpy_actions <- function(actions) numpy$array(actions, dtype = "int64", ndmin = 1L)

single_forms <- list(
  "env$step(a)" = function(env) function(action) env$step(as.integer(action)),
  "step <- env$step; step(a)" = function(env) {
    step <- env$step
    function(action) step(as.integer(action))
  }
)

# Of a batch of actions what is made beforehand and what in each step, and how the results
# become R's.
vector_form <- function(prepare, send, read) list(prepare = prepare, send = send, read = read)

vector_forms <- if (converts) {
  list(
    "step(array(a))" = vector_form(array, identity, identity),
    "NumPy actions made beforehand" = vector_form(numpy_actions, identity, identity)
  )
} else {
  list(
    "np$array(a), x$tolist()" = vector_form(identity, numpy_actions, by_list),
    "np$array(a), bytes" = vector_form(identity, numpy_actions, by_bytes),
    "NumPy actions made beforehand, bytes" = vector_form(numpy_actions, identity, by_bytes)
  )
}

# Made once for all turns.
environments <- new.env()
environment_of <- function(name, make) {
  if (is.null(environments[[name]])) {
    environments[[name]] <- make()
    environments[[name]]$reset(seed = 1L)
  }
  environments[[name]]
}

single <- function(form, seconds) {
  env <- environment_of("single", function() gymnasium$make("CartPole-v1"))
  step <- single_forms[[as.integer(form)]](env)
  read <- if (converts) identity else by_list
  reset <- env$reset
  play_single(
    function() read(reset()[[1L]]),
    function(action) {
      out <- step(action)
      read(out[[1L]])
      out[[3L]] || out[[4L]]
    },
    as.numeric(seconds)
  )
}

play_vector_form <- function(form, seconds, num_envs, mode) {
  num_envs <- as.integer(num_envs)
  env <- environment_of(paste("num_envs", num_envs), function() {
    gymnasium$make_vec("CartPole-v1", num_envs = num_envs, vectorization_mode = mode)
  })
  form <- vector_forms[[as.integer(form)]]
  step <- env$step
  play_vector(
    num_envs, lapply(alternating(num_envs), form$prepare),
    function(actions) lapply(step(form$send(actions))[1:4], form$read),
    as.numeric(seconds)
  )
}

versions <- function() {
  list(
    reticulate = format(packageVersion("reticulate")),
    Python = import("platform")$python_version(),
    Gymnasium = gymnasium$`__version__`,
    NumPy = import("numpy")$`__version__`
  )
}

answer <- function(command, ...) {
  switch(command,
    versions = jsonlite::toJSON(versions(), auto_unbox = TRUE),
    forms = jsonlite::toJSON(names(switch(..1, single = single_forms, vector = vector_forms))),
    single = format(single(...), digits = 15),
    vector = format(play_vector_form(...), digits = 15)
  )
}

input <- file("stdin", "r")
while (length(line <- readLines(input, 1L))) {
  writeLines(do.call(answer, as.list(strsplit(line, " ", fixed = TRUE)[[1L]])))
  flush(stdout())
}
