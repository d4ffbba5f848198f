# The tables of a rollout: a row for each episode, a row for each step.

#' Put the episodes of batches into a table
#' @param several Whether there are several candidates, which need a column.
#' @noRd
episodes_table <- function(batches, several = FALSE) {
  column <- function(name, type) {
    c(type, unlist(lapply(batches, function(batch) batch[[name]])))
  }
  episodes <- data.frame(
    candidate = column("candidate", integer()),
    episode = column("episode", integer()),
    seed = column("seed", integer()),
    sub_env = column("sub_env", integer()),
    return = column("return", numeric()),
    length = column("length", integer()),
    terminated = column("terminated", logical()),
    truncated = column("truncated", logical())
  )
  if (several) episodes else episodes[-1L]
}

#' Put the steps of batches into a table, episode after episode
#' @param episodes The table of their episodes.
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
#' @return A list with an element, or a row, for each step: `row` (that of its episode in the
#'   table), `observation`, `action`, `reward`, `terminated`, `truncated` and `next_observation`.
#' @noRd
steps_in_order <- function(batches, episodes, vector_env, next_observation = FALSE) {
  steps <- unlist(lapply(batches, `[[`, "steps"), recursive = FALSE)
  each <- function(name) lapply(steps, `[[`, name)
  row <- step_rows(batches)
  # Step by step, episodes were played in parallel. Stable sorting keeps the steps of each in order.
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

# The row of its episode in the table of episodes, for each step in the order of play.
step_rows <- function(batches) {
  before <- c(0L, cumsum(vapply(batches, function(batch) length(batch$episode), 0L)))
  unlist(lapply(seq_along(batches), function(i) {
    before[[i]] + unlist(lapply(batches[[i]]$steps, function(step) step$at))
  }))
}

#' Put steps in order, episode after episode
#'
#' Without `step` the steps of each episode are taken to be in order.
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
      gym_abort(
        c(paste0("Row ", again[[1L]], " of `", arg, "` is another step ", step[[again[[1L]]]],
                 " of the same episode."),
          i = "Number the episodes in a column `episode`."),
        class = "gym_error_argument", argument = arg, value = x, call = call
      )
    }
  }
  x[order(x[["episode"]], step %||% seq_along(episode)), ]
}
