#' Repeat a random search with many seeds
#'
#' One search says little about how long searches take, as its round is a matter of chance.
#' `search_repeat()` plays [search_random()] once with each of many seeds, in an environment
#' that is made once, and keeps in one row what came of each. Plotted, the rounds that
#' the searches needed stand beside the geometric distribution that they follow.
#'
#' The row of a seed is what `search_random(seed = )` gives with that seed and the same
#' arguments: call it to see that search again, or to have its policy. (Only an
#' environment that was made before and remembers something beyond a reset, such as one wrapped
#' in `NormalizeReward`, may differ.) As each search is seeded, the session's generator is left as
#' it was.
#'
#' # The chance of a round
#'
#' Each round draws its weights anew, so that all have the same chance to reach the target,
#' and how many it takes is geometrically distributed. The chance is estimated by maximum
#' likelihood: the searches that were solved divided by all rounds that were played, in
#' searches that were not solved within `rounds` rounds, too (they are censored, and leaving
#' them out would make the chance look better than it is).
#'
#' # When it ends early
#'
#' Interrupted (Ctrl-C, or Esc), it returns the searches that were finished, with a message.
#' An error in the middle has the class `gym_error_search` beside its own, and the searches
#' before it are the element `result` of the condition.
#'
#' @inheritParams search_random
#' @param rounds How many rounds a search plays at most, a whole number of at least 1; the
#'   default is 50.
#' @param target The mean return of a round that ends a search, a number. `NULL`, the
#'   default, is the environment's own reward threshold; one that has none needs a target.
#' @param seeds The seeds, different whole numbers; the default is 1 to 100. With CartPole
#'   each takes about a third of a second.
#' @return An object of class `gym_searches`, which [print()], [summary()], [as.data.frame()]
#'   and [plot()][plot.gym_searches()] know; a list with the elements
#'   \describe{
#'     \item{searches}{A data frame with one row for each seed: `seed` (a whole number), `solved`
#'       (logical), `round` (integer, the round that reached the target, `NA` where none
#'       did), `rounds` (integer, how many were played), `mean_return` (double, of the best
#'       round), `steps` (integer), `elapsed` (double, in seconds). `as.data.frame()` gives
#'       it.}
#'     \item{chance, se}{The chance of a round to reach the target and its standard error,
#'       doubles; `NA` when no search was finished, the error also when no search was
#'       solved.}
#'     \item{env_id, target, template, max_rounds, episodes, max_steps}{What was searched:
#'       the environment's id, the target, `policy`, `rounds`, `episodes`, `max_steps`.}
#'     \item{elapsed}{The seconds that it took, a double.}
#'     \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#'   `summary()` gives an object of class `summary.gym_searches`, a list with the elements
#'   `searches` (the object), `share` (of the searches that were solved, a double) and
#'   `rounds` (quartiles and mean of the rounds of these, a named numeric vector of length
#'   6).
#' @section Errors: Those of [search_random()]; `gym_error_argument` also for an environment
#'   without a reward threshold when no target is given.
#' @inheritSection search_random Warnings
#' @references The geometric distribution and its estimate from censored numbers: J. F.
#'   Lawless, *Statistical Models and Methods for Lifetime Data* (2003). The standard error is
#'   that of the observed information, `sqrt(p (1 - p) / rounds played)`.
#' @seealso [search_random()]
#' @export
#' @examplesIf gym:::can_start_server()
#' searches <- search_repeat("CartPole-v0", seeds = 1:10)
#' searches
#' as.data.frame(searches)
#' plot(searches)
#'
#' # The search of one seed again.
#' search_random("CartPole-v0", seed = 3)
search_repeat <- function(env = "CartPole-v0", policy = policy_network(), rounds = 50,
                          episodes = 5, target = NULL, max_steps = NULL, seeds = 1:100,
                          progress = rlang::is_interactive(), client = gym_client()) {
  check_count(rounds)
  rounds <- as.integer(rounds)
  keep_random_state(force(policy))
  given <- list(
    target = target, template = policy, max_rounds = rounds,
    episodes = as.integer(episodes),
    max_steps = max_steps
  )
  trained <- withCallingHandlers(
    naming_own_call(
      train_agent(
        agent_random(), env, policy, iterations = rounds, episodes = episodes, target = target,
        max_steps = max_steps, seeds = seeds, solved_by = "candidate", progress = progress,
        client = client
      ),
      "train_agent"
    ),
    gym_error_search = function(cnd) {
      if (inherits(cnd$result, "gym_trainings")) {
        cnd$result <- new_searches(cnd$result, given)
        rlang::cnd_signal(cnd)
      }
    }
  )
  new_searches(trained, given)
}

# A row for each search that was finished.
new_searches <- function(trained, given) {
  done <- Filter(function(search) !search$interrupted, trained$trainings)
  column <- function(f, type) unname(vapply(done, f, type))
  searches <- data.frame(
    seed = narrow_whole(column(function(search) as.numeric(search$seed), 0)),
    solved = column(function(search) search$solved, NA),
    round = column(function(search) if (search$solved) search$round else NA_integer_, 0L),
    rounds = column(function(search) nrow(search$rounds), 0L),
    mean_return = column(function(search) max(search$rounds$mean_return), 0),
    steps = column(function(search) sum(search$rounds$steps), 0L),
    elapsed = column(function(search) search$elapsed, 0)
  )
  given["target"] <- list(given$target %||% trained$target)
  origin <- trained$provenance
  if (!is.null(origin)) origin$seed <- as.numeric(searches$seed)
  structure(
    c(
      list(searches = searches), round_chance(searches), list(env_id = trained$env_id), given,
      list(elapsed = trained$elapsed, interrupted = trained$interrupted, provenance = origin)
    ),
    class = "gym_searches"
  )
}

#' Estimate the chance of a round, as `?search_repeat` describes
#' @noRd
round_chance <- function(searches) {
  solved <- sum(searches$solved)
  played <- sum(searches$rounds)
  chance <- if (played > 0) solved / played else NA_real_
  se <- if (solved > 0) sqrt(chance * (1 - chance) / played) else NA_real_
  list(chance = chance, se = se)
}

# Printing and summarising ---------------------------------------------------------

#' @export
as.data.frame.gym_searches <- function(x, row.names = NULL, optional = FALSE, ...) x$searches

#' @export
print.gym_searches <- function(x, ...) {
  cat(searches_lines(x), sep = "\n")
  invisible(x)
}

searches_lines <- function(x) {
  c(
    paste0("Random search in ", x$env_id, ", repeated with ",
           count_of(nrow(x$searches), "seed")),
    paste0("Policy: ", policy_text(x$template)),
    "",
    solved_line(x),
    chance_line(x),
    searches_effort_line(x)
  )
}

solved_line <- function(x) {
  n <- nrow(x$searches)
  if (n == 0L) {
    return("Ended before the first search was finished")
  }
  solved <- sum(x$searches$solved)
  rounds <- x$searches$round[x$searches$solved]
  paste0(
    "Solved within ", count_of(x$max_rounds, "round"), ": ", solved, " of ", n, " (",
    percent_text(solved / n), ")",
    if (solved > 0L) paste0(", in round ", number_text(mean(rounds)), " on average")
  )
}

chance_line <- function(x) {
  if (isTRUE(x$chance > 0)) {
    paste0("Chance of a round: ", percent_text(x$chance), " (standard error ",
           percent_text(x$se), "), one in ", number_text(1 / x$chance))
  }
}

searches_effort_line <- function(x) {
  rounds <- sum(x$searches$rounds)
  paste0(
    if (x$interrupted) "Interrupted after " else "Played ", count_of(rounds, "round"), ", ",
    count_of(rounds * x$episodes, "episode"), ", ", count_of(sum(x$searches$steps), "step"),
    " in ", seconds_text(x$elapsed)
  )
}

#' @export
summary.gym_searches <- function(object, ...) {
  solved <- object$searches$solved
  structure(
    list(
      searches = object,
      share = if (length(solved)) mean(solved) else NA_real_,
      rounds = quartiles(object$searches$round[solved])
    ),
    class = "summary.gym_searches"
  )
}

#' @export
print.summary.gym_searches <- function(x, ...) {
  print(x$searches)
  if (any(x$searches$searches$solved)) {
    cat("\nRounds of those that were solved:\n")
    print(signif(x$rounds, 4L))
  }
  invisible(x)
}
