# The tables of a rollout: a row for each episode, a row for each step.

#' Put the episodes of a history into a table
#' @param n How many, from the first.
#' @noRd
episodes_table <- function(history, n = history$begun) {
  column <- function(name, type) {
    c(type, unlist(lapply(history$batches, function(batch) batch[[name]])))[seq_len(n)]
  }
  data.frame(
    episode = seq_len(n),
    seed = column("seed", integer()),
    sub_env = column("sub_env", integer()),
    return = column("return", numeric()),
    length = column("length", integer()),
    terminated = column("terminated", logical()),
    truncated = column("truncated", logical())
  )
}

#' Put the steps of a history into a table, episode after episode
#' @noRd
steps_table <- function(history, episodes, vector_env) {
  steps <- do.call(c, lapply(history$batches, function(batch) {
    lapply(batch$steps, function(step) c(list(episode = batch$episodes[step$sub_env]), step))
  }))
  column <- function(name) unlist(lapply(steps, function(step) step[[name]]))
  values <- function(name, space) bind_batches(space, lapply(steps, function(step) step[[name]]))
  observed <- vector_env$observation_space
  observations <- observation_columns(
    observed, values("observation", observed), vector_env$spec$id
  )
  acted <- vector_env$action_space
  actions <- value_columns(acted, values("action", acted), "action")
  episode <- column("episode")
  # Stable, so that an episode's steps stay in their order.
  by_episode <- order(episode, method = "radix")
  columns <- c(
    list(episode = episode), observations, actions,
    list(
      reward = as.numeric(column("reward")), terminated = column("terminated"),
      truncated = column("truncated")
    )
  )
  columns <- lapply(columns, `[`, by_episode)
  columns$truncated[cumsum(episodes$length)] <- episodes$truncated
  step <- list(step = sequence(episodes$length))
  data.frame(append(columns, step, after = 1L), check.names = FALSE)
}
