# Agents that search for weights: at random, by hill climbing, and by the cross-entropy method.

#' Draw weights at random
#'
#' Draw new weights for each candidate, as [policy_network()] draws them, and keep the best so far,
#' as the tutorial *Artificial Intelligence in R (I)* (2018) does. It learns nothing from one
#' iteration for the next, so it is a baseline for other agents. [search_random()] trains this agent
#' by the tutorial's own rule, `train_agent(solved_by = "candidate")`. [train_agent()] without this
#' argument trains and evaluates it like other agents.
#'
#' @param candidates The number of candidates per iteration, a whole number of at least 1. The
#'   default is 8. By the tutorial's rule each candidate is an iteration.
#' @return An agent of class `gym_agent_random`. Its policy has the best weights so far.
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @seealso [search_random()], [agent_ars()], [agent_cem()], [agent_hill_climb()]
#' @export
#' @examples
#' agent_random()
#' @examplesIf gym:::can_start_server()
#' train_agent(agent_random(), "CartPole-v1", policy_network(), iterations = 10, seed = 1)
agent_random <- function(candidates = 8) {
  check_count(candidates)
  new_agent("random", list(
    candidates = as.integer(candidates), played = 0L, best = NA_integer_, best_return = -Inf,
    policy = NULL
  ))
}

#' @export
agent_start.gym_agent_random <- function(agent, policy) {
  agent <- NextMethod()
  agent$played <- 0L
  agent$best <- NA_integer_
  agent$best_return <- -Inf
  agent
}

#' @export
agent_ask.gym_agent_random <- function(agent) {
  draw <- function(i) weight_vector(policy_resample(agent$policy))
  do.call(rbind, lapply(seq_len(agent$candidates), draw))
}

#' @export
agent_tell.gym_agent_random <- function(agent, results) {
  agent <- NextMethod()
  best <- which.max(results$returns)
  if (results$returns[[best]] > agent$best_return) {
    agent$best <- agent$played + best
    agent$best_return <- results$returns[[best]]
    coef(agent$policy) <- results$weights[best, ]
  }
  agent$played <- agent$played + length(results$returns)
  agent
}

#' @export
format.gym_agent_random <- function(x, ...) {
  agent_text("random search", x["candidates"])
}

#' Search for a policy at random
#'
#' Train [agent_random()], the agent of the tutorial *Artificial Intelligence in R (I)* (2018), by
#' the tutorial's rule. Each round draws new weights for a network and plays a batch of episodes
#' with it. The first round whose mean return reaches the target ends the search. `search_random()`
#' without arguments solves CartPole. It is [train_agent()] with other defaults and `solved_by =
#' "candidate"`. If you give an environment by its id, the search makes it and closes it afterwards,
#' also after an error.
#'
#' One whole number, `seed`, determines the weights of each round and the seeds of its episodes.
#' Without a seed, one is drawn from R's generator, so [set.seed()] fixes the whole search, too.
#' Rounds are played in parallel, in batches of 51 in CartPole; the result is the same as one round
#' after the other. An interrupted search returns the finished batches. With a `checkpoint`, the
#' same call resumes the search, even after a crash. `vignette("playing", package = "gym")` has the
#' details and the differences from the tutorial's script.
#'
#' @param env The environment: an id, by default `"CartPole-v0"`, or an environment made by
#'   [gym_make()], with or without sub-environments.
#' @param policy The kind of policy to search for, made by [policy_network()]. The default is the
#'   network of the tutorial *Artificial Intelligence in R (I)*, with 4 inputs, 2 hidden neurons and
#'   1 output.
#' @param rounds The largest number of rounds, a whole number of at least 1. The default is 50.
#' @param episodes The number of episodes in each round, a whole number of at least 1. The default
#'   is 5.
#' @param target The mean return of a round that ends the search, a number. `NULL`, the default, is
#'   the environment's own reward threshold (195 for CartPole-v0). Without a threshold, or with
#'   `target = Inf`, the search does not end early.
#' @param max_steps The number of steps after which an episode is cut off, a whole number of at
#'   least 1. `NULL`, the default, leaves it to the environment (200 steps in CartPole-v0). In an
#'   environment without a limit, a policy that never fails plays forever. No episode goes beyond
#'   the environment's own limit; `gym_make("MountainCar-v0", max_episode_steps = 1000)` changes
#'   that limit.
#' @param seed A whole number that fixes all random numbers, for any [RNGkind()] of the session. The
#'   session's generator is left as it was. `NULL`, the default, draws a seed from the session's
#'   generator.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client The client of the server that makes an environment given by its id. The default is
#'   the session's client, [gym_client()].
#' @param checkpoint The file for the state of the search, a string. `NULL`, the default, keeps
#'   none. If another process writes the same file, the state with more rounds is kept, with a
#'   warning of class `gym_warning_checkpoint`.
#' @param resume Resume from the `checkpoint`? `TRUE`, the default, resumes if the file exists, with
#'   a message of class `gym_message_resumed`, and starts otherwise. A finished search is returned
#'   at once. `FALSE` starts again and replaces the file.
#' @param seeds `NULL`, the default, or different whole numbers to search once with each. One search
#'   says little about how long searches take. The result is an object of class [gym_trainings] with
#'   all of them, and `plot()` shows how many rounds they needed. Each search is the same as that of
#'   `search_random(seed = )`.
#' @return An object of class [gym_search], with methods for [print()],
#'   [summary()][summary.gym_search()], [plot()][plot.gym_search()],
#'   [as.data.frame()][as.data.frame.gym_search()] and [predict()]. It is also a `gym_training`, see
#'   [train_agent()], in which each round is an iteration with one candidate. Its main elements, in
#'   addition to those of every training, are:
#'   \describe{
#'   \item{policy}{The policy with the best mean return (the one that solved the environment, if it
#'   was solved), the first of equal ones. `NULL` if no round was finished.}
#'   \item{solved}{Whether the target was reached, a logical; `FALSE` without a target.}
#'   \item{round}{The round of that policy, an integer, `NA` if no round was finished.}
#'   \item{rounds}{A data frame with one row for each round: `round` (integer), `mean_return`
#'   (double), `steps` (integer).}
#'   \item{episodes}{A data frame with one row for each episode: `round`, `episode`, `seed`,
#'   `sub_env` (integers), `return` (double), `length` (integer, in steps), `terminated`,
#'   `truncated` (logical).}
#'   \item{target}{The target, a double, or `NULL`.}
#'   \item{env_id, env}{The environment's id, a string, and the environment as given.}
#'   \item{num_envs}{The number of sub-environments, an integer. If they share one seed, [rollout()]
#'   explains how to repeat an episode.}
#'   \item{client}{The client of the environment.}
#'   \item{template, max_rounds, max_steps}{`policy`, `rounds` and `max_steps` as given.}
#'   \item{seed}{The seed, as given or drawn. The same call with this seed gives the same search.}
#'   \item{elapsed}{The time it took in seconds, a double.}
#'   \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#' @section Errors: `gym_error_argument` for an invalid argument, before anything is made, or for a
#'   network that does not fit the environment. `gym_error_checkpoint` for a checkpoint that is
#'   damaged, was not made by a search, was written by an older version, belongs to a search with
#'   other arguments (the message and the field `argument` name them) or cannot be written.
#'   `gym_error_search` for any error during play; it also has the class of that error, such as
#'   `gym_error_http` or `gym_error_connection`.
#' @section Warnings: `gym_warning_max_steps` for a `max_steps` beyond the environment's own limit.
#' @references The method: the tutorial *Artificial Intelligence in R (I)* (2018). The target of
#'   CartPole-v0: Gym's `reward_threshold`.
#' @seealso [gym_search] for using the result.
#' @export
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' search
#' plot(search)
#' search$policy
#'
#' searches <- search_random("CartPole-v0", seeds = 1:10)
#' searches
#' plot(searches)
search_random <- function(env = "CartPole-v0", policy = policy_network(), rounds = 50,
                          episodes = 5, target = NULL, max_steps = NULL, seed = NULL,
                          progress = rlang::is_interactive(), client = gym_client(),
                          checkpoint = NULL, resume = TRUE, seeds = NULL) {
  check_count(rounds)
  unchosen <- if (missing(env)) "gym_warning_gymnasium" else character()
  # A new network draws weights; that must not change the search.
  keep_random_state(force(policy))
  # The default environment is the tutorial's, so nobody is warned that its version is out of date.
  suppressWarnings(classes = unchosen, naming_own_call(
    train_agent(
      agent_random(), env, policy, iterations = as.integer(rounds), episodes = episodes,
      target = target, max_steps = max_steps, seed = seed, seeds = seeds, solved_by = "candidate",
      checkpoint = checkpoint, resume = resume, progress = progress, client = client
    ),
    "train_agent"
  ))
}

# Hill climbing --------------------------------------------------------------------------

#' Hill climbing
#'
#' Add uniform noise from `-noise` to `noise` to the best weights so far, and keep the result if it
#' does better. The search gets stuck if the best weights were lucky, or if all weights nearby are
#' equally bad.
#'
#' @param noise The largest distance of a candidate from the best weights, in each weight, a number
#'   above 0.
#' @param candidates The number of candidates per iteration, a whole number of at least 1. The
#'   default is 1.
#' @inheritParams agent_ars
#' @return `agent_hill_climb()` returns an agent of class `gym_agent_hill_climb`, whose policy has
#'   the best weights so far. `search_hill_climb()` makes this agent, trains it and returns the
#'   result of [train_agent()].
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @references K. Frans (2016), Simple reinforcement learning methods to learn CartPole,
#'   <https://kvfrans.com/simple-algoritms-for-solving-cartpole/>.
#' @seealso [agent_ars()], [agent_cem()]; [agent_ask()] explains what an agent is.
#' @export
#' @examples
#' agent_hill_climb()
#' agent_hill_climb(noise = 0.5, candidates = 8)
#' @examplesIf gym:::can_start_server()
#' search_hill_climb("CartPole-v1", candidates = 8, iterations = 20, seed = 1)
agent_hill_climb <- function(noise = 0.1, candidates = 1) {
  check_above_zero(noise)
  check_count(candidates)
  new_agent("hill_climb", list(
    noise = noise, candidates = as.integer(candidates), best_return = -Inf, policy = NULL
  ))
}

#' @export
agent_start.gym_agent_hill_climb <- function(agent, policy) {
  agent <- NextMethod()
  agent$best_return <- -Inf
  agent
}

#' @export
agent_ask.gym_agent_hill_climb <- function(agent) {
  weights <- stats::coef(agent$policy)
  n <- agent$candidates
  away <- matrix(stats::runif(n * length(weights), -agent$noise, agent$noise), n)
  rep(weights, each = n) + away
}

#' @export
agent_tell.gym_agent_hill_climb <- function(agent, results) {
  agent <- NextMethod()
  best <- which.max(results$returns)
  if (results$returns[[best]] > agent$best_return) {
    agent$best_return <- results$returns[[best]]
    coef(agent$policy) <- results$weights[best, ]
  }
  agent
}

#' @export
format.gym_agent_hill_climb <- function(x, ...) {
  agent_text("hill climbing", c(x["noise"], if (x$candidates > 1L) x["candidates"]))
}

#' @rdname agent_hill_climb
#' @export
search_hill_climb <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_hill_climb", env, policy = policy, ...)
}

# The cross-entropy method ---------------------------------------------------------------

#' The cross-entropy method
#'
#' Draw the candidates of an iteration from a normal distribution of the weights, in which weights
#' are independent. The mean and standard deviation of the best candidates, the elite, become those
#' of the next iteration (Szita and Lorincz 2006). An extra noise, which decreases to 0, is added to
#' the variance. Without it the distribution soon becomes so narrow that the search gets stuck.
#'
#' The weights of the agent's policy are the mean of the distribution. The first mean is the weights
#' that the policy has when training begins.
#'
#' @param population The number of candidates per iteration, a whole number of at least 2.
#' @param elite How many of them are the elite, a whole number from 1 to `population`. The default
#'   is a fifth of them.
#' @param noise The standard deviation of the first distribution, a number above 0.
#' @param extra_noise The standard deviation of the extra noise in the first iteration, a number of
#'   at least 0.
#' @param extra_iterations The number of iterations after which the extra noise is 0, a whole number
#'   of at least 1. Its variance decreases by the same amount in each.
#' @inheritParams agent_ars
#' @return `agent_cem()` returns an agent of class `gym_agent_cem`. `search_cem()` makes this agent,
#'   trains it and returns the result of [train_agent()].
#' @section Errors: `gym_error_argument` for an invalid argument.
#' @references I. Szita and A. Lorincz (2006), Learning Tetris using the noisy cross-entropy method,
#'   Neural Computation 18(12), 2936-2941.
#' @seealso [agent_ars()], [agent_hill_climb()]; [agent_ask()] explains what an agent is.
#' @export
#' @examples
#' agent_cem()
#' agent_cem(population = 100, elite = 10)
#' @examplesIf gym:::can_start_server()
#' search_cem("CartPole-v1", policy_network(), iterations = 20, seed = 1)
agent_cem <- function(population = 40, elite = max(1, population %/% 5), noise = 1,
                      extra_noise = 1, extra_iterations = 20) {
  check_count(population, min = 2)
  check_count(elite, max = population)
  check_above_zero(noise)
  check_number(extra_noise, min = 0)
  check_count(extra_iterations)
  new_agent("cem", list(
    population = as.integer(population), elite = as.integer(elite), noise = noise,
    extra_noise = extra_noise, extra_iterations = as.integer(extra_iterations), iteration = 0L,
    deviation = NULL, policy = NULL
  ))
}

#' @export
agent_start.gym_agent_cem <- function(agent, policy) {
  agent <- NextMethod()
  agent$deviation <- rep(agent$noise, length(stats::coef(policy)))
  agent$iteration <- 0L
  agent
}

#' @export
agent_ask.gym_agent_cem <- function(agent) {
  mean <- stats::coef(agent$policy)
  left <- max(0, 1 - agent$iteration / agent$extra_iterations)
  deviation <- sqrt(agent$deviation^2 + agent$extra_noise^2 * left)
  n <- agent$population
  drawn <- matrix(stats::rnorm(n * length(mean)), n, length(mean))
  rep(mean, each = n) + drawn * rep(deviation, each = n)
}

#' @export
agent_tell.gym_agent_cem <- function(agent, results) {
  agent <- NextMethod()
  best <- order(-results$returns)[seq_len(agent$elite)]
  elite <- results$weights[best, , drop = FALSE]
  mean <- colMeans(elite)
  coef(agent$policy) <- mean
  # A single candidate has no standard deviation, and with 0 all candidates would be the same.
  if (agent$elite > 1L) {
    agent$deviation <- sqrt(colMeans((elite - rep(mean, each = agent$elite))^2))
  }
  agent$iteration <- agent$iteration + 1L
  agent
}

#' @export
format.gym_agent_cem <- function(x, ...) {
  agent_text("CEM", x[c("population", "elite", "noise", "extra_noise", "extra_iterations")])
}

#' @rdname agent_cem
#' @export
search_cem <- function(env = "CartPole-v1", policy = NULL, ...) {
  make_and_train("agent_cem", env, policy = policy, ...)
}
