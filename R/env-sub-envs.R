# The number of sub-environments of an environment made from its id.
#
# The rule depends on the environment and the number of episodes, never on cores, workers or time,
# so that a seed gives the same results everywhere. Many sub-environments share the cost of a
# message and of calling the policy. Too many make large messages, and most of them wait while the
# last episodes of a batch end.

entry_point_sub_envs <- 256L
most_sub_envs <- 256L
fewest_sub_envs <- 16L

# The most bytes for the observations of all sub-environments, if there are more than 16.
most_observation_bytes <- 2^20

# Fewer episodes than this do not use worker processes.
few_episodes <- 32L

#' Choose the number of sub-environments with their own seeds
#' @return A power of two, an integer.
#' @noRd
count_sub_envs <- function(observation_bytes) {
  room <- 2^floor(log2(most_observation_bytes / max(observation_bytes, 1)))
  as.integer(min(most_sub_envs, max(fewest_sub_envs, room)))
}

# The size of an observation in a message. Only arrays, which may be large, are counted.
observation_bytes <- function(space) {
  if (has_parts(space)) {
    sum(vapply(space$spaces, observation_bytes, 0))
  } else if (inherits(space, "gym_space_array")) {
    prod(space$shape) * dtype_bytes(space$dtype)
  } else {
    0
  }
}

dtype_bytes <- function(dtype) {
  bits <- suppressWarnings(as.numeric(sub("^[a-z]+", "", dtype)))
  if (is.na(bits)) 1 else bits / 8
}

# What is known about an environment of one version of the server, as long as the client lives.
known_of_env <- function(client, env_id, arguments) {
  check_client(client)
  versions <- server_versions(client)
  state <- client_state(client)
  state$known_envs <- state$known_envs %||% new.env(parent = emptyenv())
  key <- rlang::hash(list(env_id, if (length(arguments)) arguments, versions))
  state$known_envs[[key]] <- state$known_envs[[key]] %||% new.env(parent = emptyenv())
  state$known_envs[[key]]
}

#' Make an environment with sub-environments, or without any if the server cannot make them
#'
#' @param make A function that makes it, of the number of sub-environments and how they run.
#' @param described As returned by [known_description()]. A server that does not report the size of
#'   observations refuses more sub-environments than it can make.
#' @return A list: `env`, the environment, and `batch_size`, the number of episodes in a batch if
#'   each sub-environment has its own seed.
#' @noRd
make_sub_envs <- function(make, described, num_envs, num_workers, max_envs, call) {
  own_implementation <- isTRUE(described$one_seed)
  if (own_implementation) {
    check_no_workers(num_workers, call)
    own <- if_supported(
      make(num_envs %||% entry_point_sub_envs, vectorization_mode = "vector_entry_point")
    )
    if (!is.null(own)) {
      return(list(env = own))
    }
  }
  # Sub-environments with their own seeds. A vector implementation does not use workers.
  make_seeded <- function(n, workers) {
    make(
      n, num_workers = workers, autoreset_mode = "SameStep",
      vectorization_mode = if (own_implementation || is.null(described)) "sync"
    )
  }
  full <- num_envs %||% count_sub_envs(observation_bytes(described$observation_space))
  # There are no more sub-environments than episodes. Without a number the server chooses the
  # workers.
  workers <- num_workers %||% if (max_envs < few_episodes) 0L
  env <- if (!is.null(num_envs)) {
    # A single environment steps in half the time of one with a single sub-environment.
    if (num_envs == 1 && is.null(num_workers)) make(NULL) else make_seeded(num_envs, workers)
  }
  for (n in if (is.null(num_envs)) counts_to_try(min(max_envs, full))) {
    env <- env %||% if_supported(make_seeded(n, if (!is.null(workers)) min(workers, n)))
  }
  list(env = env %||% make(NULL), batch_size = episodes_of_batch(full))
}

# The server may refuse this many; then try fewer.
counts_to_try <- function(n) {
  unique(c(n, Filter(function(fewer) fewer > 1 && fewer < n, c(n %/% 4, fewest_sub_envs))))
}

check_no_workers <- function(num_workers, call) {
  if (isTRUE(num_workers > 0)) {
    gym_abort(
      c(paste0("`num_workers = ", num_workers, "` has no effect on an environment with its own ",
               "vector implementation, which plays all sub-environments in one process."),
        i = "Leave it out."),
      class = "gym_error_argument", argument = "num_workers", value = num_workers, call = call
    )
  }
}

# Codes of errors that may disappear with fewer sub-environments or none.
fewer_sub_envs_codes <- c("not_supported", "too_much_memory", "unsupported_space")

# Evaluates code that makes an environment. NULL if the server cannot make such sub-environments, or
# not that many.
if_supported <- function(code) {
  tryCatch(
    code,
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% fewer_sub_envs_codes)) {
        rlang::cnd_signal(cnd)
      }
    }
  )
}
