# Episodes played in lockstep: in blocks of one episode a sub-environment. A sub-environment whose
# episode has ended waits for the block's end. Were it to begin another one at once, and the playing
# to stop at the number asked for, short episodes would be favoured.

#' Start to keep what comes of episodes
#'
#' @param wanted How many episodes, from the first, are to be played.
#' @param on_end Called when episodes have ended, with the record, their numbers and
#'   their returns, in which it may find that fewer are `wanted`.
#' @return A record, an environment: `wanted`; `begun`, how many episodes have begun;
#'   `blocks`, a list of environments, each with what is known of a block's episodes;
#'   `after_block`, a function of the record, called when a block has ended.
#' @noRd
new_record <- function(wanted, on_end = function(record, episodes, returns) NULL) {
  rlang::env(
    wanted = wanted, begun = 0L, blocks = list(), on_end = on_end,
    after_block = function(record) NULL
  )
}

#' Play blocks of episodes until those that are wanted have ended
#'
#' @param sub-environments As [vector_env_of()] returns them.
#' @param begin A function that is given a block's number and the numbers of its episodes,
#'   and returns a list of `seeds`, as `vector_env` draw them, and `policy`, what plays.
#' @param record As [new_record()] returns it; it has what was played also when an error
#'   or an interrupt ends the playing.
#' @noRd
play_episodes <- function(vector_env, record, begin, max_steps = NULL, keep_steps = FALSE) {
  while (record$begun < record$wanted) {
    n <- as.integer(min(vector_env$block, record$wanted - record$begun))
    block <- length(record$blocks) + 1L
    begun <- begin(block, record$begun + seq_len(n))
    record$blocks[[block]] <- new_block(record$begun + seq_len(n), begun$seeds)
    record$begun <- record$begun + n
    play_block(
      vector_env, record$blocks[[block]], begun$policy, record, max_steps %||% Inf, keep_steps
    )
    record$after_block(record)
  }
}

new_block <- function(episodes, seeds) {
  n <- length(episodes)
  rlang::env(
    episodes = episodes, seeds = seeds, seed = seeds[seq_len(n)], sub_env = seq_len(n),
    return = numeric(n), length = integer(n), terminated = logical(n), truncated = logical(n),
    steps = list(), frames = list()
  )
}

# All episodes of a block begin together, so that those that still play have taken as
# many steps.
play_block <- function(vector_env, block, policy, record, max_steps, keep_steps) {
  playing <- block$sub_env
  observation <- sub_env_rows(vector_env$observation_space, vector_env$reset(block$seeds), playing)
  keep_frame(block, vector_env)
  if (block$episodes[[1L]] == 1L) {
    ask_beforehand(policy, observation, playing, vector_env)
  }
  returns <- numeric(length(playing))
  at <- 0L
  while (length(playing)) {
    action <- act_sub_envs(policy, observation, playing, vector_env)
    out <- vector_env$step(action, playing)
    at <- at + 1L
    keep_frame(block, vector_env)
    returns <- returns + out$reward
    if (keep_steps) {
      block$steps[[at]] <- list(
        sub_env = playing, observation = observation, action = action, reward = out$reward,
        terminated = out$terminated, truncated = out$truncated
      )
    }
    observation <- out$observation
    ended <- out$terminated | out$truncated | at >= max_steps
    if (any(ended)) {
      end_episodes(block, playing[ended], returns[ended], at, lapply(out[flags], `[`, ended))
      record$on_end(record, block$episodes[playing[ended]], returns[ended])
      going <- which(!ended & block$episodes[playing] <= record$wanted)
      playing <- playing[going]
      returns <- returns[going]
      observation <- sub_env_rows(vector_env$observation_space, observation, going)
    }
  }
}

flags <- c("terminated", "truncated")

# Sub-environments that draw are single, and their blocks have one episode each.
keep_frame <- function(block, vector_env) {
  if (!is.null(vector_env$frame)) {
    block$frames[[length(block$frames) + 1L]] <- vector_env$frame()
  }
}

# One that neither terminated nor was truncated by the environment was cut short here.
end_episodes <- function(block, sub_env, returns, at, out) {
  block$return[sub_env] <- returns
  block$length[sub_env] <- at
  block$terminated[sub_env] <- out$terminated
  block$truncated[sub_env] <- out$truncated | !out$terminated
}

# Tables --------------------------------------------------------------------------

#' Put the episodes of a record into a table
#' @param n How many, from the first.
#' @noRd
episodes_table <- function(record, n = record$begun) {
  column <- function(name, type) {
    c(type, unlist(lapply(record$blocks, function(block) block[[name]])))[seq_len(n)]
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

#' Put the steps of a record into a table, episode after episode
#' @noRd
steps_table <- function(record, episodes, vector_env) {
  steps <- do.call(c, lapply(record$blocks, function(block) {
    lapply(block$steps, function(step) c(list(episode = block$episodes[step$sub_env]), step))
  }))
  column <- function(name) unlist(lapply(steps, function(step) step[[name]]))
  values <- function(name, space) bind_sub_envs(space, lapply(steps, function(step) step[[name]]))
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
