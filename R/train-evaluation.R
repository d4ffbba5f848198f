# Evaluates the agent's own policy, and decides when training ends.

# Training uses the seeds of episodes up to this number, and evaluations use those above it. The
# upper half of these is for the final evaluation. So no evaluation plays an episode of the
# training, and the final evaluation plays no episode of another evaluation.
last_training_seed <- 2^30

draw_training_seeds <- function(n) sample.int(last_training_seed, n, replace = TRUE)

# Targets that differ from the environment's reward threshold; see ?train_agent.
own_targets <- list(
  `HalfCheetah-v5` = 3430, `Hopper-v5` = 3120, `Pendulum-v1` = -200, `Swimmer-v5` = 325
)

training_target <- function(settings, spec) {
  settings$target %||% own_targets[[spec$id]] %||% spec$reward_threshold
}

#' Has the training reached its target?
#'
#' In a search, the round that reaches the target decides. In any other training, an evaluation
#' does.
#' @noRd
training_ends <- function(state, vector_env, settings) {
  if (settings$search) {
    return(state$solved <- reaches(state$history[[state$iteration]]$mean_return, settings$target))
  }
  last <- utils::tail(state$evaluations, 1L)
  if (length(last) && is_exact(last[[1L]])) {
    # Exact evaluations in a large model take time; see steps_between_evaluations().
    at <- last[[1L]]$iteration
    before <- if (at) state$history[[at]]$steps else 0
    if (state$steps - before < settings$eval_steps) {
      return(FALSE)
    }
  }
  reached <- reaches(recent_return(state), settings$target)
  if (!reached && state$iteration %% settings$eval_every == 0) {
    curve <- evaluate_agent(state, vector_env, settings, "curve")
    reached <- reaches(curve$mean_return, settings$target)
  }
  if (reached) {
    stopping <- evaluate_agent(state, vector_env, settings, "stopping")
    state$solved <- reaches(stopping$mean_return, settings$target)
  }
  state$solved
}

# DQN plays a single episode an iteration, and one lucky episode does not justify an evaluation. For
# an agent that gets trajectories, the last iterations therefore count together, as many as have at
# least this many episodes. PPO plays no fewer in one iteration.
enough_episodes <- 8L

recent_return <- function(state) {
  if (learns_online(state$agent) || !"trajectories" %in% agent_needs(state$agent)) {
    return(state$history[[state$iteration]]$mean_return)
  }
  recent <- utils::tail(state$history, enough_episodes)
  of <- function(name) vapply(recent, `[[`, 0, name)
  before <- state$iteration - length(recent)
  steps <- diff(c(if (before) state$history[[before]]$steps else 0, of("steps")))
  episodes <- round(steps / of("mean_length"))
  later <- rev(cumsum(rev(episodes))) - episodes
  counts <- later < enough_episodes
  stats::weighted.mean(of("mean_return")[counts], episodes[counts])
}

#' Evaluate the agent's policy, in new episodes or exactly by a model
#' @param kind The purpose: `"curve"`, `"stopping"` or `"final"`.
#' @return A row of the training's evaluations.
#' @noRd
evaluate_agent <- function(state, vector_env, settings, kind) {
  episodes <- settings$eval_episodes
  if (kind == "curve") episodes <- min(settings$eval_episodes_curve, episodes)
  if (episodes == 0) {
    return(NULL)
  }
  policy <- judged_policy(settings, state$agent)
  final <- kind == "final"
  last <- utils::tail(state$evaluations, 1L)
  row <- if (length(last) && is_exact(last[[1L]]) && last[[1L]]$iteration == state$iteration) {
    # The policy has not changed since that evaluation, so its value is the same.
    replace(last[[1L]], "kind", kind)
  } else {
    exact <- if (!is.null(settings$model)) {
      evaluate_exactly(settings$model, policy, settings$max_steps)
    }
    played <- exact %||% play_evaluation(state, vector_env, settings, policy, episodes, final)
    evaluation_row(state$iteration, kind, played)
  }
  row.names(row) <- NULL
  state$evaluations[[length(state$evaluations) + 1L]] <- row
  if (state$iteration > 0L && !final) {
    state$history[[state$iteration]]$evaluation <- row$mean_return
  }
  row
}

# A row of a training's evaluations, from the only row of an evaluation.
evaluation_row <- function(iteration, kind, evaluation) {
  row <- data.frame(iteration = iteration, kind = kind)
  of_policy <- setdiff(names(no_evaluations), names(row))
  row[of_policy] <- unclass(evaluation)[of_policy]
  row
}

# The policy that is evaluated and returned. By the tutorial's rule a candidate is judged as it is.
judged_policy <- function(settings, agent) {
  policy <- agent_policy(agent)
  greedy <- !settings$search && identical(settings$evaluate, "greedy")
  if (greedy) greedy_policy(policy) else policy
}

play_evaluation <- function(state, vector_env, settings, policy, episodes, final) {
  if (!is.null(vector_env$make_evaluated)) vector_env <- vector_env$make_evaluated()
  # The final evaluation draws from a copy of the streams: a training that is resumed with a larger
  # budget then evaluates like one that had it from the start. The first evaluation also draws from
  # a copy, so that it does not change later ones.
  streams <- state$evaluation_streams
  if (final || !state$iteration) streams <- restore_streams(saved_streams(streams))
  half <- last_training_seed / 2
  before <- last_training_seed + if (final) half - 1 else 0
  history <- new_history(1L, episodes, streams)
  history$draw_seeds <- function(n) as.integer(before + sample.int(half - 1, n, replace = TRUE))
  limit <- evaluation_limit(state, vector_env, settings)
  vector_env <- env_for_policy(vector_env, policy, limit)
  play_batches(vector_env, history, function(which) policy, max_steps = limit)
  episodes <- episodes_table(history$batches)
  cut_off <- sum(episodes$length >= limit)
  if (is.null(settings$max_steps) && cut_off && !isTRUE(state$told_limit)) {
    state$told_limit <- TRUE
    cli::cli_inform(
      c(i = 'An evaluation cut off {cut_off} of {count_of(nrow(episodes), "episode")} after
             {count_of(limit, "step")}; `max_steps` sets another limit.'),
      class = "gym_message_cut_off"
    )
  }
  evaluate_episodes(episodes, policy)
}

# Without a limit an episode might never end: a policy may never start the game of Breakout. See
# ?train_agent.
evaluation_limit <- function(state, vector_env, settings) {
  if (!is.null(settings$max_steps) || !is.null(vector_env$spec$max_episode_steps)) {
    return(settings$max_steps %||% Inf)
  }
  longest <- max(0, vapply(state$history, `[[`, 0, "mean_length"))
  max(1000, ceiling(10 * longest))
}
