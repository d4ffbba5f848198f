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
  seeds <- plain_numbers(seeds)
  check_seeds(seeds)
  check_flag(progress)
  call <- rlang::current_env()
  settings <- search_settings(env, policy, rounds, episodes, target, max_steps)
  play <- function(vector_env) {
    settings <- settings_in(vector_env, settings)
    check_target(settings, call)
    template <- policy_bind(settings$policy, vector_env, call = call)
    anew <- length(vector_env$remembers) && !is_playable(env)
    with_env <- if (anew) in_env else function(use) use(vector_env)
    play_searches(with_env, template, settings, seeds, progress, call)
  }
  in_env <- function(use, ...) {
    with_vector_env(env, as.numeric(rounds) * episodes, use, ..., client = client, call = call)
  }
  in_env(play, max_steps)
}

check_target <- function(settings, call) {
  if (is.null(settings$target)) {
    gym_abort(
      c(paste0(settings$env_id, " has no reward threshold, so that nothing says when a search ",
               "has solved it."),
        i = "Give the mean return that does as `target`."),
      class = "gym_error_argument", argument = "target", call = call
    )
  }
}

#' Play a search with each seed
#'
#' An interrupt ends them early; so does an error, which carries the searches that were finished.
#' @param with_env A function that calls a function with a vector environment: the same for all
#'   seeds, or one that is made anew where it remembers earlier episodes.
#' @return As [search_repeat()].
#' @noRd
play_searches <- function(with_env, template, settings, seeds, progress, call) {
  started <- proc.time()[["elapsed"]]
  show <- progress_bar(length(seeds), "Search", "0 solved, ", shown = progress)
  rows <- list()
  origin <- NULL
  play <- function() {
    for (seed in seeds) {
      search <- play_seed(with_env, template, settings, seed, call)
      if (search$interrupted) {
        rlang::interrupt()
      }
      origin <<- origin %||% search$provenance
      rows <<- c(rows, list(search_row(search)))
      show(length(rows), paste0(sum(vapply(rows, function(row) row$solved, NA)), " solved, "))
    }
  }
  interrupted <- tryCatch(
    until_interrupted(
      play(), "Interrupted after {finished} of {total} seed{?s}; what was finished is returned.",
      function() length(rows), length(seeds)
    ),
    error = function(cnd) {
      result <- new_searches(rows, settings, started, interrupted = FALSE, origin)
      abort_with_result(cnd$parent %||% cnd, "The search", result,
                        count_of(length(rows), "seed"), "gym_error_search", call)
    }
  )
  new_searches(rows, settings, started, interrupted, origin)
}

# An interrupt of one search ends all of them. Messages come once, for all.
play_seed <- function(with_env, template, settings, seed, call) {
  settings$seed <- seed
  quietly_for_seed(with_env(function(vector_env) {
    agent <- agent_start(agent_random(), template)
    play_search(agent, vector_env, settings, progress = FALSE, call)
  }))
}

search_row <- function(search) {
  data.frame(
    seed = narrow_whole(search$seed), solved = search$solved,
    round = if (search$solved) search$round else NA_integer_,
    rounds = nrow(search$rounds), mean_return = max(search$rounds$mean_return),
    steps = sum(search$rounds$steps), elapsed = search$elapsed
  )
}

new_searches <- function(rows, settings, started, interrupted, origin = NULL) {
  none <- data.frame(
    seed = integer(), solved = logical(), round = integer(), rounds = integer(),
    mean_return = numeric(), steps = integer(), elapsed = numeric()
  )
  searches <- do.call(rbind, c(list(none), rows))
  chance <- round_chance(searches)
  if (!is.null(origin)) {
    origin$seed <- as.numeric(searches$seed)
  }
  structure(
    list(
      searches = searches, chance = chance$chance, se = chance$se,
      env_id = settings$env_id, target = settings$target, template = settings$policy,
      max_rounds = settings$rounds, episodes = settings$episodes,
      max_steps = settings$max_steps,
      elapsed = proc.time()[["elapsed"]] - started, interrupted = interrupted,
      provenance = origin
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
