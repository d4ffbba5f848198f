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
  steps <- unlist(lapply(batches, function(batch) batch$steps), recursive = FALSE)
  column <- function(name) unlist(lapply(steps, function(step) step[[name]]))
  values <- function(name, space) bind_batches(space, lapply(steps, function(step) step[[name]]))
  observed <- vector_env$observation_space
  named <- function(name) observation_columns(observed, values(name, observed))
  acted <- vector_env$action_space
  columns <- c(
    named("observation"), value_columns(acted, values("action", acted), "action"),
    list(
      reward = as.numeric(column("reward")), terminated = column("terminated"),
      truncated = column("truncated")
    ),
    if (next_observation) {
      after <- named("next_observation")
      stats::setNames(after, paste0("next_", names(after)))
    }
  )
  # Stable sorting keeps the steps of an episode in order.
  by_episode <- order(step_rows(batches), method = "radix")
  columns <- lapply(columns, `[`, by_episode)
  columns$truncated[cumsum(episodes$length)] <- episodes$truncated
  of_step <- rep(seq_along(episodes$length), episodes$length)
  keys <- list(
    candidate = if (several) episodes$candidate[of_step], episode = episodes$episode[of_step],
    step = sequence(episodes$length)
  )
  data.frame(c(keys[lengths(keys) > 0L], columns), check.names = FALSE)
}

# The row of its episode in the table of episodes, for each step in the order of play.
step_rows <- function(batches) {
  before <- c(0L, cumsum(vapply(batches, function(batch) length(batch$episode), 0L)))
  unlist(lapply(seq_along(batches), function(i) {
    before[[i]] + unlist(lapply(batches[[i]]$steps, function(step) step$at))
  }))
}
