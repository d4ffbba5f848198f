# The contender reticulate, in its own process, because an R process can use only one Python. Reads
# one line a turn and answers with one: env steps a second (or the requested value):
#
#   versions                            as JSON
#   forms KIND                          the ways to call it, KIND is single or vector
#   single FORM SECONDS                 FORM counts the ways from 1
#   vector FORM SECONDS NUM_ENVS MODE   MODE is Gymnasium's vectorization_mode
#   episodes ENV_ID SECONDS NUM_ENVS    a task of tasks.R, in a SyncVectorEnv

source("tools/bench/turns.R")
source("tools/bench/tasks.R")
suppressMessages(library(reticulate))
gymnasium <- import("gymnasium")
numpy <- import("numpy", convert = FALSE)
builtins <- import_builtins()

# reticulate 1.28 converts arrays of NumPy 1 and leaves those of NumPy 2 as they are. These are
# converted here, as an R user would have to.
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
  values <- switch(x$dtype$kind,
    b = as.logical(bytes), u = as.integer(bytes), readBin(bytes, "double", x$size, size)
  )
  if (x$ndim >= 2L) array(values, unlist(x$shape)) else values
}

# A single sub-environment is also a matrix, with one row.
numpy_actions <- function(actions) numpy$array(actions, dtype = "int64", ndmin = 1L)

single_forms <- list(
  "env$step(a)" = function(env) function(action) env$step(as.integer(action)),
  "step <- env$step; step(a)" = function(env) {
    step <- env$step
    function(action) step(as.integer(action))
  }
)

# How a batch of actions is prepared and passed in each step, and how results become R's.
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

# Steps a second of sub-environments that are stepped together, with the policy in R. A step that
# only begins the next episode of a sub-environment does not count.
play_episodes <- function(env_id, seconds, num_envs) {
  task <- tasks[[env_id]]
  env <- environment_of(env_id, function() make_task(task, as.integer(num_envs)))
  policy <- policy_of(task, env)
  # For few numbers a Python list is faster.
  read <- if (converts) identity else function(x) if (x$size > 1024L) by_bytes(x) else by_list(x)
  step <- env$step
  observation <- read(env$reset()[[1L]])
  ended <- logical(as.integer(num_envs))
  steps <- 0
  started <- now()
  repeat {
    out <- lapply(step(numpy_batch(policy(observation)))[1:4], read)
    observation <- out[[1L]]
    steps <- steps + sum(!ended)
    ended <- as.logical(out[[3L]] | out[[4L]])
    elapsed <- now() - started
    if (elapsed >= as.numeric(seconds)) {
      return(steps / elapsed)
    }
  }
}

# Passes the numbers of a matrix, because reticulate 1.28 cannot make arrays of NumPy 2.
numpy_batch <- function(actions) {
  if (is.integer(actions)) {
    return(numpy$array(actions, dtype = "int64"))
  }
  numpy$array(as.vector(t(actions)), dtype = "float32")$reshape(dim(actions))
}

make_task <- function(task, num_envs) {
  if (!task$stack) {
    return(gymnasium$make_vec(task$env_id, num_envs = num_envs, vectorization_mode = "sync"))
  }
  gymnasium$register_envs(import("ale_py"))
  wrappers <- list(
    gymnasium$wrappers$AtariPreprocessing,
    import("functools")$partial(gymnasium$wrappers$FrameStackObservation, stack_size = 4L)
  )
  gymnasium$make_vec(
    task$env_id, num_envs = num_envs, vectorization_mode = "sync", wrappers = wrappers,
    frameskip = 1L
  )
}

policy_of <- function(task, env) {
  numbers <- task_numbers(task)
  if (task$stack) {
    # Columns in the order in which R has the numbers of an observation.
    places <- aperm(array(seq_len(task$inputs), c(84L, 84L, 4L)))
    numbers <- numbers[, as.vector(places)]
  }
  if (task$kind != "box") {
    return(task_function(task, numbers))
  }
  bounds <- function(which) {
    values <- env$single_action_space[[which]]
    as.vector(if (converts) values else unlist(values$tolist()))
  }
  task_function(task, numbers, bounds("low"), bounds("high"))
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
    vector = format(play_vector_form(...), digits = 15),
    episodes = format(play_episodes(...), digits = 15)
  )
}

input <- file("stdin", "r")
while (length(line <- readLines(input, 1L))) {
  writeLines(do.call(answer, as.list(strsplit(line, " ", fixed = TRUE)[[1L]])))
  flush(stdout())
}
