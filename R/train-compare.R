#' Compare trainings
#'
#' Compare agents over many seeds, with intervals: by their scores at a common budget, or by the
#' steps that they needed to reach a target.
#'
#' # Scores
#'
#' Trainings without a target (`target = Inf`) are compared by their scores, the mean returns of the
#' final evaluations. A training ends with the iteration that uses up its budget, so `print()` shows
#' the steps that were taken; `total_steps` compares the learning curves at one number of steps.
#' If budgets differ, that is the smallest number that all have taken, and `print()` says so. The
#' statistics are those of Agarwal et al. (2021):
#'
#' * `mean` of all scores; `median` of the environments' mean scores, with several environments; and
#'   `iqm`, the interquartile mean: the mean of the middle half of all runs, which a few lucky or
#'   failed seeds change little;
#' * the probability of improvement: the probability that a run of one agent scores higher than one
#'   of another, averaged over the environments;
#' * the performance profile: the share of runs that score more than each number.
#'
#' Intervals are percentiles of a stratified bootstrap, which resamples the runs of each
#' environment.
#'
#' With several environments, scores are normalised so that 0 is `low` and 1 is `high` of
#' `reference`. By default these are the mean return of a random policy (100 episodes, seed 1) and
#' the environment's threshold, see [train_agent()].
#'
#' # Steps to a target
#'
#' Trainings that stop at a target all score about that target. They are compared by the steps that
#' they needed to reach it. A run whose final evaluation reached it needed all of its steps. A run
#' whose final evaluation did not reach it has failed: it never reaches the target. Interrupted runs
#' are left out. The intervals of the share of runs that have reached the target after so many steps
#' are Wilson's. The interval of the median starts at the first number of steps where the upper
#' bound of the share is at least one half, and ends where the lower bound is.
#'
#' @param ... Trainings of class [gym_trainings] or `gym_training`, with or without names. Those of
#'   one agent in several environments have the same name. Or one data frame as returned by
#'   [learning_curves()], including logs of other programs, compared by scores.
#' @param total_steps The number of steps of the training after which scores are compared. `NULL`,
#'   the default, is the common budget.
#' @param reference `NULL`, the default, or a data frame with the columns `env_id`, `low` and
#'   `high`, which also normalises scores in one environment.
#' @param reps The number of bootstrap samples, a whole number of at least 1.
#' @param level The confidence level of the intervals, a number between 0 and 1.
#' @param seed A whole number that fixes the bootstrap. `NULL`, the default, draws one from the
#'   session's generator: the bounds of the intervals then differ a little from call to call, unless
#'   [set.seed()] comes before. `print()` shows the seed that repeats them.
#' @param x A comparison.
#' @param row.names,optional Not used.
#' @return An object of class `gym_comparison`, a list with the elements
#'   \describe{
#'     \item{by}{`"scores"` or `"steps"`.}
#'     \item{table}{A data frame, which `as.data.frame()` returns. For scores it has a row for each
#'       training and statistic: `training`, `runs` (an integer), `statistic` (`"mean"`, `"median"`,
#'       `"iqm"`), `value`, `lower`, `upper`. For steps it has a row for each training and
#'       environment: `training`, `env_id`, `runs`, `reached` (the number of runs, an integer),
#'       `median`, `lower`, `upper` (steps, `NA` if fewer than half have reached the target).}
#'     \item{runs}{A data frame with a row for each run: `training`, `env_id`, `seed`, `steps`, and
#'       `score`, or `reached` (a logical).}
#'     \item{improvement}{For scores, a data frame with a row for each pair: `training`, `than`,
#'       `probability`, `lower`, `upper`.}
#'     \item{profile}{A data frame of the curves that [plot()][plot.gym_comparison()] shows:
#'       `training`, `score` (or `env_id` and `steps`), `share`, `lower`, `upper`.}
#'     \item{reference}{The data frame that normalised the scores, or `NULL`.}
#'     \item{envs}{The environments with their wrappers, strings with the names `env_id`.}
#'     \item{notes}{Differences that make the comparison unfair, strings.}
#'     \item{total_steps, level, reps, seed}{As given, found or drawn.}
#'   }
#' @section Errors: `gym_error_argument` for trainings that cannot be compared. With fewer than five
#'   seeds a warning, `gym_warning_seeds`, says that intervals mean little.
#' @references R. Agarwal, M. Schwarzer, P. S. Castro, A. Courville and M. G. Bellemare (2021), Deep
#'   reinforcement learning at the edge of the statistical precipice, NeurIPS 34,
#'   <https://arxiv.org/abs/2108.13264>; code: <https://github.com/google-research/rliable>.
#'   E. B. Wilson (1927), Probable inference, the law of succession, and statistical inference,
#'   Journal of the American Statistical Association 22, 209-212.
#' @seealso [learning_curves()], [sweep_agent()]
#' @export
#' @examplesIf gym:::can_start_server()
#' train <- function(agent) {
#'   train_agent(agent, "CartPole-v1", total_steps = 2000, target = Inf, seeds = 1:5,
#'               eval_episodes = 20)
#' }
#' ars <- train(agent_ars())
#' hill <- train(agent_hill_climb(candidates = 16))
#' compared <- compare_trainings(ARS = ars, `hill climbing` = hill, seed = 1)
#' compared
#' plot(compared)
compare_trainings <- function(..., total_steps = NULL, reference = NULL, reps = 2000, level = 0.95,
                              seed = NULL) {
  call <- rlang::current_env()
  check_no_steps(...names(), call)
  check_number(total_steps, min = 0, allow_null = TRUE)
  columns <- c("env_id", "low", "high")
  if (!is.null(reference) && !(is.data.frame(reference) && all(columns %in% names(reference)))) {
    must <- "NULL, or a data frame with the columns env_id, low and high"
    abort_argument(reference, must, "reference", call)
  }
  check_count(reps)
  check_seed(seed)
  check_level(level)
  given <- name_results(list(...), as.list(substitute(list(...)))[-1L])
  curves <- if (length(given) == 1L && is.data.frame(given[[1L]])) given[[1L]]
  trainings <- if (is.null(curves)) {
    check_are_trainings(given, call)
    given_trainings(given, call, unique = FALSE)
  } else {
    missing <- setdiff(c("training", "seed", "steps", "mean_return"), names(curves))
    if (length(missing)) {
      must <- paste0("a table as `learning_curves()` returns it, with a column `", missing[[1L]],
                     "`")
      abort_argument(curves, must, "...", call)
    }
    list()
  }
  if (!length(trainings) && !NROW(curves)) {
    abort_wrong("...", NULL, call, "There is nothing to compare: give trainings.")
  }
  check_different_runs(trainings, call)
  settings <- list(
    total_steps = total_steps, level = level, reps = as.integer(reps), seed = seed %||% draw_seed()
  )
  compared <- if (stop_at_target(trainings, call)) {
    compare_by_steps(trainings, level, call)
  } else {
    curves <- curves %||% do.call(rbind, curves_of(trainings, NULL))
    compare_by_scores(trainings, curves, settings, reference, call)
  }
  settings["total_steps"] <- compared["total_steps"]
  ids <- unique(compared$runs$env_id)
  compared$envs <- if (length(trainings)) {
    env_names(trainings)
  } else if (!anyNA(ids)) {
    stats::setNames(ids, ids)
  }
  compared$notes <- c(compared$notes, unequal_rules(trainings))
  compared$total_steps <- NULL
  few <- min(runs_each(compared$runs))
  if (few < 5L) {
    cli::cli_warn(
      c("There {?is/are} {few} seed{?s} of a training: intervals of so few mean little.",
        i = "Train with at least five, better ten or more."),
      class = "gym_warning_seeds"
    )
  }
  structure(c(compared, settings), class = "gym_comparison")
}

check_are_trainings <- function(given, call) {
  wrong <- Filter(function(x) !inherits(x, c("gym_training", "gym_trainings")), given)
  if (!length(wrong)) {
    return()
  }
  name <- names(wrong)[[1L]]
  choices <- setdiff(names(formals(compare_trainings)), "...")
  several <- is.list(wrong[[1L]]) &&
    any(vapply(wrong[[1L]], inherits, NA, c("gym_training", "gym_trainings")))
  abort_wrong(
    "...", wrong[[1L]], call,
    '{if (nzchar(name)) paste0("`", name, "`") else "Each argument"} must be a training, not
     {describe_argument(wrong[[1L]])}.',
    i = if (nzchar(name)) did_you_mean(name, choices),
    i = if (inherits(wrong[[1L]], "gym_sweep")) "`sweep$comparison` compares its settings.",
    i = if (several) "`do.call(compare_trainings, x)` compares the trainings of a list."
  )
}

# Trainings with a target are compared by steps, and others by scores, so either all have a target
# or none.
stop_at_target <- function(trainings, call) {
  stops <- vapply(trainings, function(x) is.finite(each_training(x)[[1L]]$target %||% Inf), NA)
  abort_if(
    any(stops) && !all(stops), "...", NULL, call,
    "Some trainings stop at a target ({toString(names(trainings)[stops])}), and others do not
     ({toString(names(trainings)[!stops])}).",
    i = "Train all with `target = Inf` to compare scores, or all with the same target."
  )
  any(stops)
}

# Trainings of the same agent in several environments, or with other seeds, have the same name.
check_different_runs <- function(trainings, call) {
  keys <- unlist(Map(function(x, label) {
    vapply(each_training(x), function(one) paste(label, one$env_id, one$seed, sep = "\r"), "")
  }, trainings, names(trainings)))
  if (anyDuplicated(keys)) {
    twice <- strsplit(keys[duplicated(keys)][[1L]], "\r", fixed = TRUE)[[1L]]
    abort_wrong(
      "...", twice[[1L]], call,
      'Two trainings in {twice[[2L]]} are called "{twice[[1L]]}" and have the seed {twice[[3L]]}.',
      i = "Give each its own name: `compare_trainings(first = a, second = b)`."
    )
  }
}

# The number of runs of each training in each environment.
runs_each <- function(runs) table(paste(runs$training, runs$env_id, sep = "\r"))

#' @rdname compare_trainings
#' @export
as.data.frame.gym_comparison <- function(x, row.names = NULL, optional = FALSE, ...) x$table

#' @export
print.gym_comparison <- function(x, ...) print_lines(x, comparison_lines(x))

# Trainings finish their last iteration, so they take more steps than their budget. With many
# trainings, give the range of all.
steps_taken_line <- function(runs) {
  of_few <- length(unique(runs$training)) <= 4L
  taken <- if (of_few) {
    split_in_order(runs$steps, runs$training)
  } else {
    list(runs$steps)
  }
  ranges <- vapply(taken, function(steps) {
    paste(unique(vapply(range(steps), whole_number_text, "")), collapse = " to ")
  }, "")
  paste("Steps taken:", paste0(names(ranges), if (of_few) " ", ranges, collapse = "; "))
}

# `n` trainings have n * (n - 1) / 2 pairs.
most_pairs_shown <- 6L

improvement_lines <- function(pairs, interval) {
  if (NROW(pairs) > most_pairs_shown) {
    return(paste0("Probabilities of ", nrow(pairs), " pairs: the element `improvement`, and ",
                  "`plot(type = \"improvement\")`"))
  }
  if (NROW(pairs)) {
    paste0("Probability that ", pairs$training, " scores higher than ", pairs$than, ": ",
           interval(pairs$probability, pairs$lower, pairs$upper))
  }
}

comparison_lines <- function(x, pairs = TRUE) {
  scores <- x$by == "scores"
  envs <- length(x$envs)
  seeds <- unique(range(runs_each(x$runs)))
  where <- if (envs > 1L) count_of(envs, "environment") else x$envs
  table <- x$table
  interval <- function(value, lower, upper) {
    text <- number_text_each
    paste0(text(value), " [", text(lower), ", ", text(upper), "]")
  }
  shown <- if (scores) {
    each <- split_in_order(table, table$statistic)
    columns <- lapply(each, function(rows) interval(rows$value, rows$lower, rows$upper))
    data.frame(columns, row.names = unique(table$training))
  } else {
    columns <- c(
      if (envs > 1L) table["env_id"],
      list(
        reached = paste(table$reached, "of", table$runs),
        `median steps` = interval(table$median, table$lower, table$upper)
      )
    )
    data.frame(columns, check.names = FALSE, row.names = make.unique(table$training, " "))
  }
  c(
    paste0(
      if (scores) "Scores" else "Steps to the target", if (envs) paste0(" in ", where),
      if (scores) paste(if (x$by_end) " at a budget of" else " after",
                        count_of(round(x$total_steps), "step")),
      ", ", paste(seeds, collapse = " to "), " seed", if (max(seeds) > 1L) "s", " each"
    ),
    if (scores && x$by_end) steps_taken_line(x$runs),
    if (!is.null(x$reference)) "Normalised: 0 is low, 1 is high of the reference",
    utils::capture.output(print(shown)),
    paste0(
      percent_text(x$level), " intervals: ",
      if (scores) {
        paste0("stratified bootstrap, ", count_of(x$reps, "draw"), ", repeated by `seed = ",
               format(x$seed, scientific = FALSE), "`")
      } else {
        "Wilson's"
      }
    ),
    if (pairs) improvement_lines(x$improvement, interval),
    paste0("Note: ", x$notes, recycle0 = TRUE)
  )
}

# By steps -----------------------------------------------------------------------------

# Compares trainings that stop at a target by the steps that they needed.

compare_by_steps <- function(trainings, level, call) {
  runs <- do.call(rbind, unname(Map(function(x, label) {
    ones <- each_training(x)
    of_each <- function(f, type) vapply(ones, f, type)
    data.frame(
      training = label, env_id = of_each(function(one) one$env_id, ""),
      seed = of_each(function(one) as.numeric(one$seed), 0),
      steps = of_each(function(one) as.numeric(one$steps), 0),
      reached = of_each(function(one) isTRUE(one$solved), NA),
      interrupted = of_each(function(one) one$interrupted, NA)
    )
  }, trainings, names(trainings))))
  notes <- if (any(runs$interrupted)) interrupted_note(sum(runs$interrupted))
  runs <- runs[!runs$interrupted, names(runs) != "interrupted"]
  if (!nrow(runs)) {
    abort_wrong("...", NULL, call, "There is nothing to compare: all runs were interrupted.")
  }
  profiles <- lapply(split_in_order(runs, runs$training, runs$env_id), reached_profile, level)
  list(
    by = "steps", table = do.call(rbind, unname(lapply(profiles, attr, "summary"))), runs = runs,
    profile = do.call(rbind, unname(profiles)), notes = notes
  )
}

interrupted_note <- function(count) paste(count_of(count, "interrupted run"), "left out")

#' Compute the share of runs that have reached the target after so many steps
#' @param runs The runs of one training in one environment.
#' @return A data frame with a row for 0 steps and for each number at which a run ended: `training`,
#'   `env_id`, `steps`, `share`, `lower`, `upper`. Its attribute `summary` is the row of the table.
#' @noRd
reached_profile <- function(runs, level) {
  steps <- c(0, sort(unique(runs$steps)))
  reached <- vapply(steps, function(most) sum(runs$reached & runs$steps <= most), 0L)
  interval <- vapply(reached, wilson_interval, numeric(2), nrow(runs), level)
  first_half <- function(shares) steps[which(shares >= 0.5)[1L]]
  own <- runs[1L, c("training", "env_id")]
  profile <- data.frame(
    own, steps = steps, share = reached / nrow(runs), lower = interval[1L, ],
    upper = interval[2L, ], row.names = NULL
  )
  structure(profile, summary = data.frame(
    own, runs = nrow(runs), reached = sum(runs$reached), median = first_half(profile$share),
    lower = first_half(profile$upper), upper = first_half(profile$lower), row.names = NULL
  ))
}
