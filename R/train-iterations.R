# The one loop that plays agents: ask the agent, play its candidates, tell it what came of it.
#
# When it ends, what is looked at in between and what it returns are a rule, of which there are two:
# settings of class "gym_training_settings" evaluate the agent's policy (train-evaluation.R), those
# of class "gym_search_settings" keep the rule of the post, in which the first candidate that
# reaches the target ends the search (train-search-rule.R).

#' Make what changes while an agent is trained
#'
#' @param agent The agent, as [agent_start()] returns it.
#' @return An environment. Between iterations what `kept_of_training` names, with the streams, is
#'   all that is needed to go on.
#' @noRd
new_training <- function(agent, settings) {
  generator <- new_generator(settings$seed)
  rlang::env(
    agent = agent, iteration = 0L, steps = 0, history = list(), evaluations = list(),
    episodes = list(), final = NULL, solved = FALSE, ended = FALSE,
    streams = new_streams(settings$seed),
    # Evaluations draw from streams of their own, so that training does not depend on them.
    evaluation_streams = new_streams(with_generator(generator, draw_seed())),
    started = proc.time()[["elapsed"]],
    report = function(history) NULL, log = function(state) NULL,
    checkpoint = function(last = FALSE) NULL
  )
}

# The rule of a training ------------------------------------------------------------

# What the two kinds of settings have methods of.

# Has the budget been used up?
is_used_up <- function(settings, state) UseMethod("is_used_up")

# The agent that is asked next.
agent_to_ask <- function(settings, state, vector_env) UseMethod("agent_to_ask")

# A function that draws the seeds of n episodes.
seed_drawer <- function(settings) UseMethod("seed_drawer")

# After an iteration: does training end?
training_ends <- function(settings, state, vector_env) UseMethod("training_ends")

# When it has ended.
finish_training <- function(settings, state, vector_env) UseMethod("finish_training")

# What is returned.
training_result <- function(settings, state, interrupted = FALSE) UseMethod("training_result")

# A progress bar: a function of the training that is called after each iteration. While one is
# played `state$report` is called with its history.
training_progress <- function(settings, state, progress, frame = parent.frame()) {
  UseMethod("training_progress")
}

# What an error and, with `of_all`, an interrupt say: how much was played.
played_text <- function(settings, state, of_all = FALSE) UseMethod("played_text")

# The loop --------------------------------------------------------------------------

#' Train until the end, an interrupt or an error, which carries what was played
#' @param state As [new_training()] returns it.
#' @param call The user's call.
#' @return As [training_result()].
#' @noRd
run_training <- function(state, vector_env, settings, progress, call) {
  show <- training_progress(settings, state, progress)
  play <- function() {
    while (!state$ended && !is_used_up(settings, state)) {
      train_iteration(state, vector_env, settings, call)
      state$ended <- training_ends(settings, state, vector_env)
      state$log(state)
      show(state)
      if (!is.null(settings$callback)) {
        stop_now <- isFALSE(settings$callback(training_result(settings, state)))
        state$ended <- state$ended || stop_now
      }
      state$checkpoint()
    }
    finish_training(settings, state, vector_env)
  }
  what <- settings$what
  interrupted <- tryCatch(
    until_interrupted(
      play(), paste("The", what, "was interrupted after {finished}; it returns what it has."),
      function() played_text(settings, state, of_all = TRUE)
    ),
    error = function(cnd) {
      abort_with_result(
        cnd, paste("The", what), training_result(settings, state), played_text(settings, state),
        paste0("gym_error_", what), call,
        if (!is.null(state$path)) {
          paste0("The same call goes on from \"", state$path, "\" when what is wrong is fixed.")
        }
      )
    }
  )
  training_result(settings, state, interrupted)
}

train_iteration <- function(state, vector_env, settings, call) {
  if (learns_online(state$agent)) {
    results <- learn_episodes(state, vector_env, settings, call)
    return(enter_iteration(state, settings, results$agent, results, sum(results$lengths)))
  }
  agent <- agent_to_ask(settings, state, vector_env)
  asked <- with_generator(state$streams$agent, agent_ask(agent))
  policy <- agent_policy(agent)
  asked <- plain_numbers(asked, "agent_ask()", call)
  check_asked(asked, policy, agent, call)
  needs <- check_needs(agent_needs(agent), call)
  candidates <- policy_candidates(policy, asked)
  history <- new_history(nrow(asked), settings$episodes, state$streams)
  history$draw_seeds <- seed_drawer(settings)
  play_batches(
    vector_env, history, function(which) policy_subset(candidates, which),
    report = function(ended) state$report(history$played_episodes + ended),
    max_steps = settings$max_steps %||% Inf, target = settings$last_target,
    keep_moments = "moments" %in% needs, keep_steps = "trajectories" %in% needs,
    keep_next = "trajectories" %in% needs
  )
  results <- candidate_results(history, asked, call)
  if ("trajectories" %in% needs) {
    results$trajectories <- played_trajectories(history, vector_env)
  }
  agent <- with_generator(state$streams$agent, agent_tell(agent, results))
  check_is_agent(agent, "agent_tell()", call)
  episodes <- if (isTRUE(settings$keep_episodes)) episodes_table(history$batches, several = TRUE)
  enter_iteration(
    state, settings, agent, results, sum(results$lengths) * settings$episodes, episodes
  )
}

# An interrupt finds the iteration entered completely, or not at all.
enter_iteration <- function(state, settings, agent, results, steps, episodes = NULL) {
  steps <- state$steps + steps
  suspendInterrupts({
    state$agent <- agent
    state$iteration <- state$iteration + 1L
    state$steps <- steps
    state$results <- results
    if (!is.null(episodes)) {
      state$episodes[[state$iteration]] <- episodes
    }
    state$history[[state$iteration]] <- list(
      iteration = state$iteration, steps = steps,
      min_return = min(results$returns), median_return = stats::median(results$returns),
      mean_return = mean(results$returns), max_return = max(results$returns),
      mean_length = mean(results$lengths), evaluation = NA_real_,
      elapsed = proc.time()[["elapsed"]] - state$started
    )
  })
}

check_is_agent <- function(agent, method, call) {
  if (!inherits(agent, "gym_agent")) {
    abort_agent(agent, method, "an agent", call)
  }
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

check_needs <- function(needs, call) {
  known <- c("returns", "moments", "trajectories")
  if (!is.character(needs) || !all(needs %in% known)) {
    must <- paste("some of", paste0("\"", known, "\"", collapse = ", "))
    abort_agent(needs, "agent_needs()", must, call)
  }
  needs
}

# The steps of all candidates, as a rollout of them has them.
played_trajectories <- function(history, vector_env) {
  episodes <- episodes_table(history$batches, several = TRUE)
  steps_table(history$batches, episodes, vector_env, several = TRUE, next_observation = TRUE)
}

# What an agent is told of its candidates. Those after one that has ended the search were not
# played.
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
  if (length(returns) < nrow(asked)) {
    asked <- asked[seq_along(returns), , drop = FALSE]
  }
  list(
    weights = asked, returns = returns, lengths = each("length"),
    moments = Reduce(
      merge_moments,
      unlist(lapply(history$batches, function(batch) batch$moments), recursive = FALSE)
    )
  )
}

reaches <- function(mean_return, target) !is.null(target) && isTRUE(mean_return >= target)
