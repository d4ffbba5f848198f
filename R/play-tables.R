# The tables of a rollout: a row for each episode, a row for each step.

#' Put the episodes of batches into a table
#' @param several Whether there are several candidates, which need a column.
#' @noRd
episodes_table <- function(batches, several = FALSE) {
  column <- function(name, type) {
    c(type, unlist(lapply(batches, function(batch) batch[[name]])))
  }
  episodes <- data.frame(
    candidate = column("candidate", integer()), episode = column("episode", integer()),
    seed = column("seed", integer()), sub_env = column("sub_env", integer()),
    return = column("return", numeric()), length = column("length", integer()),
    terminated = column("terminated", logical()), truncated = column("truncated", logical())
  )
  if (several) episodes else episodes[-1L]
}

#' Put the steps of batches into a table, episode after episode
#' @param episodes The table of the episodes of the batches.
#' @param next_observation Whether to include the observation after each step.
#' @noRd
steps_table <- function(batches, episodes, vector_env, several = FALSE, next_observation = FALSE) {
  steps <- steps_in_order(batches, episodes, vector_env, next_observation)
  observed <- vector_env$observation_space
  keys <- list(
    candidate = if (several) episodes$candidate[steps$row], episode = episodes$episode[steps$row],
    step = sequence(episodes$length)
  )
  columns <- c(
    keys[lengths(keys) > 0L], observation_columns(observed, steps$observation),
    value_columns(vector_env$action_space, steps$action, "action"),
    steps[c("reward", "terminated", "truncated")],
    if (next_observation) {
      after <- observation_columns(observed, steps$next_observation)
      stats::setNames(after, paste0("next_", names(after)))
    }
  )
  data.frame(columns, check.names = FALSE)
}

#' Put the steps of batches in order, episode after episode
#' @inheritParams steps_table
#' @return A list of vectors and batches with an entry for each step: `row` (the row of its episode
#'   in the table), `observation`, `action`, `reward`, `terminated`, `truncated` and
#'   `next_observation`.
#' @noRd
steps_in_order <- function(batches, episodes, vector_env, next_observation = FALSE) {
  steps <- unlist(lapply(batches, `[[`, "steps"), recursive = FALSE)
  each <- function(name) lapply(steps, `[[`, name)
  # For each step, in the order of play: the row of its episode in the table of episodes.
  before <- c(0L, cumsum(vapply(batches, function(batch) length(batch$episode), 0L)))
  row <- unlist(lapply(seq_along(batches), function(i) {
    before[[i]] + unlist(lapply(batches[[i]]$steps, `[[`, "at"))
  }))
  # If R played step by step, steps of several episodes alternate. Stable sorting keeps the steps of
  # each episode in order.
  mixed <- is.unsorted(row)
  order <- if (mixed) order(row, method = "radix") else seq_along(row)
  bind <- function(name, space) {
    values <- bind_batches(space, each(name))
    if (mixed) batch_rows(space, values, order) else values
  }
  observed <- vector_env$observation_space
  truncated <- unlist(each("truncated"))[order]
  # An episode that `max_steps` cuts off is truncated in its last step.
  truncated[cumsum(episodes$length)] <- episodes$truncated
  list(
    row = row[order], observation = bind("observation", observed),
    action = bind("action", vector_env$action_space),
    reward = as.numeric(unlist(each("reward")))[order],
    terminated = unlist(each("terminated"))[order], truncated = truncated,
    next_observation = if (next_observation) bind("next_observation", observed)
  )
}

#' Put a user's steps in order, episode after episode
#'
#' Without a column `step`, the rows of each episode must already be in order.
#' @param x A user's data frame of steps with some of the columns `candidate`, `episode` and `step`.
#' @return The data frame, with `episode` numbered over all candidates.
#' @noRd
steps_by_episode <- function(x, arg, call) {
  keys <- intersect(c("candidate", "episode"), names(x))
  for (name in keys) {
    check_column(x, name, "a number or a name", function(values) !is.na(values), arg, call)
  }
  # Each candidate's episodes are numbered from 1.
  episode <- rep_len(paste(x[["candidate"]] %||% 1L, x[["episode"]] %||% 1L), nrow(x))
  x[["episode"]] <- match(episode, unique(episode))
  step <- x[["step"]]
  if (!is.null(step)) {
    check_column(x, "step", "whole numbers", are_whole_numbers, arg, call)
    again <- which(duplicated(data.frame(x[["episode"]], step)))
    if (length(again)) {
      abort_wrong(arg, x, call,
                  "Row {again[[1L]]} of `{arg}` is another step {step[[again[[1L]]]]} of the same
                   episode.",
                  i = "Number the episodes in a column `episode`.")
    }
  }
  x[order(x[["episode"]], step %||% seq_along(episode)), ]
}

# How a result was made: what somebody needs to reproduce it, or to see why another result differs.

new_provenance <- function(vector_env, settings, started = Sys.time()) {
  system <- Sys.info()
  # The versions of the server and of the simulator, such as MuJoCo: episodes may differ between
  # versions.
  versions <- c(server_versions(vector_env$client), vector_env$spec$engine) %||%
    vector_env$model$versions
  # For example the version of NumPy, which computes the actions of policies on the server.
  described <- vector_env$description$versions
  way <- if (!is.null(vector_env$model)) {
    "from the model in R"
  } else if (isTRUE(vector_env$apart)) {
    "in a process of its own"
  } else if (is.null(vector_env$description)) {
    "step by step"
  } else {
    "beside the environment"
  }
  structure(class = "gym_provenance", list(
    gym = as.character(utils::packageVersion("gym")), R = as.character(getRversion()),
    platform = R.version$platform, system = paste(system[["sysname"]], system[["release"]]),
    BLAS = extSoftVersion()[["BLAS"]], LAPACK = La_library(),
    server = c(versions, described[setdiff(names(described), names(versions))]),
    processor = vector_env$description$processor, way = way,
    env_id = environment_label(vector_env),
    kwargs = vector_env$spec$kwargs %||% settings$kwargs %||% list(),
    wrappers = as.character(vector_env$spec$wrappers),
    num_envs = if (is.null(vector_env$description)) vector_env$num_envs,
    seed = settings$seed, preset = settings$agent$preset, started = started, elapsed = NA_real_
  ))
}

#' @export
format.gym_provenance <- function(x, ...) {
  text <- function(x) if (is.character(x) && length(x) == 1L) x else describe_value(x)
  named <- function(values) {
    if (length(values)) paste(names(values), vapply(values, text, ""), collapse = ", ")
  }
  lines <- c(
    gym = x$gym, R = x$R, platform = x$platform, system = x$system, BLAS = x$BLAS,
    LAPACK = x$LAPACK, server = named(x$server), processor = x$processor, played = x$way,
    environment = x$env_id, arguments = named(x$kwargs),
    wrappers = if (length(x$wrappers)) toString(x$wrappers),
    `sub-environments` = if (length(x$num_envs)) as.character(x$num_envs),
    seed = if (length(x$seed)) toString(format(x$seed, scientific = FALSE, trim = TRUE)),
    preset = x$preset$origin,
    started = if (!is.null(x$started) && prints_times()) {
      format(x$started, "%Y-%m-%d %H:%M:%S %Z")
    },
    elapsed = if (!is.na(x$elapsed)) elapsed_text(x$elapsed, "")
  )
  paste(format(paste0(names(lines), ":")), lines)
}

#' @export
print.gym_provenance <- function(x, ...) print_line(x)
