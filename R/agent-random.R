#' Search for a policy at random
#'
#' Plays the agent of the tutorial *Artificial Intelligence in R (I)* (2018): each round draws
#' the weights of a network anew, plays a batch of episodes with it, and the first round whose
#' mean return reaches the target ends the search. `search_random()` without arguments solves
#' CartPole. An environment named by its id is made for the purpose and closed afterwards,
#' whatever happens.
#'
#' # What is drawn
#'
#' The weights of each round and the seeds of its episodes are drawn from R's generator, so
#' that [set.seed()] alone fixes the whole search. Of the policy that is given only the sizes and
#' activations matter: its own weights are not played, in the first round either, and drawing
#' them in the call (as the default does) leaves the generator alone.
#'
#' # Rounds side by side
#'
#' As in [rollout()], many episodes are played at once, and so are the networks of many
#' rounds. What comes of the search is decided round after round all the same: the first
#' round that reaches the target ends it, and of later rounds, which may have been played
#' beside it, nothing counts. With a single environment made by [gym_make()] one episode is
#' played after the other.
#'
#' # Where it differs from the tutorial's script
#'
#' The tutorial's script recycles the weights of the output to twice their number, counts for
#' each episode one step too many, and takes the mean of the *different* returns of a batch.
#' Here each weight counts once, an episode's return is the sum of its rewards, and the mean
#' is over all episodes.
#'
#' # When it ends early
#'
#' A search that is interrupted (Ctrl-C, or Esc) returns what it has, with a message; a round
#' that was not played to its end does not count. An error in the middle, such as a lost
#' connection, has the class `gym_error_search` beside its own, and what was played before
#' it is the element `result` of the condition:
#'
#' ```r
#' search <- tryCatch(search_random(), gym_error_search = function(cnd) cnd$result)
#' ```
#'
#' # To go on after a kill
#'
#' With a `checkpoint` the search keeps what it has played in a file, after each batch of
#' episodes (with a single environment made by [gym_make()], where a batch is one episode and
#' may be over in milliseconds, as often as takes a tenth of the time at most). The file is
#' replaced by a rename, so that it is complete whenever R, the server or the machine's queue ends
#' the search. The same call then goes on where the file has it, and comes to the result that an
#' undisturbed search comes to, the generator's state afterwards included: in a script that
#' is submitted to a cluster again and again, that one line is enough. The batch that was under
#' way is played again. `elapsed` adds up.
#'
#' ```r
#' search <- search_random("CartPole-v1", rounds = 1000, seed = 1, checkpoint = "search.rds")
#' ```
#'
#' A search goes on only with the arguments that it began with (`progress` and `client` may be
#' others), in an environment that is made in the same way. Two searches at the same time need
#' two files. Read such files only if you trust where they are from, as all that [readRDS()]
#' reads.
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
#' @param seed A whole number that fixes all that is drawn: the result is that of calling
#'   `set.seed(seed)` beforehand, but the session's generator is afterwards as it was.
#'   `NULL`, the default, draws from the session's generator.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client The client of the server where an environment named by its id is made; the
#'   default is the session's own, [gym_client()].
#' @param checkpoint The file in which to keep what is played, a string; `NULL`, the default,
#'   keeps nothing.
#' @param resume Go on with what the `checkpoint` has? `TRUE`, the default, goes on where
#'   there is such a file and otherwise begins; a search that had ended is returned at once.
#'   A message of class `gym_message_resumed` says so. `FALSE` begins anew, and replaces the
#'   file.
#' @return An object of class [gym_search], which [print()], [summary()][summary.gym_search()],
#'   [plot()][plot.gym_search()], [as.data.frame()][as.data.frame.gym_search()] and
#'   [predict()][predict.gym_search()] know; a list with the elements
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
#'     \item{env_id}{The environment's id, a string.}
#'     \item{env}{The environment when an object was given, otherwise `NULL`.}
#'     \item{num_envs}{How many sub-environments share the seed of an episode, an integer; `NULL`
#'       where each episode has a seed of its own. [rollout()] says how to begin one again.}
#'     \item{client}{The client of the environment.}
#'     \item{template, max_rounds, max_steps, seed}{`policy`, `rounds`, `max_steps` and `seed` as
#'       given.}
#'     \item{elapsed}{The seconds that it took, a double.}
#'     \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, before
#'   anything is made, or for a network that does not fit the environment;
#'   `gym_error_checkpoint` for a checkpoint that is damaged, is no search's, belongs to a
#'   search with other arguments (the message names them, and so does the field `argument`) or
#'   cannot be written; `gym_error_search` for any error while it plays, with the classes of
#'   that error, `gym_error_http` or `gym_error_connection` for instance.
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
  check_seed(seed)
  check_flag(progress)
  check_string(checkpoint, allow_null = TRUE)
  check_flag(resume)
  call <- rlang::current_env()
  settings <- search_settings(env, policy, rounds, episodes, target, max_steps)
  settings["env"] <- list(if (!is.character(env)) env)
  settings["seed"] <- list(seed)
  file <- if (!is.null(checkpoint)) open_checkpoint(checkpoint, env, settings, resume)
  if (isTRUE(file$saved$finished)) {
    client <- if (is_playable(env)) env$client else client
    return(finished_search(file$saved, settings, client, file$path))
  }
  with_vector_env(env, as.numeric(rounds) * episodes, client, function(vector_env) {
    warn_of_own_limit(max_steps, vector_env, call)
    settings <- settings_in(vector_env, settings)
    bound <- policy_bind(policy, vector_env, call = call)
    with_random_seed(seed, play_search(vector_env, bound, settings, progress, call, file))
  })
}
