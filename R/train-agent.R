#' Train an agent
#'
#' Train an agent iteration by iteration: the agent asks for candidates, they are played, and the
#' agent gets the results. Training ends when the target is reached or the budget is used up. A
#' learner such as [agent_q()] has no candidates. It plays the episodes of an iteration and learns
#' from each step.
#'
#' # When training ends
#'
#' Before the first iteration and then every `eval_every` iterations, the agent's own policy plays
#' `eval_episodes_curve` episodes for the learning curve. If their mean return, or that of the
#' iteration's episodes, reaches the target, the policy plays `eval_episodes` new episodes, which
#' decide whether training ends. ([agent_dqn()] plays single episodes; the mean of its last eight
#' counts.) This may happen several times, so training tends to end when the policy was lucky. At
#' the end the policy therefore plays `eval_episodes` further episodes, with seeds that were never
#' used before. Their mean return is the result of the training. Evaluations do not count as steps
#' of the training.
#'
#' If neither the environment nor `max_steps` limits the steps of an episode, the policy is not
#' evaluated before the first iteration: an untrained policy might never end an episode. Later
#' evaluations then cut off each episode after 1,000 steps, or after ten times the mean length of
#' the iteration with the longest episodes, if that is more. A message says when this happens.
#'
#' If the model of the environment is known ([env_model()]), a learner's policy is evaluated
#' exactly, without playing. These evaluations have 0 episodes and a standard error of 0. In a large
#' model an exact evaluation takes time. There, at least a certain number of training steps lies
#' between two evaluations, even if `eval_every` asks for more, so that they take about a tenth of
#' the time. This number depends only on the number of states and on the step limit. It is printed,
#' and it is `eval_steps` in the training's `rules`.
#'
#' # Targets
#'
#' The target of an environment is its reward threshold, as registered by Gymnasium or set in R,
#' with four exceptions:
#'
#' | environment | target | where it comes from |
#' |---|---|---|
#' | `"HalfCheetah-v5"` | 3430 | Mania, Guy and Recht (2018); registered: 4800 |
#' | `"Hopper-v5"` | 3120 | Mania, Guy and Recht (2018); registered: 3800 |
#' | `"Pendulum-v1"` | -200 | ours; none is registered |
#' | `"Swimmer-v5"` | 325 | Mania, Guy and Recht (2018); registered: 360 |
#'
#' Training tends to stop when the policy was lucky. If you set a target somewhat above the
#' environment's, the final evaluation is more likely to reach the environment's. Use the same
#' target for trainings that you compare.
#'
#' # Sampling from a model
#'
#' FrozenLake, CliffWalking and Taxi have a model. If you give one of them by its id, a learner gets
#' the model from the server once and samples from it in R. This is many times faster, and the
#' distribution of episodes is the same. A message says so. The learner still plays on the server
#' with `model = FALSE`, with `mask`, `callback`, `num_workers`, wrappers or a `render_mode`, on a
#' lake with a random map, and in a Taxi with a fickle passenger. A model without a step limit, such
#' as CliffWalking's, requires `max_steps`.
#'
#' # Resuming
#'
#' `checkpoint` keeps the training in a file. The file is written after each iteration, or less
#' often if iterations are short, so that writing takes at most a tenth of the time. The same call
#' resumes the training, with the same result as an uninterrupted one. A finished training is
#' returned at once. `iterations`, `total_steps` and `target` may differ, except in a search: with a
#' larger budget or a higher target, a finished training goes on. (A network whose sizes you give
#' draws its weights when you make it. To make the same one again, call [set.seed()] first, or leave
#' the sizes `NA`.) To see which training a file has, print the result of `readRDS()`.
#'
#' # Going on with a trained agent
#'
#' `train_agent(training$agent, env)` goes on with the agent of an earlier training: its policy,
#' value network, optimiser, memory and schedules stay as they were. So does `policy = training` in
#' the function that made this agent, such as [learn_ppo()]. This function keeps the agent's
#' settings, except those that you give, and uses the same budget again by default. Both calls are
#' new trainings, with their own seeds, steps and evaluations. `policy =
#' agent_policy(training$agent)` starts with the policy alone.
#'
#' # The tutorial's rule
#'
#' `solved_by = "candidate"` is the rule of the tutorial *Artificial Intelligence in R (I)* (2018).
#' There are no evaluations. The candidates of [agent_random()] are judged one after the other by
#' their own `episodes`. The first one whose mean return reaches the target ends the training. Each
#' candidate is an iteration, called a round. Rounds are independent, so as many as fit into a batch
#' of episodes are played in parallel. The result also has the class [gym_search]. [search_random()]
#' trains in this way.
#'
#' @param agent The agent, made by a function such as [agent_ars()], [agent_ppo()] or [agent_q()],
#'   or your own, see [agent_ask()]. [learn_sb3()] trains by other methods,
#'   such as SAC.
#' @param env The environment, as for [rollout()].
#' @param policy The policy to train: a network, by default [policy_linear()] or the one named on
#'   the agent's help page. Most agents start with its weights. A learner such as [agent_q()] makes
#'   its own policy, and can start with a [policy_table()] of values. Give an earlier training to go
#'   on with its agent. If `agent` is of another kind, it starts with that training's policy.
#' @param iterations,total_steps The number of iterations, or of steps of the environment, after
#'   which training ends, whole numbers of at least 1. The last iteration is played to its end. Give
#'   at least one of the two.
#' @param episodes The number of episodes that each candidate, or the learner, plays in an
#'   iteration, a whole number of at least 1. The default is 1. Agents that follow gradients choose
#'   it themselves.
#' @param target The mean return at which training ends, a number. `NULL`, the default, uses the
#'   environment's target if it has one, the same for every agent (see below). `Inf` trains until
#'   the budget is used up.
#' @param max_steps The number of steps after which an episode is cut off, as for [rollout()].
#' @param eval_every The number of iterations between evaluations, a whole number of at least 1. The
#'   default is 10.
#' @param eval_episodes The number of episodes that decide whether training ends, and of the final
#'   evaluation, a whole number of at least 2. The default is 100.
#' @param eval_episodes_curve The number of episodes for a point of the learning curve, a whole
#'   number; no more than `eval_episodes` are played. The default is 10. With 0 there is no curve,
#'   and no time is spent on it.
#' @param evaluate How evaluations play a network that draws its actions (as agents that follow
#'   gradients use): `"greedy"`, the default, takes the most likely actions; `"draw"` draws them.
#'   The same policy decides when training ends, is evaluated at the end, and is returned. Training
#'   itself plays the agent's [behavior policy][agent_behavior()].
#' @param seed A whole number that fixes all random numbers, as for [rollout()].
#' @param seeds `NULL`, the default, or different whole numbers to train the agent once with each.
#'   Each training is the same as that of `train_agent(seed = )`. All are returned.
#'   `checkpoint = "training.rds"` becomes a file for each, such as `"training-7.rds"`, and `log`
#'   has a folder for each, such as `seed-7`.
#' @param ... Arguments of the environment, by name, such as `continuous = TRUE` for LunarLander, if
#'   it is given by its id.
#' @param solved_by What decides that the environment is solved and ends the training:
#'   `"evaluation"`, the default, for an evaluation of the agent's policy; or `"candidate"`, for the
#'   tutorial's rule, with [agent_random()] only.
#' @param callback `NULL`, the default, or a function that is called after each iteration (in a
#'   search, after each batch of rounds) with the training so far, an object as returned by
#'   `train_agent()`. Training ends if it returns `FALSE`.
#' @param log `NULL`, the default, or a folder, which is created if it does not exist. Each
#'   iteration appends a row to `progress.csv` and each evaluation one to `evaluations.csv`.
#'   `config.json` describes the training. [learning_curves()] reads the folder. The tables of an
#'   earlier training are renamed to `progress-1.csv`, and so on.
#' @param checkpoint `NULL`, the default, or the file to keep the training in, such as
#'   `"training.rds"`.
#' @param resume Resume from the file if it exists? `TRUE`, the default, or `FALSE`, which starts
#'   again and replaces it.
#' @param progress Show a progress bar? By default in interactive sessions only. Without one, a
#'   message after a few seconds says how long the training may take, if more than a minute is left.
#' @param num_envs,num_workers The number of sub-environments, and of processes that run them, as
#'   for [rollout()]. A learner plays in one sub-environment by default, see [agent_observe()].
#' @param model Let a learner sample from the model in R, if the environment is given by its id and
#'   has one? `TRUE`, the default, or `FALSE`, which plays on the server. See below.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @return An object of class `gym_training`, with methods for [print()], [summary()],
#'   [as.data.frame()], [plot()][plot.gym_training()], [predict()], [coef()], [animate()] and
#'   [provenance()]; with `seeds`, one of class [gym_trainings]. A training is a list with the
#'   elements
#'   \describe{
#'     \item{policy}{The agent's policy with its final weights, as it was evaluated. By default it
#'       takes the most likely actions; `agent_policy(training$agent)` draws them if the agent's
#'       policy does.}
#'     \item{agent}{The agent at the end.}
#'     \item{solved}{Whether the final evaluation, or a round by the tutorial's rule, has reached
#'       the target, a logical. `NA` without a target, and with `target = Inf`.}
#'     \item{stopped_early}{Whether training ended before its budget because a stopping evaluation,
#'       or a round, reached the target, a logical.}
#'     \item{history}{A data frame with a row for each iteration: `iteration` (integer), `steps` (of
#'       the training so far, double), `min_return`, `median_return`, `mean_return`, `max_return`
#'       (of the candidates' mean returns, or of the episodes' returns if the agent learns from
#'       steps, double), `mean_length` (of their episodes, in steps), `evaluation` (the mean return
#'       of the agent's policy, `NA` without an evaluation), `elapsed` (seconds, `NA` for the rounds
#'       of a search) and the values of [agent_log()].}
#'     \item{evaluations}{A data frame with a row for each evaluation: `iteration` (0 before the
#'       first), `kind` (`"curve"`, `"stopping"` or `"final"`), and the columns of
#'       [evaluate_policy()] from `mean_return` on.}
#'     \item{final}{The last of these rows, the final evaluation. `NULL` for an interrupted training
#'       and for a search.}
#'     \item{target, env_id, seed}{As given, found or drawn.}
#'     \item{env}{The environment as given: its id, or the object.}
#'     \item{kwargs}{The arguments of the environment, a named list.}
#'     \item{provenance}{The result of [provenance()].}
#'     \item{rules}{The budget and the rules of evaluation, a list of the arguments `iterations`,
#'       `total_steps`, `max_steps`, `eval_every`, `eval_episodes`, `eval_episodes_curve` and
#'       `evaluate`, and of `eval_steps`, the smallest number of steps between two exact evaluations
#'       (0 in a small model, `NULL` without a model).}
#'     \item{steps, elapsed}{The number of steps and of seconds of the training, doubles.}
#'     \item{interrupted}{Whether it was interrupted, a logical. An interrupted training has the
#'       finished iterations.}
#'   }
#' @section Errors: `gym_error_argument` for an invalid argument, or a policy that does not fit.
#'   `gym_error_checkpoint` for a file that cannot be resumed from. An error during training also
#'   has the class `gym_error_training` (and `gym_error_search` by the tutorial's rule), and its
#'   field `result` has the finished iterations.
#' @seealso [evaluate_policy()], [rollout()]
#' @concept SAC A2C
#' @export
#' @examplesIf gym:::can_start_server()
#' trained <- train_agent(
#'   agent_ars(directions = 8, top = 4, step_size = 0.02, noise = 0.05), "CartPole-v1",
#'   iterations = 20, seed = 1
#' )
#' trained
#' trained$final
train_agent <- function(agent, env, policy = NULL, iterations = NULL, total_steps = NULL,
                        episodes = 1, target = NULL, max_steps = NULL, eval_every = 10,
                        eval_episodes = 100, eval_episodes_curve = 10,
                        evaluate = c("greedy", "draw"), seed = NULL, seeds = NULL, ...,
                        solved_by = c("evaluation", "candidate"), callback = NULL, log = NULL,
                        checkpoint = NULL, resume = TRUE, progress = rlang::is_interactive(),
                        num_envs = NULL, num_workers = NULL, model = TRUE,
                        client = gym_client()) {
  match_whole_names()
  call <- rlang::current_env()
  check_agent(agent, call)
  force(env)
  # Do not evaluate `client`: a training that needs no server must not start one.
  given <- mget(setdiff(names(formals()), c("...", "client")), call)
  kwargs <- list(...)
  budget <- !is.null(iterations) || !is.null(total_steps)
  check_spelling(names(kwargs), names(formals(train_agent)), budget, call)
  place <- paste0("it goes into its parentheses, as in `", maker_of(agent), "(%s = )`")
  check_not_of_agent(names(kwargs), settings_of(agent), place, call)
  start_training(given, kwargs, client, call)
}

# Trains once, or once with each of `seeds`; the arguments are those of training_settings().
start_training <- function(given, kwargs, client, call) {
  settings <- training_settings(given, kwargs, client, call)
  if (!is.null(given$seeds)) {
    return(train_seeds(settings, given$seeds, given$progress, client, call))
  }
  in_env <- function(play) with_training_env(settings, play, client, call)
  do_run(settings, in_env, client, given$progress, call)
}

#' Check the arguments of a training and complete them
#' @param given The arguments of [train_agent()] but for `...` and `client`, a list.
#' @param kwargs The environment's own arguments.
#' @return A list, the settings; without `seeds` as [with_checkpoint()] returns them.
#' @noRd
training_settings <- function(given, kwargs, client, call) {
  env <- given$env
  solved_by <- check_choice(given$solved_by[1L], c("evaluation", "candidate"), "solved_by", call)
  # By the tutorial's rule the training is a search, in which each candidate is a round.
  search <- solved_by == "candidate"
  agent <- agent_to_train(given$agent, given$policy, search, call)
  online <- learns_online(agent)
  check_flag(given$model, arg = "model", call = call)
  settings <- c(
    given[c("env", "iterations", "total_steps", "episodes", "target", "max_steps", "eval_every",
            "eval_episodes", "eval_episodes_curve", "seed", "callback", "checkpoint", "resume")],
    list(
      agent = agent, kwargs = kwargs, policy = policy_to_train(given$policy, agent),
      evaluate = check_choice(given$evaluate[1L], c("greedy", "draw"), "evaluate", call),
      search = search, may_sample = online && given$model,
      what = if (search) "search" else "training", unit = if (search) "round" else "iteration"
    )
  )
  check_training(settings, call)
  for (name in c("progress", "resume")) check_flag(given[[name]], arg = name, call = call)
  for (name in c("log", "checkpoint")) {
    check_string(given[[name]], allow_null = TRUE, arg = name, call = call)
  }
  if (!is.null(given$seeds)) check_training_seeds(given$seeds, given$seed, call)
  settings$num_envs <- given$num_envs %||% if (online) learner_envs(env, agent)
  settings$num_workers <- given$num_workers
  settings$log <- if (!is.null(given$log)) absolute_path(given$log)
  if (is.null(given$seeds)) settings <- with_checkpoint(settings, call)
  settings$kwargs <- with_random_map(env, kwargs, settings$seed %||% given$seeds)
  settings$model <- if (online) judging_model(settings, client)
  settings["eval_steps"] <- list(
    if (!is.null(settings$model)) steps_between_evaluations(settings$model, settings$max_steps)
  )
  # `learn_q("Taxi-v4")` plays in the model, as `learn_q(env_model("Taxi-v4"))` does.
  sampled <- sampled_model(settings, wants_random_map(env, kwargs), call)
  settings$from_model <- !is.null(sampled)
  settings$played <- if (is.null(sampled)) settings[c("env", "kwargs")] else list(env = sampled)
  settings
}

least_sub_envs <- 100

# Candidates are played in parallel even if an evaluation has few episodes.
with_training_env <- function(settings, play, client, call, max_steps = settings$max_steps) {
  episodes <- if (settings$search) {
    as.numeric(settings$iterations %||% least_sub_envs) * settings$episodes
  } else {
    candidates <- iteration_candidates(settings$agent)
    max(settings$eval_episodes, candidates * settings$episodes, least_sub_envs)
  }
  played <- settings$played
  evaluated <- NULL
  on.exit(if (!is.null(evaluated)) evaluated$close(wait = FALSE))
  play_both <- function(vector_env) {
    if (isTRUE(given_id(played$env)$calls_r) && learns_online(settings$agent) &&
          vector_env$num_envs == 1L) {
      # The learner plays in one sub-environment, but its evaluations may play in many.
      vector_env$make_evaluated <- function() {
        if (is.null(evaluated)) {
          evaluated <<- rlang::exec(
            as_vector_env, played$env, !!!played$kwargs, max_envs = episodes,
            client = vector_env$client
          )
          evaluated$call <<- call
        }
        evaluated
      }
    }
    play(vector_env)
  }
  # Unlike exec(), inject() leaves `client` unevaluated.
  rlang::inject(with_vector_env(
    env = played$env, episodes = episodes, play = play_both, max_steps = max_steps,
    !!!played$kwargs, num_envs = settings$num_envs, num_workers = settings$num_workers,
    client = client, call = call
  ))
}

# The number of candidates per iteration for agents of this package; otherwise 0.
iteration_candidates <- function(agent) {
  switch(class(agent)[[1L]],
    gym_agent_ars = 2L * agent$directions,
    gym_agent_cem = agent$population,
    gym_agent_hill_climb = , gym_agent_random = agent$candidates,
    0L
  )
}

# Adds two settings of a single training: its seed, and `file`, the result of open_checkpoint().
with_checkpoint <- function(settings, call) {
  if (!is.null(settings$checkpoint)) {
    settings$file <- open_checkpoint(
      settings$checkpoint, training_arguments(settings), settings$resume, settings$what, call
    )
  }
  settings$seed <- settings$file$saved$seed %||% settings$seed %||% draw_seed()
  settings
}

# A finished training does not need an environment.
do_run <- function(settings, in_env, client, progress, call) {
  finished <- if (!is.null(settings$file$saved)) finished_training(settings, client)
  finished %||% in_env(function(vector_env) train_in(vector_env, settings, progress, call))
}

# Trains in a given vector environment.
train_in <- function(vector_env, settings, progress, call) {
  settings["given_target"] <- list(settings$target)
  settings["target"] <- list(training_target(settings, vector_env$spec))
  settings$env_id <- environment_label(vector_env)
  settings[c("num_envs", "batch_size", "client")] <-
    unclass(vector_env)[c("num_envs", "batch_size", "client")]
  online <- learns_online(settings$agent)
  check_training_ends(vector_env, settings, online, call)
  playing <- if (online && !plays_whole(settings$agent)) stepped(vector_env) else vector_env
  settings$provenance <- settings$file$saved$provenance %||% new_provenance(playing, settings)
  bound <- if (online) {
    spaces_policy(settings$policy, vector_env, settings$model, call)
  } else {
    bind_with_seed(settings$policy, vector_env, settings$seed, call)
  }
  state <- rlang::env(
    agent = settings$agent, iteration = 0L, steps = 0, history = list(), evaluations = list(),
    episodes = list(), final = NULL, solved = FALSE, ended = FALSE,
    streams = new_streams(settings$seed),
    # Evaluations have their own streams, so that training does not depend on them.
    evaluation_streams = new_streams(with_generator(new_generator(settings$seed), draw_seed())),
    started = now(), report = function(ended) NULL, log = function() NULL,
    checkpoint = function(last = FALSE) NULL
  )
  if (isTRUE(settings$agent$started)) {
    state$agent <- continued_agent(settings$agent, bound, call)
  } else {
    state$agent <- with_generator(
      state$streams$agent, naming_call(agent_start(settings$agent, bound), vector_env)
    )
    check_is_agent(state$agent, "agent_start()", call)
    state$agent$started <- TRUE
  }
  if (!is.null(settings$file)) state$checkpoint <- training_checkpoint(state, settings, call)
  if (!is.null(settings$log)) {
    state$log <- training_log(settings$log, settings, state, call)
  }
  run_training(state, vector_env, settings, progress, call)
}

# A network with sizes that are `NA` draws its weights when it is bound to an environment. These
# weights must depend on the training's seed, so the network gets a seed that is drawn from it.
bind_with_seed <- function(policy, vector_env, seed, call) {
  if (!is.null(policy$weights_seed)) {
    # Its own stream: the agent's first random numbers must not equal the weights.
    own <- new_generator(stream = parallel::nextRNGSubStream(seed_stream(seed)))
    policy$weights_seed <- with_generator(own, draw_seed())
  }
  policy_bind(policy, vector_env, call = call)
}
