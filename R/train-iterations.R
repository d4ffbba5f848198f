# The iterations of a training: ask the agent, play its candidates, tell it what came of it.

# Seeds of episodes: those of training are up to this number, those of evaluations above it; of
# these the final evaluation has the upper half. So an evaluation plays no episode that the training
# has seen, and the final one none that any has.
last_training_seed <- 2^30

# How many episodes make a point of the learning curve.
curve_episodes <- 10L

# What changes while an agent is trained. Between iterations the first of these are all that is
# needed to go on.
new_training <- function(agent, settings) {
  generator <- new_generator(settings$seed)
  rlang::env(
    agent = agent, iteration = 0L, steps = 0, history = list(), evaluations = list(),
    final = NULL, solved = FALSE, ended = FALSE,
    streams = new_streams(settings$seed),
    # Evaluations draw from streams of their own, so that training does not depend on them.
    evaluation_streams = new_streams(with_generator(generator, draw_seed())),
    started = proc.time()[["elapsed"]]
  )
}

run_training <- function(state, vector_env, settings, progress, call) {
  show <- training_progress(settings, progress)
  play <- function() {
    while (!state$ended && !is_used_up(state, settings)) {
      train_iteration(state, vector_env, settings, call)
      state$ended <- training_ends(state, vector_env, settings)
      state$log(state)
      show(state)
      state$checkpoint()
    }
    if (is.null(state$final)) {
      state$final <- evaluate_agent(state, vector_env, settings, "final", settings$eval_episodes)
      state$checkpoint(last = TRUE)
    }
  }
  interrupted <- tryCatch(
    until_interrupted(
      play(),
      "The training was interrupted after {finished} iteration{?s}; it returns what it has.",
      function() state$iteration
    ),
    error = function(cnd) {
      abort_with_result(
        cnd, "The training", training_result(state, settings),
        count_of(state$iteration, "iteration"), "gym_error_training", call,
        if (!is.null(state$path)) {
          paste0("The same call goes on from \"", state$path, "\" when what is wrong is fixed.")
        }
      )
    }
  )
  training_result(state, settings, interrupted)
}

is_used_up <- function(state, settings) {
  state$iteration >= (settings$iterations %||% Inf) || state$steps >= (settings$steps %||% Inf)
}

train_iteration <- function(state, vector_env, settings, call) {
  agent <- state$agent
  asked <- with_generator(state$streams$agent, agent_ask(agent))
  policy <- agent_policy(agent)
  check_asked(asked, policy, agent, call)
  candidates <- policy_candidates(policy, asked)
  history <- new_history(nrow(asked), settings$episodes, state$streams)
  history$draw_seeds <- function(n) sample.int(last_training_seed, n, replace = TRUE)
  play_batches(
    vector_env, history, function(which) policy_subset(candidates, which),
    max_steps = settings$max_steps %||% Inf, keep_moments = !is.null(policy$moments)
  )
  results <- candidate_results(history, asked, call)
  agent <- agent_tell(agent, results)
  if (!inherits(agent, "gym_agent")) {
    abort_agent(agent, "agent_tell()", "an agent", call)
  }
  steps <- state$steps + sum(results$lengths) * settings$episodes
  # An interrupt finds the iteration entered completely, or not at all.
  suspendInterrupts({
    state$agent <- agent
    state$iteration <- state$iteration + 1L
    state$steps <- steps
    state$history[[state$iteration]] <- list(
      iteration = state$iteration, steps = steps,
      min_return = min(results$returns), median_return = stats::median(results$returns),
      mean_return = mean(results$returns), max_return = max(results$returns),
      mean_length = mean(results$lengths), evaluation = NA_real_,
      elapsed = proc.time()[["elapsed"]] - state$started
    )
  })
}

check_asked <- function(asked, policy, agent, call) {
  count <- length(stats::coef(policy))
  if (!is.matrix(asked) || !is.numeric(asked) || ncol(asked) != count || !nrow(asked)) {
    must <- paste("a numeric matrix with", count_of(count, "column"))
    abort_agent(asked, "agent_ask()", must, call)
  }
  if (!all(is.finite(asked))) {
    abort_agent(asked, "agent_ask()", "finite numbers", call)
  }
}

abort_agent <- function(value, method, must, call) {
  gym_abort(
    paste0("`", method, "` must return ", must, ", not ", describe_argument(value), "."),
    class = "gym_error_agent", value = value, call = call
  )
}

# What an agent is told of its candidates.
candidate_results <- function(history, asked, call) {
  each <- function(name) {
    values <- unlist(lapply(history$batches, function(batch) batch[[name]]))
    colMeans(matrix(values, history$episodes))
  }
  returns <- each("return")
  if (!all(is.finite(returns))) {
    wrong <- which(!is.finite(returns))[[1L]]
    gym_abort(
      paste0("The mean return of candidate ", wrong, " of ", length(returns), " is ",
             returns[[wrong]], ": a reward of the environment was no finite number."),
      class = "gym_error_agent", candidate = wrong, weights = asked[wrong, ], call = call
    )
  }
  list(
    weights = asked, returns = returns, lengths = each("length"),
    moments = Reduce(merge_moments, lapply(history$batches, function(batch) batch$moments))
  )
}

# Ending -------------------------------------------------------------------------------

training_ends <- function(state, vector_env, settings) {
  reached <- reaches(state$history[[state$iteration]]$mean_return, settings$target)
  if (!reached && state$iteration %% settings$eval_every == 0) {
    episodes <- min(curve_episodes, settings$eval_episodes)
    curve <- evaluate_agent(state, vector_env, settings, "curve", episodes)
    reached <- reaches(curve$mean_return, settings$target)
  }
  if (reached) {
    stopping <- evaluate_agent(state, vector_env, settings, "stopping", settings$eval_episodes)
    state$solved <- reaches(stopping$mean_return, settings$target)
  }
  callback <- settings$callback
  state$solved || !is.null(callback) && isFALSE(callback(training_result(state, settings)))
}

#' Play the agent's policy in fresh episodes
#' @param kind What for: `"curve"`, `"stopping"` or `"final"`.
#' @return A row of the training's evaluations.
#' @noRd
evaluate_agent <- function(state, vector_env, settings, kind, episodes) {
  policy <- agent_policy(state$agent)
  # The final evaluation draws from copies: a training that goes on with a larger budget evaluates as
  # one that had it from the start.
  final <- kind == "final"
  streams <- state$evaluation_streams
  if (final) streams <- restore_streams(saved_streams(streams))
  half <- last_training_seed / 2
  before <- last_training_seed + if (final) half - 1 else 0
  history <- new_history(1L, episodes, streams)
  history$draw_seeds <- function(n) as.integer(before + sample.int(half - 1, n, replace = TRUE))
  play_batches(
    vector_env, history, function(which) policy, max_steps = settings$max_steps %||% Inf
  )
  played <- evaluate_episodes(episodes_table(history$batches), policy)
  row <- cbind(data.frame(iteration = state$iteration, kind = kind), played[-1L])
  row.names(row) <- NULL
  state$evaluations[[length(state$evaluations) + 1L]] <- row
  if (state$iteration > 0L && !final) {
    state$history[[state$iteration]]$evaluation <- row$mean_return
  }
  row
}

# Showing ------------------------------------------------------------------------------

# A function that is called after each iteration.
training_progress <- function(settings, progress, frame = parent.frame()) {
  if (!progress) {
    return(function(state) NULL)
  }
  by_steps <- is.null(settings$iterations)
  bar <- progress_bar(
    settings$iterations %||% settings$steps, if (by_steps) "Step" else "Iteration", frame = frame
  )
  function(state) {
    row <- state$history[[state$iteration]]
    evaluated <- if (length(state$evaluations)) {
      state$evaluations[[length(state$evaluations)]]$mean_return
    }
    bar(
      if (by_steps) min(state$steps, settings$steps) else state$iteration,
      paste0(
        "median ", number_text(row$median_return), ", best ", number_text(row$max_return),
        if (!is.null(evaluated)) paste0(", evaluation ", number_text(evaluated)),
        ", ", number_text(row$steps / max(row$elapsed, 1e-3)), " steps/s, "
      )
    )
  }
}
