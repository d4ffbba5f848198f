#' Evaluate a policy with data from another policy
#'
#' Estimate the value of a policy without playing it, from steps that another policy took. The value
#' is the expected discounted return, averaged over the first states of the episodes in the data.
#'
#' # Methods
#'
#' All of them estimate the same value.
#'
#' | method | estimate | source |
#' |---|---|---|
#' | `"fqe"` | fitted Q evaluation: values of the policy by a regression | Le 2019 |
#' | `"is"` | returns, weighted by how much likelier the policy makes them | Precup 2000 |
#' | `"wis"` | the same, with weights that add up to 1 | Precup 2000 |
#' | `"pdis"` | as `"is"`, but each reward has the weight of the decisions up to it | Precup 2000 |
#' | `"dr"` | the regression, corrected by weighted residuals (doubly robust) | Jiang and Li 2016 |
#' | `"wdr"` | the same, with weights that add up to 1 at each step | Thomas and Brunskill 2016 |
#'
#' Importance sampling needs the correct probabilities of the actions in the data. Fitted Q
#' evaluation needs a correct regression. The doubly robust methods need only one of the two to be
#' correct. They predict the values of each episode by a regression on other episodes (five folds).
#' If episodes were cut off, nobody knows the rewards after the cut. All methods but `"fqe"` then
#' need a `horizon` that is no longer than the shortest of these episodes.
#'
#' All methods are biased if something influenced both actions and rewards and is not in the data
#' (confounding).
#'
#' # Intervals
#'
#' The bootstrap draws episodes with replacement, as many as there are, and estimates the value
#' again. It does so `replicates` times and takes percentiles of the estimates. The interval is
#' widened a little, because percentile intervals of few episodes are too short (the expanded
#' percentile interval, Hesterberg 2015). Each time, `"fqe"` fits its regression again, `"wis"` and
#' `"wdr"` normalise their weights again, and a model of behavior is estimated again if there is
#' one. `"dr"` and `"wdr"` keep their regression. `interval = "t"` uses the mean and the standard
#' error over episodes instead. It is for `"is"`, `"pdis"` and `"dr"` with known probabilities.
#'
#' @inheritParams learn_fitted_q
#' @param policy The policy: the result of [learn_fitted_q()] or [learn_q()]; any other policy, such
#'   as [policy_random()] or a [policy_table()]; a function of a data frame of states that returns
#'   an action for each row, or a matrix with the probability of each action; or one action, which
#'   is then always taken. Actions of several parts are data frames with the columns of the parts.
#' @param method The methods, strings. The default is all of them.
#' @param behavior How the actions of the data were chosen: a formula of the state, such as `~
#'   severity + age`, for a logistic regression on these columns; or a policy, in the forms that
#'   `policy` may have. `NULL`, the default, uses the column `probability`. Without this column, it
#'   uses the shares of actions in each state if states can be counted, and otherwise a logistic
#'   regression on all columns.
#' @param formula,model The regression of values, as for [learn_fitted_q()].
#' @param level The level of the intervals, a number between 0 and 1. The default is 0.95.
#' @param folds `NULL`, the default; or a number of folds, if the policy was learned from the same
#'   data. For each fold, the policy is learned again without the episodes of this fold, and then
#'   evaluated on these episodes. The result estimates the mean value of the policies learned in
#'   this way.
#' @param interval `"bootstrap"`, the default, or `"t"`.
#' @param replicates The number of bootstrap replicates, a whole number. The default is 1,000.
#' @param seed A whole number that fixes folds and replicates. `NULL`, the default, draws one from
#'   the session's generator.
#' @return An object of class `gym_offline`, with methods for [print()], [as.data.frame()] and
#'   [plot()][plot.gym_offline()]. It is a list with the elements
#'   \describe{
#'     \item{estimates}{A data frame with a row for each method: `method`, `estimate`, `se`, `lower`
#'       and `upper`. `as.data.frame()` returns it.}
#'     \item{observed}{The same for the policy that took the steps, from its returns. `NA` if
#'       episodes were cut off and there is no horizon.}
#'     \item{weights}{The weight of each episode: the probability of all its actions under the
#'       policy, divided by that in the data. `NULL` if the only method is `"fqe"`.}
#'     \item{effective}{The effective number of episodes, `sum(weights)^2 / sum(weights^2)`.}
#'     \item{replicates}{A matrix with a row for each replicate and a column for each method, or
#'       `NULL`.}
#'     \item{episodes, steps, discount, horizon, level, folds, seed, model, behavior}{The arguments
#'       as given, or a description of what was used.}
#'   }
#' @section Errors: `gym_error_argument` for invalid arguments, actions that the data never took,
#'   cut episodes without a horizon, a policy that was learned from the same episodes, or fewer than
#'   two episodes.
#' @section Warnings: `gym_warning_offline` if the estimate depends on few episodes, or on actions
#'   that the data never took in some states.
#' @references T. Hesterberg (2015), What teachers should know about the bootstrap, The American
#'   Statistician 69. N. Jiang, L. Li (2016), Doubly robust off-policy value evaluation for
#'   reinforcement learning, ICML. H. Le, C. Voloshin, Y. Yue (2019), Batch policy learning under
#'   constraints, ICML. D. Precup, R. Sutton, S. Singh (2000), Eligibility traces for off-policy
#'   policy evaluation, ICML. P. Thomas, E. Brunskill (2016), Data-efficient off-policy policy
#'   evaluation for reinforcement learning, ICML.
#' @export
#' @examples
#' set.seed(1)
#' visits <- data.frame(patient = 1:300, severity = runif(300),
#'                      drug = sample(c("old", "new"), 300, replace = TRUE), p = 0.5)
#' visits$wellbeing <- with(visits, ifelse(drug == "new", severity, 1 - severity)) + rnorm(300)
#' steps <- steps_data(visits, "patient", "severity", "drug", "wellbeing", probability = "p")
#' evaluated <- evaluate_offline(
#'   steps, function(states) ifelse(states$severity > 0.5, "new", "old"), seed = 1
#' )
#' evaluated
#' plot(evaluated)
evaluate_offline <- function(data, policy, method = c("fqe", "is", "wis", "pdis", "dr", "wdr"),
                             behavior = NULL, formula = NULL, model = NULL, discount = 1,
                             horizon = NULL, stages = FALSE, level = 0.95, folds = NULL,
                             interval = c("bootstrap", "t"), replicates = 1000, seed = NULL) {
  call <- rlang::current_env()
  steps <- steps_of(data, call)
  method <- check_methods(method, call)
  check_discount(discount)
  check_horizon(horizon, stages, steps, call)
  check_level(level)
  interval <- check_choice(interval[1L], c("bootstrap", "t"), arg = "interval")
  check_count(replicates, min = 2)
  check_seed(seed)
  check_many_episodes(steps, folds, call)
  weighted <- setdiff(method, "fqe")
  if (length(weighted)) check_cut(steps, horizon, weighted, call)
  policy <- offline_policy(policy, steps, folds, call)
  seed <- seed %||% draw_seed()
  generator <- new_generator(seed)
  fold <- with_generator(generator, sample(rep_len(seq_len(folds %||% 5L), steps$episodes)))
  rules <- rules_of_folds(policy, steps, fold, folds)
  act <- action_probabilities(rules, steps, fold, call)
  chosen <- if (length(weighted)) behavior_of(behavior, steps, call)
  check_interval(interval, method, chosen, call)
  design <- list(
    steps = steps, discount = discount, horizon = horizon, stages = stages, fold = fold,
    # In each stratum weights add up to 1, and all values are of the same policy.
    stratum = if (is.null(folds)) rep(1L, steps$episodes) else fold, act = act,
    regression = if (any(c("fqe", "dr", "wdr") %in% method)) {
      regression_of(steps, formula, model, call)
    },
    chosen = chosen, call = call
  )
  check_pairs(design)
  prepared <- prepare_methods(design, method)
  estimates <- estimate_methods(design, method, prepared, matrix(1, steps$episodes, 1L))[1L, ]
  draws <- if (interval == "bootstrap") {
    with_generator(
      generator, estimate_methods(design, method, prepared, drawn_counts(design, replicates))
    )
  }
  result <- new_offline(design, method, prepared$parts, estimates, draws, level)
  result[c("policy", "folds", "seed", "interval")] <- list(policy, folds, seed, interval)
  if (length(weighted)) warn_few_episodes(result)
  result
}

# Checks --------------------------------------------------------------------------------

offline_methods <- c("fqe", "is", "wis", "pdis", "dr", "wdr")

check_methods <- function(method, call) {
  for (one in method) check_choice(one, offline_methods, arg = "method", call = call)
  intersect(offline_methods, method)
}

check_many_episodes <- function(steps, folds, call) {
  check_count(folds, min = 2, allow_null = TRUE, call = call)
  least <- folds %||% 1L * 2L
  abort_if(
    steps$episodes < least, "data", steps$episodes, call,
    'The data has {count_of(steps$episodes, "episode")}, but at least {least} are needed to say
     how sure an estimate is.',
    i = "`steps_data(episode = )` tells which steps belong together."
  )
}

check_cut <- function(steps, horizon, weighted, call) {
  shortest <- if (length(steps$cut)) min(steps$cut)
  abort_if(
    !is.null(shortest) && (horizon %||% Inf) > shortest, "horizon", horizon, call,
    '{count_of(length(steps$cut), "episode")} of the data
     {if (length(steps$cut) == 1L) "was" else "were"} cut off, the first after
     {count_of(shortest, "step")}, so {quoted_names(weighted)} cannot know all rewards.',
    i = 'Give a `horizon` of at most {shortest}, or `method = "fqe"`.'
  )
}

check_interval <- function(interval, method, chosen, call) {
  unfit <- setdiff(method, c("is", "pdis", "dr"))
  abort_if(
    interval == "t" && (length(unfit) || chosen$estimated), "interval", interval, call,
    if (length(unfit)) {
      '`interval = "t"` is for "is", "pdis" and "dr", not for
       {toString(dQuote(unfit, FALSE))}: use "bootstrap".'
    } else {
      '`interval = "t"` needs known probabilities of the actions, not estimated ones: use
       "bootstrap".'
    }
  )
}

# Warn if the policy takes actions in states for which the table has no data.
check_pairs <- function(design) {
  regression <- design$regression
  if (is.null(regression$states)) {
    return(invisible())
  }
  here <- regression$block(design$steps$state)
  taken <- matrix(FALSE, nrow(regression$states), nrow(design$steps$actions))
  taken[cbind(here, design$steps$action)] <- TRUE
  without <- rowSums(design$act$here * !taken[here, , drop = FALSE])
  share <- mean(without)
  if (share > 0) {
    rlang::warn(
      c(paste0("In ", percent_text(share), " of the steps the policy takes an action that the ",
               "data never took in that state."),
        i = "The table counts 0 for such an action. Give a `formula` or a `model`."),
      class = "gym_warning_offline", call = design$call
    )
  }
}

warn_few_episodes <- function(result) {
  largest <- max(result$weights) / max(sum(result$weights), .Machine$double.xmin)
  if (result$effective < 10 || largest > 0.2) {
    rlang::warn(
      c(paste0("The weighted estimates depend on few episodes: ",
               whole_number_text(result$episodes), " count as ", number_text(result$effective),
               ", and one episode has ", percent_text(largest), " of the weight."),
        i = "The policy differs too much from the data's, or the `horizon` is too long."),
      class = "gym_warning_offline"
    )
  }
}

# Results -------------------------------------------------------------------------------

new_offline <- function(design, method, parts, estimates, draws, level) {
  steps <- design$steps
  tail <- bootstrap_tail(design, level)
  rows <- Map(function(one, estimate) {
    if (is.null(draws)) {
      mean_interval(episode_scores(parts, one), level)
    } else {
      ends <- stats::quantile(draws[, one], c(tail, 1 - tail), names = FALSE, type = 6)
      c(estimate, stats::sd(draws[, one]), ends)
    }
  }, method, estimates)
  estimates <- data.frame(method = method, do.call(rbind, rows), row.names = NULL)
  names(estimates)[-1L] <- c("estimate", "se", "lower", "upper")
  weights <- parts$last
  structure(
    list(
      estimates = estimates, observed = observed_value(design, level), weights = weights,
      effective = if (length(weights)) effective_number(weights), replicates = draws,
      episodes = steps$episodes, steps = length(steps$reward), discount = design$discount,
      horizon = design$horizon, level = level, model = design$regression$label,
      behavior = design$chosen$label
    ),
    class = "gym_offline"
  )
}

# A bootstrap percentile interval of few episodes is too short. For a mean it is the interval of a
# normal distribution whose variance is divided by n instead of n - 1. Wider percentiles correct
# this (Hesterberg 2015).
bootstrap_tail <- function(design, level) {
  n <- design$steps$episodes
  strata <- length(unique(design$stratum))
  own <- n / strata
  stats::pnorm(sqrt(own / (own - 1)) * stats::qt((1 - level) / 2, n - strata))
}

effective_number <- function(weights) {
  if (any(weights > 0)) sum(weights)^2 / sum(weights^2) else 0
}

# The mean, its standard error and its interval.
mean_interval <- function(x, level) {
  n <- length(x)
  se <- stats::sd(x) / sqrt(n)
  c(mean(x), se, mean(x) + c(-1, 1) * stats::qt((1 + level) / 2, n - 1) * se)
}

observed_value <- function(design, level) {
  steps <- design$steps
  horizon <- design$horizon %||% Inf
  known <- !length(steps$cut) || min(steps$cut) >= horizon
  shrunk <- design$discount^(steps$step - 1) * steps$reward * (steps$step <= horizon)
  row <- mean_interval(rowsum(shrunk, steps$episode)[, 1L], level)
  if (!known) row[] <- NA
  stats::setNames(data.frame(t(row)), c("estimate", "se", "lower", "upper"))
}

#' @export
as.data.frame.gym_offline <- function(x, row.names = NULL, optional = FALSE, ...) x$estimates

#' @export
print.gym_offline <- function(x, ...) {
  cat(
    offline_title(x),
    paste0("From ", count_of(x$episodes, "episode"), ", ", count_of(x$steps, "step"),
           if (x$discount < 1) paste0(", discount ", number_text(x$discount)),
           if (!is.null(x$horizon)) paste0(", horizon ", x$horizon), "; intervals of ",
           percent_text(x$level), if (x$interval == "t") " by t" else " by bootstrap"),
    sep = "\n"
  )
  shown <- rbind(x$estimates, data.frame(method = "observed", x$observed))
  shown[-1L] <- lapply(shown[-1L], signif, 4L)
  print(shown, row.names = FALSE)
  if (!is.null(x$weights)) {
    shares <- sort(x$weights / sum(x$weights), decreasing = TRUE)
    cat(paste0("Effective episodes: ", number_text(x$effective), "; largest weights: ",
               toString(percent_text_each(utils::head(shares, 3L)))),
        paste0("Probabilities of the actions: ", x$behavior), sep = "\n")
  }
  if (!is.null(x$model)) cat("Values: ", x$model, "\n", sep = "")
  invisible(x)
}

offline_title <- function(x) {
  if (is.null(x$folds)) {
    "Value of the policy, by data of another one"
  } else {
    paste0("Mean value of ", x$folds, " rules, each learned without the episodes it is valued on")
  }
}
