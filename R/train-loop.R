# The loop that trains agents: ask the agent, play its candidates, tell it the results. A learner
# plays by itself (train-learner.R). train-evaluation.R decides when training ends.

#' Train until the end, an interrupt or an error; an error carries the finished part
#' @param state As train_in() makes it, with an agent that has started.
#' @param call The user's call.
#' @return As [training_result()].
#' @noRd
run_training <- function(state, vector_env, settings, progress, call) {
  show <- training_progress(settings, state, progress)
  play <- function() {
    # Evaluate the untrained policy, if its episodes are sure to end.
    limit <- settings$max_steps %||% vector_env$spec$max_episode_steps
    begins <- !state$iteration && !length(state$evaluations) && !is.null(limit)
    if (begins && !settings$search) evaluate_agent(state, vector_env, settings, "curve")
    while (!is_over(settings, state)) {
      train_iteration(state, vector_env, settings, call)
      state$ended <- training_ends(state, vector_env, settings)
      state$log()
      show()
      if (!is.null(settings$callback)) {
        stop_now <- isFALSE(settings$callback(training_result(settings, state)))
        state$ended <- state$ended || stop_now
      }
      state$checkpoint(last = settings$search && is_over(settings, state))
    }
    if (!settings$search && is.null(state$final)) {
      state$final <- evaluate_agent(state, vector_env, settings, "final")
      state$log()
      state$checkpoint(last = TRUE)
    }
  }
  what <- settings$what
  interrupted <- tryCatch(
    until_interrupted(
      play(),
      paste("The", what, "was interrupted after {finished}; the finished part is returned."),
      function() played_text(settings, state)
    ),
    error = function(cnd) {
      abort_with_result(
        cnd, paste("The", what), training_result(settings, state), played_text(settings, state),
        unique(paste0("gym_error_", c(what, "training"))), call,
        if (!is.null(state$path)) {
          paste0("After a fix, the same call resumes from \"", state$path, "\".")
        }
      )
    }
  )
  training_result(settings, state, interrupted)
}

is_over <- function(settings, state) {
  state$ended || state$iteration >= (settings$iterations %||% Inf) ||
    state$steps >= (settings$total_steps %||% Inf)
}

# "3 of 20 iterations"
played_text <- function(settings, state) {
  of_all <- if (!is.null(settings$iterations)) paste(state$iteration, "of ")
  paste0(of_all, count_of(settings$iterations %||% state$iteration, settings$unit))
}

train_iteration <- function(state, vector_env, settings, call) {
  if (learns_in_play(state, vector_env, settings)) {
    results <- learn_episodes(state, vector_env, settings, call)
    return(enter_iteration(state, settings, results$agent, results, results$lengths))
  }
  agent <- state$agent
  if (settings$search) agent$candidates <- rounds_together(state, vector_env, settings)
  needs <- agent_needs(agent)
  known <- c("returns", "moments", "trajectories")
  if (!is.character(needs) || !all(needs %in% known)) {
    must <- paste("some of", paste0("\"", known, "\"", collapse = ", "))
    abort_agent(needs, "agent_needs()", must, call)
  }
  # A method of agent_behavior() may draw random numbers.
  candidates <- with_generator(state$streams$agent, agent_behavior(agent))
  asked <- if (inherits(candidates, "gym_policy_network")) {
    asked_weights(state, agent, count_weights(candidates), call)
  }
  if (!is.null(asked)) candidates <- new_candidates(candidates, asked)
  episodes <- agent_episodes(agent, settings$episodes)
  history <- new_history(count_candidates(candidates) %||% 1L, episodes, state$streams)
  if (!settings$search) history$draw_seeds <- draw_training_seeds
  limit <- settings$max_steps %||% Inf
  keep_steps <- "trajectories" %in% needs
  play_batches(
    env_for_policy(vector_env, candidates, limit, keep_steps), history,
    function(which) policy_subset(candidates, which),
    report = function(ended) state$report(history$played_episodes + ended), max_steps = limit,
    # After a candidate has reached the target, the later ones need not be played.
    target = if (settings$search) settings$target,
    keep_moments = "moments" %in% needs, keep_steps = keep_steps, keep_next = keep_steps
  )
  results <- candidate_results(history, asked, call)
  if (keep_steps) {
    # The steps of all candidates, episode after episode.
    played <- episodes_table(history$batches, several = TRUE)
    steps <- steps_in_order(history$batches, played, vector_env, next_observation = TRUE)
    of_steps <- lapply(played[c("candidate", "episode")], `[`, steps$row)
    results$trajectories <- c(of_steps, steps[-1L])
  }
  steps <- round(results$lengths * history$episodes)
  agent <- with_generator(state$streams$agent, agent_tell(agent, results))
  check_is_agent(agent, "agent_tell()", call)
  episodes <- if (settings$search) episodes_table(history$batches, several = TRUE)
  # For an agent that learns from steps, the history has the results of its episodes, not the means
  # of candidates.
  if (keep_steps) results[c("returns", "lengths")] <- episode_results(history)
  enter_iteration(state, settings, agent, results, steps, episodes)
}

# The weights of the candidates, a row for each. `NULL` if the behavior policy itself is played.
asked_weights <- function(state, agent, count, call) {
  asked <- with_generator(state$streams$agent, agent_ask(agent))
  if (is.null(asked)) {
    return(NULL)
  }
  asked <- plain_numbers(asked, "agent_ask()", call)
  if (!is.matrix(asked) || !is.numeric(asked) || ncol(asked) != count || !nrow(asked)) {
    must <- paste("a numeric matrix with", count_of(count, "column"))
    abort_agent(asked, "agent_ask()", must, call)
  }
  if (!all(is.finite(asked))) {
    abort_agent(asked, "agent_ask()", "finite numbers", call)
  }
  storage.mode(asked) <- "double"
  asked
}

# A search plays as many rounds in parallel as a batch of episodes has room for.
rounds_together <- function(state, vector_env, settings) {
  left <- (settings$iterations %||% Inf) - state$iteration
  room <- if (length(vector_env$remembers)) Inf else vector_env$batch_size %/% settings$episodes
  together <- max(1, min(left, room))
  if (is.finite(together)) as.integer(together) else 1L
}

#' Add the played iteration to the history
#'
#' After an interrupt it is added completely or not at all.
#' @param steps The number of steps of each candidate, or of each episode of a learner.
#' @param episodes The table of a search's episodes.
#' @noRd
enter_iteration <- function(state, settings, agent, results, steps, episodes = NULL) {
  if (settings$search) {
    # Each candidate is an iteration; its own time is not known if several are played in parallel.
    history <- Map(
      history_row, state$iteration + seq_along(steps), state$steps + cumsum(steps),
      results$returns, steps / settings$episodes, NA_real_
    )
    episodes$candidate <- episodes$candidate + state$iteration
  } else {
    elapsed <- now() - state$started
    row <- history_row(
      state$iteration + 1L, state$steps + sum(steps), results$returns, results$lengths, elapsed
    )
    history <- list(c(row, as.list(agent_log(agent))))
  }
  last <- history[[length(history)]]
  suspendInterrupts({
    state$agent <- agent
    state$iteration <- last$iteration
    state$steps <- last$steps
    if (settings$search) state$episodes[[length(state$episodes) + 1L]] <- episodes
    state$history[seq_along(history) + length(state$history)] <- history
  })
}

history_row <- function(iteration, steps, returns, lengths, elapsed) {
  list(
    iteration = iteration, steps = steps, min_return = min(returns),
    median_return = stats::median(returns), mean_return = mean(returns),
    max_return = max(returns), mean_length = mean(lengths), evaluation = NA_real_,
    elapsed = elapsed
  )
}

check_is_agent <- function(agent, method, call) {
  if (!inherits(agent, "gym_agent")) {
    abort_agent(agent, method, "an agent", call)
  }
}

abort_agent <- function(value, method, must, call) {
  gym_abort(
    paste0("`", method, "` must return ", must, ", not ", describe_argument(value), "."),
    class = "gym_error_agent", value = value, call = call
  )
}

# Returns the results of an agent's candidates. After the candidate that ended a search, none were
# played.
candidate_results <- function(history, asked, call) {
  results <- lapply(episode_results(history), function(x) colMeans(matrix(x, history$episodes)))
  returns <- results$returns
  if (!all(is.finite(returns))) {
    wrong <- which(!is.finite(returns))[[1L]]
    gym_abort(
      paste0("The mean return of candidate ", wrong, " of ", length(returns), " is ",
             returns[[wrong]], ": a reward of the environment was not a finite number."),
      class = "gym_error_agent", candidate = wrong,
      weights = if (!is.null(asked)) asked[wrong, ], call = call
    )
  }
  if (length(returns) < NROW(asked)) {
    asked <- asked[seq_along(returns), , drop = FALSE]
  }
  list(
    weights = asked, returns = returns, lengths = results$lengths,
    moments = Reduce(
      merge_moments,
      unlist(lapply(history$batches, function(batch) batch$moments), recursive = FALSE)
    )
  )
}

# With `target = Inf` training uses its whole budget.
has_target <- function(x) !is.null(x$target) && is.finite(x$target)

reaches <- function(mean_return, target) !is.null(target) && isTRUE(mean_return >= target)

# Makes a progress bar. Returns a function that is called after each iteration. During a batch of
# rounds of a search, it also gets the number of finished episodes.
training_progress <- function(settings, state, progress, frame = parent.frame()) {
  by_steps <- is.null(settings$iterations)
  unit <- if (by_steps) "Step" else if (settings$search) "Round" else "Iteration"
  total <- settings$iterations %||% settings$total_steps
  bar <- progress_bar(total, unit, shown = progress, frame = frame)
  # Without a bar, a message after a while says how long the training may take, once.
  told <- begun <- progress
  started <- now()
  before <- if (by_steps) state$steps else state$iteration
  show <- function(episodes = 0) {
    finished <- if (by_steps) {
      min(state$steps, settings$total_steps)
    } else {
      state$iteration + episodes %/% settings$episodes
    }
    best <- state$agent$best_return
    bar(finished, if (settings$search) {
      paste0("best mean return ", if (is.finite(best)) number_text(best) else "-", ", ")
    } else {
      iteration_note(state)
    })
    elapsed <- now() - started
    told <<- told || inform_of_pace(finished - before, total - before, unit, elapsed)
  }
  state$report <- if (settings$search) {
    show
  } else {
    function(episodes) {
      # The first iteration may take long, so report that training has begun.
      elapsed <- now() - started
      if (!begun && state$iteration == 0L) begun <<- inform_of_start(episodes, elapsed)
    }
  }
  if (state$iteration > 0L) show()
  show
}

# Without a progress bar, report after `pace_after` seconds, if at least `pace_left` are left.
pace_after <- 5
pace_left <- 60

# Return TRUE if a message was shown.
inform_of_start <- function(episodes, elapsed) {
  tells <- elapsed >= pace_after && prints_times()
  if (tells) {
    cli::cli_inform(
      c(i = 'Training has begun: {count_of(episodes, "episode")} of the first iteration in
             {seconds_text(elapsed)}.'),
      class = "gym_message_pace"
    )
  }
  tells
}

inform_of_pace <- function(finished, total, unit, elapsed) {
  left <- elapsed * (total / finished - 1)
  tells <- finished > 0 && elapsed >= pace_after && left >= pace_left && prints_times()
  if (tells) {
    cli::cli_inform(
      c(i = "Trained for {whole_number_text(finished)} of {count_of(total, tolower(unit))} in
             {seconds_text(elapsed)}; at this rate the rest takes {seconds_text(left)}.",
        i = "`progress = TRUE` shows a bar."),
      class = "gym_message_pace"
    )
  }
  tells
}

iteration_note <- function(state) {
  row <- state$history[[state$iteration]]
  last <- length(state$evaluations)
  paste0(
    "median ", number_text(row$median_return), ", best ", number_text(row$max_return),
    if (last) paste0(", evaluation ", number_text(state$evaluations[[last]]$mean_return)),
    ", ", number_text(row$steps / max(row$elapsed, 1e-3)), " steps/s, ", workers_note()
  )
}
