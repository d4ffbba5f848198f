#' Repeat a random search with many seeds
#'
#' Play [search_random()] once with each of many seeds, in one environment, and keep a row of
#' results for each. One search says little about how long searches take, because its number of
#' rounds is random. A plot shows the rounds that the searches needed, with the geometric
#' distribution that they follow.
#'
#' The row of a seed is the result of `search_random(seed = )` with that seed and the same
#' arguments. Call it to see that search again or to get its policy. (Results may differ in an
#' environment made before that remembers something beyond a reset, such as one wrapped in
#' `NormalizeReward`.) The session's random number generator is left as it was.
#'
#' # The success probability of a round
#'
#' Each round draws new weights, so all rounds have the same chance to reach the target, and the
#' number of rounds has a geometric distribution. The probability is estimated by maximum
#' likelihood: the number of solved searches divided by the number of all rounds. Rounds of unsolved
#' searches count, too. These searches are censored, and leaving them out would overestimate the
#' probability.
#'
#' # When it ends early
#'
#' If you interrupt it (Ctrl-C, or Esc), it returns the finished searches, with a message. An error
#' has the class `gym_error_search` in addition to its own, and its field `result` has the finished
#' searches.
#'
#' @inheritParams search_random
#' @param rounds The largest number of rounds in a search, a whole number of at least 1. The default
#'   is 50.
#' @param target The mean return of a round that ends a search, a number. `NULL`, the default, uses
#'   the environment's reward threshold. Give a target if it has none.
#' @param seeds The seeds, different whole numbers. The default is 1 to 100. With CartPole each
#'   takes less than a tenth of a second.
#' @return An object of class `gym_searches`, with methods for [print()], [summary()],
#'   [as.data.frame()] and [plot()][plot.gym_searches()]. It is a list with the elements
#'   \describe{
#'   \item{searches}{A data frame with one row for each seed: `seed` (a whole number), `solved`
#'   (logical), `round` (integer, the round that reached the target, or `NA`), `rounds` (integer,
#'   the number of rounds played), `mean_return` (double, of the best round), `steps` (integer),
#'   `elapsed` (double, in seconds). `as.data.frame()` returns it.}
#'   \item{chance, se}{The success probability of a round and its standard error, doubles. `NA` if
#'   no search was finished. The error is also `NA` if no search was solved.}
#'   \item{env_id, target, template, max_rounds, episodes, max_steps}{The environment's id, the
#'   target, `policy`, `rounds`, `episodes`, `max_steps`.}
#'   \item{elapsed}{The time it took in seconds, a double.}
#'   \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#'   `summary()` returns an object of class `summary.gym_searches`, a list with the elements
#'   `searches` (the object), `share` (the share of solved searches, a double) and `rounds`
#'   (quartiles and mean of the rounds of solved searches, a named numeric vector of length 6).
#' @section Errors: As for [search_random()]. Also `gym_error_argument` for an environment without a
#'   reward threshold if no target is given.
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
  unchosen <- if (missing(env)) "gym_warning_gymnasium" else character()
  rounds <- as.integer(rounds)
  keep_random_state(force(policy))
  given <- list(
    target = target, template = policy, max_rounds = rounds,
    episodes = as.integer(episodes),
    max_steps = max_steps
  )
  trained <- suppressWarnings(classes = unchosen, withCallingHandlers(
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
  ))
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

#' Estimate the success probability of a round, as `?search_repeat` describes
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
    paste0("Random search in ", env_text(x), ", repeated with ",
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
    elapsed_text(x$elapsed)
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
