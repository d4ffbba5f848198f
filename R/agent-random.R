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
#' that [set.seed()] alone fixes the whole search. The policy that is given tells only the sizes
#' and activations: its own weights are not played, in the first round either, and drawing
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
#' With a `checkpoint` the search keeps what it has played in a file, after each block of
#' episodes (with a single environment made by [gym_make()], where a block is one episode and
#' may be over in milliseconds, as often as takes a tenth of the time at most). The file is
#' replaced by a rename, so that it is whole whenever R, the server or the machine's queue ends
#' the search. The same call then goes on where the file has it, and comes to the result that an
#' undisturbed search comes to, the generator's state afterwards included: in a script that
#' is submitted to a cluster again and again, that one line is enough. The block that was under
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
#'     where
#'       each episode has a seed of its own. [rollout()] tells how to begin one again.}
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
  kept <- if (!is.null(checkpoint)) open_checkpoint(checkpoint, env, settings, resume)
  if (isTRUE(kept$saved$finished)) {
    client <- if (is_playable(env)) env$client else client
    return(finished_search(kept$saved, settings, client, kept$path))
  }
  with_vector_env(env, as.numeric(rounds) * episodes, client, function(vector_env) {
    warn_of_own_limit(max_steps, vector_env, call)
    settings <- settings_in(vector_env, settings)
    bound <- policy_bind(policy, vector_env, call = call)
    with_random_seed(seed, play_rounds(vector_env, bound, settings, progress, call, kept))
  })
}

#' Check what a search is to do
#'
#' `policy` must not have been forced: whatever drawing it draws is put back.
#' @return A list, as [play_rounds()] takes it, but for what the environment says of itself.
#' @noRd
search_settings <- function(env, policy, rounds, episodes, target, max_steps,
                            call = rlang::caller_env()) {
  check_environment(env, call = call)
  check_count(rounds, call = call)
  check_count(episodes, call = call)
  check_number(target, allow_null = TRUE, call = call)
  check_count(max_steps, allow_null = TRUE, call = call)
  keep_random_state(policy_resample(check_policy(policy, call = call), call = call))
  list(
    policy = policy, rounds = as.integer(rounds), episodes = as.integer(episodes),
    target = target, max_steps = max_steps
  )
}

settings_in <- function(vector_env, settings) {
  settings["target"] <- list(settings$target %||% vector_env$spec$reward_threshold)
  settings["num_envs"] <- list(vector_env$num_envs)
  settings["client"] <- list(vector_env$client)
  settings$env_id <- environment_label(vector_env)
  settings
}

#' Play rounds until one reaches the target
#'
#' An interrupt ends them early, an error does too and carries what was played.
#' @param checkpoint As [open_checkpoint()] returns it, or `NULL`.
#' @return A search, as [new_search()] makes it.
#' @noRd
play_rounds <- function(vector_env, template, settings, progress, call, checkpoint = NULL) {
  started <- proc.time()[["elapsed"]]
  show <- if (progress) progress_bar(settings$rounds) else function(finished, best) NULL
  record <- new_rounds(settings$rounds, settings$episodes, settings$target, show)
  if (!is.null(checkpoint)) {
    saved <- checkpoint$saved
    if (!is.null(saved)) {
      settings$policy <- saved$template
      started <- started - saved$elapsed
      resume_rounds(record, saved, vector_env, settings, checkpoint$path, call)
    }
    keep_rounds(record, checkpoint, vector_env, settings, started, call)
  }
  interrupted <- FALSE
  begin <- function(block, episodes) {
    list(seeds = vector_env$draw_seeds(), policy = draw_policies(record, template, episodes))
  }
  tryCatch(
    play_episodes(vector_env, record, begin, settings$max_steps),
    interrupt = function(cnd) {
      interrupted <<- TRUE
      inform_interrupted(count_finished(record), settings$rounds)
    },
    error = function(cnd) {
      abort_search(
        cnd, new_search(record, settings, started), call, checkpoint = checkpoint$path
      )
    }
  )
  new_search(record, settings, started, interrupted)
}

progress_bar <- function(rounds, frame = parent.frame()) {
  bar <- cli::cli_progress_bar(
    total = rounds,
    format = paste(
      "Round {cli::pb_current} of {cli::pb_total} {cli::pb_bar}",
      "best mean return {cli::pb_extra$best}, {cli::pb_eta_str}"
    ),
    extra = list(best = "-"),
    .envir = frame
  )
  function(finished, best) {
    cli::cli_progress_update(
      id = bar, set = finished, extra = list(best = number_text(best)), .envir = frame
    )
  }
}

inform_interrupted <- function(finished, rounds) {
  cli::cli_inform(
    c("!" = "The search was interrupted after {finished} of {rounds} round{?s};
             it returns what it has so far."),
    class = "gym_message_interrupted"
  )
}

# Of the error in the middle it keeps classes and fields, so that whoever waits for
# a lost connection need not know that it was lost in a search.
abort_search <- function(cnd, result, call, played = count_of(nrow(result$rounds), "round"),
                         checkpoint = NULL) {
  own <- c("message", "call", "parent", "trace", "body", "header", "footer", "rlang",
           "use_cli_format")
  fields <- unclass(cnd)[setdiff(names(cnd), own)]
  rlang::exec(
    gym_abort,
    c(
      paste0("The search ended early, after ", played, "."),
      i = "What was played is the element `result` of this condition.",
      i = if (!is.null(checkpoint)) {
        paste0("The same call goes on from \"", checkpoint, "\" when what is wrong is mended.")
      }
    ),
    class = c("gym_error_search", grep("^gym_error_", class(cnd), value = TRUE)),
    result = result,
    !!!fields,
    parent = cnd,
    call = call
  )
}
