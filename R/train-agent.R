# train_agent(): the loop that trains agents.

# Seeds of episodes: those of training are below this number, those of evaluations above it, so that
# no evaluation plays an episode that the training has seen. Of these the final evaluation has the
# upper half.
first_evaluation_seed <- 2^30

#' Train an agent
#'
#' Asks the agent for candidates, plays each of them, and tells it what came of it, iteration after
#' iteration, until the budget is used up or the target reached.
#'
#' @param agent The agent, as [agent_ars()], [agent_cem()] or [agent_hill_climb()] make it, or one of
#'   your own, see [agent_ask()].
#' @param env The environment, as for [rollout()].
#' @param policy The policy whose weights are to be found: a network, by default [policy_linear()].
#' @param iterations,steps After how many iterations, or steps of the environment in training, to
#'   end, whole numbers of at least 1. The iteration in which the steps are used up is played to its
#'   end. At least one of the two must be given.
#' @param episodes How many episodes each candidate plays in an iteration, a whole number of at
#'   least 1; the default is 1.
#' @param target The mean return at which training ends, a number. `NULL`, the default, takes the
#'   environment's own, where it has one; `Inf` goes on until the budget is used up.
#' @param max_steps As for [rollout()].
#' @param eval_every After how many iterations the agent's own policy plays some episodes, whose
#'   mean return is the learning curve, a whole number of at least 1; the default is 10.
#' @param eval_episodes How many episodes decide whether training ends, and how many the final
#'   evaluation has, a whole number of at least 2; the default is 100.
#' @param seed As for [rollout()].
#' @param callback A function that is called after each iteration with the training so far, as it
#'   would be returned; training ends when it returns `FALSE`.
#' @param progress,client As for [rollout()].
#' @param num_envs,num_workers As for [rollout()].
#' @return An object of class `gym_training`.
#' @export
train_agent <- function(agent, env, policy = policy_linear(), iterations = NULL, steps = NULL,
                        episodes = 1, target = NULL, max_steps = NULL, eval_every = 10,
                        eval_episodes = 100, seed = NULL, callback = NULL,
                        progress = rlang::is_interactive(), num_envs = NULL, num_workers = NULL,
                        client = gym_client()) {
  call <- rlang::current_env()
  settings <- training_settings(
    agent, env, policy, iterations, steps, episodes, target, max_steps, eval_every, eval_episodes,
    seed, callback
  )
  check_flag(progress)
  settings$seed <- seed %||% draw_seed()
  play <- function(vector_env) {
    settings["target"] <- list(target %||% vector_env$spec$reward_threshold)
    settings$env_id <- environment_label(vector_env)
    bound <- policy_bind(policy, vector_env, call = call)
    state <- new_training(agent_start(agent, bound), settings)
    run_training(state, vector_env, settings, call)
    training_result(state, settings)
  }
  with_vector_env(env, eval_episodes, play, max_steps, num_envs = num_envs,
                  num_workers = num_workers, client = client, call = call)
}

training_settings <- function(agent, env, policy, iterations, steps, episodes, target, max_steps,
                              eval_every, eval_episodes, seed, callback,
                              call = rlang::caller_env()) {
  if (!inherits(agent, "gym_agent")) {
    abort_argument(agent, "an agent, as `agent_ars()` makes it", "agent", call)
  }
  check_environment(env, call = call)
  check_policy(policy, call = call)
  check_count(iterations, allow_null = TRUE, call = call)
  check_number(steps, min = 1, allow_null = TRUE, call = call)
  if (is.null(iterations) && is.null(steps)) {
    gym_abort("Training needs an end: give `iterations` or `steps`.",
              class = "gym_error_argument", argument = "iterations", call = call)
  }
  check_count(episodes, call = call)
  check_number(target, allow_null = TRUE, call = call)
  check_count(max_steps, allow_null = TRUE, call = call)
  check_count(eval_every, call = call)
  check_count(eval_episodes, min = 2, call = call)
  check_seed(seed, call = call)
  if (!is.null(callback) && !is.function(callback)) {
    abort_argument(callback, "a function or NULL", "callback", call)
  }
  list(
    policy = policy, iterations = iterations %||% Inf, steps = steps %||% Inf,
    episodes = as.integer(episodes), max_steps = max_steps, eval_every = eval_every,
    eval_episodes = as.integer(eval_episodes), callback = callback, env = env, target = target
  )
}

# What changes while an agent is trained. Between iterations it is all that is needed to go on.
new_training <- function(agent, settings) {
  streams <- new_streams(settings$seed)
  rlang::env(
    agent = agent, iteration = 0L, steps = 0, streams = streams,
    # Evaluations draw from streams of their own, so that training does not depend on them.
    evaluation_streams = new_streams(with_generator(new_generator(settings$seed), draw_seed())),
    history = list(), evaluations = list(), final = NULL, solved = FALSE,
    started = proc.time()[["elapsed"]]
  )
}

run_training <- function(state, vector_env, settings, call) {
  repeat {
    train_iteration(state, vector_env, settings, call)
    if (training_ends(state, vector_env, settings)) {
      break
    }
  }
  state$final <- evaluate_agent(state, vector_env, settings, settings$eval_episodes, final = TRUE)
}

train_iteration <- function(state, vector_env, settings, call) {
  agent <- state$agent
  asked <- with_generator(state$streams$agent, agent_ask(agent))
  policy <- agent_policy(agent)
  candidates <- policy_candidates(policy, asked)
  history <- new_history(nrow(asked), settings$episodes, state$streams)
  history$draw_seeds <- function(n) sample.int(first_evaluation_seed, n, replace = TRUE)
  play_batches(
    vector_env, history, function(which) policy_subset(candidates, which),
    max_steps = settings$max_steps %||% Inf, keep_moments = !is.null(policy$moments)
  )
  results <- training_results(history, asked, settings, call)
  suspendInterrupts({
    state$agent <- agent_tell(agent, results)
    state$iteration <- state$iteration + 1L
    state$steps <- state$steps + results$steps
    state$history[[state$iteration]] <- list(
      iteration = state$iteration, steps = state$steps,
      min_return = min(results$returns), median_return = stats::median(results$returns),
      mean_return = mean(results$returns), max_return = max(results$returns),
      evaluation = NA_real_, elapsed = proc.time()[["elapsed"]] - state$started
    )
  })
}

training_results <- function(history, asked, settings, call) {
  column <- function(name) {
    values <- unlist(lapply(history$batches, function(batch) batch[[name]]))
    matrix(values, settings$episodes)
  }
  returns <- colMeans(column("return"))
  if (anyNA(returns)) {
    gym_abort(
      paste0("The return of candidate ", which(is.na(returns))[[1L]], " is not a number."),
      class = "gym_error_return", call = call
    )
  }
  lengths <- column("length")
  list(
    weights = asked, returns = returns, lengths = colMeans(lengths), steps = sum(lengths),
    moments = Reduce(merge_moments, lapply(history$batches, function(batch) batch$moments))
  )
}

# Looks at the agent's own policy every so often. Where training has reached the target, an
# evaluation on fresh episodes decides.
training_ends <- function(state, vector_env, settings) {
  row <- state$history[[state$iteration]]
  reached <- reaches(row$mean_return, settings$target)
  if (!reached && state$iteration %% settings$eval_every == 0) {
    few <- evaluate_agent(state, vector_env, settings, min(10L, settings$eval_episodes))
    state$history[[state$iteration]]$evaluation <- few$mean_return
    reached <- reaches(few$mean_return, settings$target)
  }
  if (reached) {
    all <- evaluate_agent(state, vector_env, settings, settings$eval_episodes)
    state$history[[state$iteration]]$evaluation <- all$mean_return
    state$solved <- reaches(all$mean_return, settings$target)
  }
  stopped <- !is.null(settings$callback) &&
    isFALSE(settings$callback(training_result(state, settings)))
  state$solved || stopped || state$iteration >= settings$iterations ||
    state$steps >= settings$steps
}

evaluate_agent <- function(state, vector_env, settings, episodes, final = FALSE) {
  policy <- agent_policy(state$agent)
  history <- new_history(1L, episodes, state$evaluation_streams)
  half <- first_evaluation_seed / 2
  from <- first_evaluation_seed + if (final) half else 0
  history$draw_seeds <- function(n) as.integer(from - 1 + sample.int(half, n, replace = TRUE))
  play_batches(
    vector_env, history, function(which) policy, max_steps = settings$max_steps %||% Inf
  )
  evaluation <- evaluate_episodes(episodes_table(history$batches), policy)
  evaluation <- cbind(
    data.frame(iteration = state$iteration, final = final), evaluation[-1L]
  )
  state$evaluations[[length(state$evaluations) + 1L]] <- evaluation
  evaluation
}

training_result <- function(state, settings) {
  structure(
    list(
      policy = agent_policy(state$agent), agent = state$agent, solved = state$solved,
      history = do.call(rbind, lapply(state$history, as.data.frame)),
      evaluations = do.call(rbind, state$evaluations), final = state$final,
      target = settings$target, env_id = settings$env_id, seed = settings$seed,
      steps = state$steps, elapsed = proc.time()[["elapsed"]] - state$started
    ),
    class = "gym_training"
  )
}
