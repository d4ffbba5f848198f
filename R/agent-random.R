# The agent of the post: weights at random.

#' Draw weights at random
#'
#' Each candidate has weights that are drawn anew, as [policy_network()] draws them, and the best so
#' far are the agent's: what the tutorial *Artificial Intelligence in R (I)* (2018) does. Nothing is
#' learned from one iteration for the next, so that it is what other agents are measured against.
#' [search_random()] trains this agent by the tutorial's own rule, which `train_agent(solved_by =
#' "candidate")` chooses; otherwise it is trained and evaluated as the others.
#'
#' @param candidates How many candidates are played in an iteration, a whole number of at least 1;
#'   the default is 8. By the tutorial's rule each candidate is an iteration.
#' @return An agent of class `gym_agent_random`. Its policy has the best weights so far.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be.
#' @seealso [search_random()], [agent_ars()], [agent_cem()], [agent_hill_climb()]
#' @export
#' @examples
#' agent_random()
#' @examplesIf gym:::can_start_server()
#' train_agent(agent_random(), "CartPole-v1", policy_network(), iterations = 10, seed = 1)
agent_random <- function(candidates = 8) {
  check_count(candidates)
  structure(
    list(
      candidates = as.integer(candidates), played = 0L, best = NA_integer_, best_return = -Inf,
      policy = NULL
    ),
    class = c("gym_agent_random", "gym_agent")
  )
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
#' Trains the agent of the tutorial *Artificial Intelligence in R (I)* (2018), [agent_random()], by
#' the tutorial's rule: each round draws the weights of a network anew, plays a batch of episodes
#' with it, and the first round whose mean return reaches the target ends the search.
#' `search_random()` without arguments solves CartPole. It is [train_agent()] with other defaults
#' and `solved_by = "candidate"`. An environment named by its id is made for the purpose and closed
#' afterwards, whatever happens.
#'
#' The weights of each round and the seeds of its episodes follow from one whole number, `seed`.
#' Without one it is drawn from R's generator, so that [set.seed()] fixes the whole search, too.
#' Rounds are played side by side, in batches of 51 in CartPole, and the first one that
#' reaches the target ends the search all the same. A search that is interrupted returns the batches
#' that were finished; one with a `checkpoint` goes on where it was when the same call is made
#' again, also after a kill. `vignette("playing", package = "gym")` tells all of this in full, and
#' where the tutorial's own script differs.
#'
#' @param env The environment: an id, by default `"CartPole-v0"`, or an environment made by
#'   [gym_make()], with sub-environments or without.
#' @param policy The kind of policy to search among: a network made by [policy_network()],
#'   by default that of the tutorial *Artificial Intelligence in R (I)*, with 4 inputs, 2 hidden
#'   neurons and 1 output.
#' @param rounds How many rounds to play at most, a whole number of at least 1; the default
#'   is 50.
#' @param episodes How many episodes to play in each round, a whole number of at least 1; the
#'   default is 5.
#' @param target The mean return of a round that ends the search, a number. `NULL`, the
#'   default, is the environment's own reward threshold (195 for CartPole-v0), and for an
#'   environment that has none there is no early end, nor with `target = Inf`.
#' @param max_steps After how many steps to cut an episode short, a whole number of at
#'   least 1. `NULL`, the default, leaves it to the environment (200 steps in CartPole-v0); most
#'   have a limit, but without one a policy that never fails plays forever. No episode goes on
#'   beyond the environment's own limit; `gym_make("MountainCar-v0", max_episode_steps = 1000)`
#'   makes one with another.
#' @param seed A whole number that fixes all that is drawn, whatever [RNGkind()] the session has;
#'   the session's generator stays as it was. `NULL`, the default, draws one from the session's
#'   generator.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client The client of the server where an environment named by its id is made; the
#'   default is the session's own, [gym_client()].
#' @param checkpoint The file in which to keep what is played, a string; `NULL`, the default,
#'   keeps nothing. Where another process writes the same file, the state that is further is kept,
#'   with a warning of class `gym_warning_checkpoint`.
#' @param resume Go on with what the `checkpoint` has? `TRUE`, the default, goes on where
#'   there is such a file and otherwise begins; a search that had ended is returned at once.
#'   A message of class `gym_message_resumed` says so. `FALSE` begins anew, and replaces the
#'   file.
#' @return An object of class [gym_search], which [print()], [summary()][summary.gym_search()],
#'   [plot()][plot.gym_search()], [as.data.frame()][as.data.frame.gym_search()] and [predict()]
#'   know. It is a `gym_training`, too, see [train_agent()], in which each round is an iteration
#'   with one candidate. Beside the elements of every training, it has some of its own; these are
#'   the ones to know:
#'   \describe{
#'     \item{policy}{The policy with the best mean return, the one that solved the environment
#'       when one did, the first of equal ones. `NULL` when no round was finished.}
#'     \item{solved}{Whether the target was reached, a logical; `FALSE` without a target.}
#'     \item{round}{The round of that policy, an integer, `NA` when no round was finished.}
#'     \item{rounds}{A data frame with one row for each round: `round` (integer),
#'       `mean_return` (double), `steps` (integer).}
#'     \item{episodes}{A data frame with one row for each episode: `round`, `episode`, `seed`,
#'       `sub_env` (integers), `return` (double), `length` (integer, in steps), `terminated`,
#'       `truncated` (logical).}
#'     \item{target}{The target, a double, or `NULL`.}
#'     \item{env_id, env}{The environment's id, a string, and the environment as given.}
#'     \item{num_envs}{How many sub-environments played, an integer. Where they share the seed of
#'       an episode, [rollout()] says how to begin one again.}
#'     \item{client}{The client of the environment.}
#'     \item{template, max_rounds, max_steps}{`policy`, `rounds` and `max_steps` as given.}
#'     \item{seed}{The seed, as given or drawn: with it the same call gives the same search.}
#'     \item{elapsed}{The seconds that it took, a double.}
#'     \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, before
#'   anything is made, or for a network that does not fit the environment;
#'   `gym_error_checkpoint` for a checkpoint that is damaged, was not made by a search, was written
#'   by an older version, belongs to a search with other arguments (the message names them, and so
#'   does the field `argument`) or cannot be written; `gym_error_search` for any error while it
#'   plays, with the classes of that error, `gym_error_http` or `gym_error_connection` for instance.
#' @section Warnings: `gym_warning_max_steps` for a `max_steps` beyond the environment's own limit.
#' @references The method: the tutorial *Artificial Intelligence in R (I)* (2018). The target of
#'   CartPole-v0: Gym's `reward_threshold`.
#' @seealso [gym_search] for what to do with the result; [search_repeat()] for how long such
#'   searches take.
#' @export
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' search
#' plot(search)
#' search$policy
search_random <- function(env = "CartPole-v0", policy = policy_network(), rounds = 50,
                          episodes = 5, target = NULL, max_steps = NULL, seed = NULL,
                          progress = rlang::is_interactive(), client = gym_client(),
                          checkpoint = NULL, resume = TRUE) {
  check_count(rounds)
  # What a new network draws is none of the search's weights.
  keep_random_state(force(policy))
  naming_own_call(
    train_agent(
      agent_random(), env, policy, iterations = as.integer(rounds), episodes = episodes,
      target = target, max_steps = max_steps, seed = seed, solved_by = "candidate",
      checkpoint = checkpoint, resume = resume, progress = progress, client = client
    ),
    "train_agent"
  )
}
