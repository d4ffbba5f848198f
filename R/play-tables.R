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
  observations <- value_columns(observed, values("observation", observed), "obs")
  if (is_stackable(observed)) {
    names(observations) <- paste0("obs_", seq_along(observations), recycle0 = TRUE)
  }
  names(observations) <- observation_names(vector_env$spec$id, names(observations))
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

# Values of one space as the columns of a table -------------------------------------

#' Put values of a space into columns
#'
#' Numbers have a column each, in row-major order; so have the parts of Tuple and
#' Dict. Values that may hold any number of parts have one column that is a list.
#' @param values The values, as [batch_of()] puts them together.
#' @param name What they are, such as `"action"`.
#' @return A named list of columns.
#' @noRd
value_columns <- function(space, values, name) UseMethod("value_columns")

#' @exportS3Method
value_columns.default <- function(space, values, name) stats::setNames(list(I(values)), name)

#' @exportS3Method
value_columns.gym_space_array <- function(space, values, name) {
  numbers <- number_rows(values)
  n <- ncol(numbers)
  each <- lapply(seq_len(n), function(i) numbers[, i])
  stats::setNames(each, if (n == 1L) name else paste0(name, "_", seq_len(n), recycle0 = TRUE))
}

#' @exportS3Method
value_columns.gym_space_discrete <- function(space, values, name) {
  stats::setNames(list(values), name)
}

#' @exportS3Method
value_columns.gym_space_text <- value_columns.gym_space_discrete

#' @exportS3Method
value_columns.gym_space_tuple <- function(space, values, name) {
  columns <- lapply(seq_along(space$spaces), function(i) {
    value_columns(space$spaces[[i]], values[[i]], paste0(name, "_", names(space$spaces)[i] %||% i))
  })
  do.call(c, columns)
}

#' @exportS3Method
value_columns.gym_space_dict <- value_columns.gym_space_tuple
