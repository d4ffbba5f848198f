#' Write your own learner
#'
#' A learner is an agent that learns from each step instead of whole episodes. It is a plain list
#' with its own class before `"gym_learner"` and `"gym_agent"`, made by a function such as
#' `agent_mean()` below. Instead of [agent_ask()] and [agent_tell()] it has two generics: it acts,
#' the environment takes the step, and it observes the result. (The learners of this package, such
#' as [agent_q()], have faster internal functions.)
#'
#' One learner can play several sub-environments together, which all update the same table
#' (`train_agent(num_envs = )`). Then `agent_observe()` gets several transitions at once. The
#' learners of this package process them one after the other. The difference from one
#' sub-environment is that the environment takes all these steps before the learner learns from any
#' of them.
#'
#' @param agent The learner.
#' @param observation The observations, a batch as for a policy; see [act()].
#' @param sub_env The numbers of their sub-environments, integers.
#' @param transitions The results of a step, a list with an element for each sub-environment in each
#'   of
#'   \describe{
#'     \item{observation, action}{The observations and the actions, batches.}
#'     \item{reward}{A numeric vector.}
#'     \item{next_observation}{The observations after the step, a batch: at the end of an episode
#'       its last observation, never the first one of the next.}
#'     \item{terminated, truncated}{Whether the episode ended by the environment's own rules, or was
#'       cut off, logical vectors. The value of `next_observation` counts after a truncation, and is
#'       0 after a termination.}
#'     \item{first}{Whether it was the first step of an episode, a logical vector.}
#'     \item{sub_env}{The numbers of the sub-environments, integers.}
#'   }
#' @return `agent_act()` returns an action for each observation, `agent_observe()` the updated
#'   agent. Both draw from R's generator, which training sets.
#' @seealso [agent_start()] and [agent_policy()]; a learner has methods for these, too.
#'   `agent_start()` gets the environment's spaces as `policy$observation_space` and
#'   `policy$action_space`.
#' @export
#' @examples
#' # Keep the mean reward of each action, whatever the state, and try each action 10 times first.
#' agent_mean <- function() structure(list(), class = c("mean_reward", "gym_learner", "gym_agent"))
#' agent_start.mean_reward <- function(agent, policy) {
#'   agent$total <- agent$count <- numeric(policy$action_space$n)
#'   agent
#' }
#' agent_act.mean_reward <- function(agent, observation, sub_env) {
#'   rare <- which(agent$count < 10)
#'   best <- if (length(rare)) rare[[1]] else which.max(agent$total / agent$count)
#'   rep(best - 1L, length(sub_env))
#' }
#' agent_observe.mean_reward <- function(agent, transitions) {
#'   tried <- transitions$action[[1]] + 1
#'   agent$total[[tried]] <- agent$total[[tried]] + sum(transitions$reward)
#'   agent$count[[tried]] <- agent$count[[tried]] + length(transitions$reward)
#'   agent
#' }
#' agent_policy.mean_reward <- function(agent) {
#'   mean <- agent$total / pmax(agent$count, 1)
#'   policy_table(rbind(mean, mean))
#' }
#'
#' # A model with one state and the end of the episode.
#' coin <- gym_model(data.frame(
#'   state = 0, action = c(0, 1, 1), next_state = 1, probability = c(1, 0.5, 0.5),
#'   reward = c(1, 0, 3)
#' ), start = 0)
#' train_agent(agent_mean(), coin, iterations = 50, seed = 1)
agent_act <- function(agent, observation, sub_env) UseMethod("agent_act")

#' @rdname agent_act
#' @export
agent_observe <- function(agent, transitions) UseMethod("agent_observe")

learns_online <- function(agent) inherits(agent, "gym_learner")

# By default a learner plays in one sub-environment. Monte Carlo learns only after episodes, so on a
# server it plays in several. An environment that already exists keeps its number.
learner_envs <- function(env, agent) {
  served <- is_made_by_server(env)
  if (served && !inherits(agent, "gym_agent_monte_carlo") || is_registered(env) ||
        inherits(env, c("gym_model", "gym_r_env"))) {
    1L
  }
}

# Makes the policy that a learner's `agent_start()` gets: the given one, with the spaces, and, if
# there is a model, with the actions of each state.
spaces_policy <- function(policy, vector_env, model, call) {
  bound <- if (is.null(policy)) {
    structure(
      unclass(vector_env)[c("observation_space", "action_space")],
      class = c("gym_policy_unknown", "gym_policy")
    )
  } else {
    policy_bind(policy, vector_env, call = call)
  }
  bound$possible <- if (!is.null(model)) possible_actions(model)
  bound
}

#' @export
format.gym_policy_unknown <- function(x, ...) "the learner's own"

# Playing an iteration ----------------------------------------------------------------

#' Let a learner play the episodes of an iteration, and learn during play
#' @return A list: `agent`, updated, `returns` and `lengths` of the episodes.
#' @noRd
learn_episodes <- function(state, vector_env, settings, call) {
  agent <- state$agent
  state$uniform <- state$uniform %||% uniform_draws()
  state$uniform$renew()
  learner <- learner_of(agent, state$uniform$draw)
  if (is.null(learner)) {
    # A learner written by a user.
    by_methods <- list(
      act = function(observation, sub_env) agent_act(agent, observation, sub_env),
      observe = function(transitions) {
        check_rewards(transitions$reward, call)
        agent <<- agent_observe(agent, transitions)
        check_is_agent(agent, "agent_observe()", call)
      }
    )
    played <- episode_results(play_iteration(state, vector_env, settings, by_methods))
    return(c(list(agent = agent), played))
  }
  vector_env <- stepped(vector_env)
  if (!is.null(agent$mask)) {
    note <- function(observation, mask) forbid_actions(learner, agent, observation, mask, call)
    vector_env <- with_masks(vector_env, agent$mask, note, call)
  }
  played <- if (vector_env$num_envs == 1L) {
    if (is.null(vector_env$model) && plan_kind() != "none") inform_learner_plays_here()
    learn_alone(learner, state, vector_env, settings, call)
  } else {
    playing <- side_by_side(learner, agent, call)
    episode_results(play_iteration(state, vector_env, settings, playing))
  }
  c(list(agent = learner$export()), played)
}

# Whether a learner can learn from whole episodes after an iteration, by agent_tell().
plays_whole <- function(agent) {
  inherits(agent, "gym_agent_monte_carlo") &&
    learns_whole(agent$mask, agent$exploring_starts, agent$importance)
}

# Whether Monte Carlo with these arguments needs nothing but the steps of whole episodes.
learns_whole <- function(mask, exploring_starts, importance) {
  is.null(mask) && !isTRUE(exploring_starts) && identical(importance[1L] %||% "none", "none")
}

# Whether the agent learns during play. The answer is kept for the whole training.
learns_in_play <- function(state, vector_env, settings) {
  state$in_play <- state$in_play %||% (learns_online(state$agent) && !(
    plays_whole(state$agent) && plays_beside(
      vector_env, agent_policy(state$agent), settings$max_steps %||% Inf, keep_steps = TRUE
    )
  ))
  state$in_play
}

# Plays one episode after the other in a single sub-environment.
learn_alone <- function(learner, state, vector_env, settings, call) {
  world <- state$world
  if (is.null(world) || !is.null(state$agent$mask)) {
    world <- state$world <- world_of(vector_env, state$agent$basis, state$uniform$draw)
  }
  seeds <- with_generator(state$streams$seeds, draw_training_seeds(settings$episodes))
  stream <- new_generator(stream = take_stream(state$streams))
  limit <- model_limit(vector_env$model, settings$max_steps)
  guard <- world$guard %||% identity
  with_generator(stream, naming_call(
    guard(play_steps(learner, world, seeds, limit, state$report, call)), vector_env
  ))
}

# Plays the episodes of an iteration in the same loop as rollouts.
play_iteration <- function(state, vector_env, settings, learner) {
  history <- new_history(1L, settings$episodes, state$streams)
  history$draw_seeds <- draw_training_seeds
  play_batches(
    stepped(vector_env), history, function(which) NULL, learner = learner,
    max_steps = settings$max_steps %||% Inf,
    report = function(ended) state$report(history$played_episodes + ended)
  )
  history
}

# After one infinite reward, a learned value would stay infinite.
check_rewards <- function(reward, call) {
  if (!all(is.finite(reward))) {
    gym_abort(
      paste0("A reward of the environment is ", reward[!is.finite(reward)][[1L]],
             ", not a finite number."),
      class = "gym_error_agent", call = call
    )
  }
}

# Evaluating by a model ---------------------------------------------------------------

#' Get the model by which a learner's policy is evaluated, or `NULL`
#'
#' The server is asked only about environments given by their id that may have a model.
#' @noRd
judging_model <- function(settings, client) {
  env <- settings$env
  named <- rlang::is_string(env)
  served <- named && !is_registered(env)
  in_r <- inherits(env, c("gym_model", "gym_r_env")) || named && !served
  if (!in_r && !(served && grepl(modelled_ids, env))) {
    return(NULL)
  }
  model <- tryCatch(
    # inject() leaves `client` unevaluated, which an environment in R does not need.
    rlang::inject(env_model(env, !!!if (named) c(settings$kwargs, client = quote(client)))),
    gym_error_no_model = function(cnd) NULL,
    gym_error_http_400 = function(cnd) {
      # Taxi with a fickle passenger, for example, has no valid table.
      if (!identical(cnd$code, "not_supported")) rlang::cnd_signal(cnd)
    }
  )
  if (!is.null(model)) {
    if (served) model$versions <- server_versions(client)
    # Compute this once, because each evaluation needs it.
    model$backup <- backup_of(model, NULL)
  }
  model
}

modelled_ids <- "^(FrozenLake|CliffWalking|Taxi)"

# Sampling from a model ---------------------------------------------------------------

#' Find the model that a learner samples from instead of playing on the server
#' @param draws_map Whether the environment draws a map when it is made.
#' @return A model, `NULL` for none.
#' @noRd
sampled_model <- function(settings, draws_map, call) {
  env <- settings$env
  model <- settings$model
  needs_server <- c(
    settings$agent$mask, settings$num_workers, settings$callback,
    intersect(setdiff(how_made, "max_episode_steps"), names(settings$kwargs))
  )
  by_id <- rlang::is_string(env) && !is_registered(env)
  if (is.null(model) || !settings$may_sample || !by_id || draws_map || length(needs_server)) {
    return(NULL)
  }
  id <- model$spec$id
  abort_if(
    model_limit(model, settings$max_steps) == Inf, "max_steps", NULL, call,
    "{id} has no step limit, so an episode may never end.",
    i = "Give `max_steps`, such as `max_steps = 1000`, after which an episode is cut off."
  )
  cli::cli_inform(
    c(i = "Learning from the model of {id} in R; {.code model = FALSE} plays on the server."),
    class = "gym_message_model"
  )
  model
}

#' Evaluate a policy by a model, exactly
#' @return As [evaluate_episodes()] for no episodes; `NULL` for a policy that draws its actions.
#' @noRd
evaluate_exactly <- function(model, policy, max_steps) {
  probabilities <- tryCatch(
    policy_matrix(policy, model, NULL), gym_error_draws = function(cnd) NULL
  )
  if (is.null(probabilities)) {
    return(NULL)
  }
  limit <- model_limit(model, max_steps)
  value <- expected_return(model, model$backup, probabilities, limit, 1, NULL)
  data.frame(
    candidate = 1L, mean_return = value, se = 0, lower = value, upper = value, episodes = 0L,
    steps = 0L
  )
}

# The number of steps after which an episode in the model is cut off.
model_limit <- function(model, max_steps) {
  min(max_steps %||% Inf, model$spec$max_episode_steps %||% Inf)
}

#' Compute how many steps of the training must lie between two exact evaluations
#'
#' The evaluations should take about a tenth of the time. The number is computed from counts and not
#' from a clock, so that a seed always gives the same result. A training step takes about as long as
#' the update of 500 states. Evaluations of a millisecond or less are never left out.
#' @return A number of steps.
#' @noRd
steps_between_evaluations <- function(model, max_steps) {
  limit <- model_limit(model, max_steps)
  states <- model$backup$states
  # Without a limit equations are solved, which takes about as long as a sweep for each state.
  updates <- states * if (limit == Inf) states else limit
  if (updates > short_evaluation) ceiling(updates / 50) else 0
}

short_evaluation <- 1e5
