#' Learn a rule from data
#'
#' Learn the value of each action from logged steps, by fitted Q-iteration (Ernst, Geurts and
#' Wehenkel 2005). It fits a regression on the state and the action. The response is the reward plus
#' the discounted value of the best action in the next state. The next regression uses the new
#' values, until the values do not change any more. With a horizon it goes backwards from the last
#' step, which is Q-learning for dynamic treatment regimes (Murphy 2005). [learn_q()] does the same
#' with a table.
#'
#' # Models
#'
#' Without `formula` and `model`, values are means in a table if all columns of the state are text,
#' factors, logical values or integers, and there are on average at least five steps for each pair
#' of a state and an action. Otherwise values come from a linear model, [lm()], in which each action
#' has its own coefficients. `formula` replaces its terms, as in `~ action * (age + severity)`.
#'
#' `model` sets another kind of model: a function of a formula and data that returns an object with
#' a method of [predict()], such as `rpart::rpart`, `mgcv::gam` or `function(formula, data)
#' nnet::nnet(formula, data, size = 5, linout = TRUE)`. In the data the action is a factor.
#'
#' # Stages
#'
#' With a horizon there are values for each step. By default all steps are used to compute them,
#' which is right if the next state and the reward depend only on the state and the action. With
#' `stages = TRUE` each step has its own model, fitted to this step of all episodes. Use it if, say,
#' the first treatment works differently from the second. Another way is to make the number of the
#' stage a part of the state.
#'
#' @param data Steps: the result of [steps_data()], a data frame with its columns, or a [rollout()]
#'   with `steps = TRUE`.
#' @param formula A formula with `action` and columns of the state on its right side. If an action
#'   has several parts, it may also have their columns, such as `action_dose`. `NULL`, the default,
#'   is described below.
#' @param model A function of a formula and data that fits a model. `NULL`, the default, is
#'   described below.
#' @param discount The discount, a number above 0 and at most 1, the default.
#' @param iterations The largest number of regressions, a whole number. The default is 100. Learning
#'   stops earlier if no value changes by more than 1e-12 of its size.
#' @param horizon The number of steps after which everything ends, a whole number. `NULL`, the
#'   default, goes on to the end of the episode.
#' @param stages Does each step have its own model? `FALSE`, the default, or `TRUE`, which requires
#'   a `horizon`.
#' @param double Use double Q-learning? `FALSE`, the default, or `TRUE`: each half of the episodes
#'   chooses the best actions, and the other half values them. This avoids values that are too large
#'   by chance (van Hasselt 2010).
#' @return A policy of class `gym_policy_fitted`. [predict()][predict.gym_policy()] takes a data
#'   frame of states and returns their actions (a data frame, if an action has several parts). With
#'   `type = "output"` it returns the values of all actions. [rollout()] plays it. With a horizon,
#'   `predict()` also needs the column `step`. [rollout()] counts the steps of each episode itself;
#'   after the horizon it acts as in the last step. In a state that the data does not have, the
#'   policy takes the most frequent action. [state_values()] returns the values of the states in the
#'   data.
#' @section Errors: `gym_error_argument` for invalid steps, a formula with unknown columns, or a
#'   model that cannot be fitted.
#' @references D. Ernst, P. Geurts, L. Wehenkel (2005), Tree-based batch mode reinforcement
#'   learning, JMLR 6. S. Murphy (2005), A generalization error for Q-learning, JMLR 6. H. van
#'   Hasselt (2010), Double Q-learning, NeurIPS 23.
#' @seealso [evaluate_offline()]: how good is it?
#' @export
#' @examples
#' set.seed(1)
#' visits <- data.frame(patient = rep(1:200, each = 2), severity = runif(400),
#'                      drug = sample(c("old", "new"), 400, replace = TRUE))
#' visits$wellbeing <- with(visits, ifelse(drug == "new", severity, 1 - severity)) + rnorm(400)
#' steps <- steps_data(visits, "patient", "severity", "drug", "wellbeing")
#' rule <- learn_fitted_q(steps, horizon = 2)
#' rule
#' predict(rule, data.frame(severity = c(0.1, 0.9), step = 1))
learn_fitted_q <- function(data, formula = NULL, model = NULL, discount = 1, iterations = 100,
                           horizon = NULL, stages = FALSE, double = FALSE) {
  call <- rlang::current_env()
  steps <- steps_of(data, call)
  check_discount(discount)
  check_count(iterations)
  check_horizon(horizon, stages, steps, call)
  check_flag(double)
  recipe <- list(
    formula = formula, model = model, discount = discount, iterations = iterations,
    horizon = horizon, stages = stages, double = double, table = FALSE
  )
  fit_rule(steps, recipe, call)
}

# Batch Q-learning on a table, for learn_q(): sweeps over all pairs of a state and an action in the
# data.
learn_table <- function(data, discount, double, iterations, call) {
  steps <- steps_of(data, call)
  recipe <- list(
    discount = discount, iterations = iterations %||% 10000, stages = FALSE, double = double,
    table = TRUE
  )
  fit_rule(steps, recipe, call)
}

check_horizon <- function(horizon, stages, steps, call) {
  check_count(horizon, allow_null = TRUE, call = call)
  check_flag(stages, call = call)
  if (stages && is.null(horizon)) {
    abort_argument(horizon, "the number of stages", "horizon", call)
  }
  abort_if(
    isTRUE(horizon > steps$longest), "horizon", horizon, call,
    '`horizon` is {whole_number_text(horizon)}, but the longest episode of the data has
     {count_of(steps$longest, "step")}: at most these can be used.'
  )
}

fit_rule <- function(steps, recipe, call) {
  regression <- if (recipe$table) {
    table_regression(steps)
  } else {
    regression_of(steps, recipe$formula, recipe$model, call)
  }
  prepared <- prepare_steps(steps, regression, recipe$stages)
  prepared <- weigh_steps(prepared, rep(1, length(steps$step)))
  # A sweep over a table computes the value of each state once. Other updates compute the value of
  # each step's next state.
  sweep <- if (recipe$table && !recipe$double) table_sweep(prepared, regression, recipe$discount)
  after <- prepared$after
  if (!is.null(regression$states)) after <- unique(after)
  place <- if (is.null(regression$states)) TRUE else match(prepared$after, after)
  if (!is.null(sweep)) after <- seq_len(nrow(regression$states))
  fits <- iterate_fits(
    function(fit, step, ahead) {
      if (recipe$double) {
        double_update(prepared, regression, fit, step, recipe$discount)
      } else if (is.null(sweep) || is.null(ahead)) {
        fit_targets(prepared, regression, ahead[place], step, recipe$discount)
      } else {
        sweep(fit, ahead)
      }
    },
    function(fit, step) best_values(known_values(fit_values(regression, fit, after))),
    recipe$horizon, recipe$iterations
  )
  new_rule(regression, fits, steps, recipe)
}

# `recipe` has the arguments that learn the rule again for folds, if that is possible.
new_rule <- function(regression, fits, steps, recipe) {
  structure(
    list(
      regression = regression, fits = fits, recipe = recipe, steps = steps,
      observation_space = NULL, action_space = NULL, initial = cbind(step = 1)
    ),
    class = c("gym_policy_fitted", if (length(fits) > 1L) "gym_policy_memory", "gym_policy")
  )
}

# Fitting -------------------------------------------------------------------------------

prepare_steps <- function(steps, regression, stages) {
  steps$rows <- regression$rows(steps$state, steps$action)
  steps$after <- regression$block(steps$after)
  steps$stages <- stages
  steps
}

# In a table, steps with the same start and end become one. `group` says which one each step belongs
# to.
equal_steps_together <- function(prepared) {
  each <- c("rows", "after", "ends", "known", if (prepared$stages) "step")
  key <- do.call(paste, prepared[each])
  prepared$group <- match(key, unique(key))
  prepared$each_reward <- prepared$reward
  first <- !duplicated(prepared$group)
  prepared[each] <- lapply(prepared[each], function(x) x[first])
  prepared
}

# Equal steps get the sum of their weights and the mean of their rewards.
weigh_steps <- function(prepared, weight) {
  prepared$weight <- weight
  if (!is.null(prepared$group)) {
    sums <- rowsum(cbind(weight, weight * prepared$each_reward), prepared$group, reorder = FALSE)
    prepared$weight <- sums[, 1L]
    prepared$reward <- sums[, 2L] / sums[, 1L]
  }
  prepared
}

#' Fit values until they do not change any more, or backwards from a horizon
#' @param update A function of the fit of the next step (`NULL` at first), the number of a step
#'   (`NA` without a horizon) and the values ahead of each step (`NULL` at first). It returns
#'   another fit.
#' @param values_of A function of a fit and a step that returns the values ahead.
#' @param start A fit to start from, or `NULL`. It saves iterations.
#' @return A list of fits: one for each step of a horizon, or a single one.
#' @noRd
iterate_fits <- function(update, values_of, horizon, iterations, start = NULL) {
  fit <- NULL
  if (!is.null(horizon)) {
    fits <- vector("list", horizon)
    for (step in rev(seq_len(horizon))) {
      fits[[step]] <- fit <- update(fit, step, if (!is.null(fit)) values_of(fit, step))
    }
    return(fits)
  }
  fit <- start
  ahead <- if (!is.null(fit)) values_of(fit, NA)
  for (iteration in seq_len(iterations)) {
    before <- ahead %||% Inf
    fit <- update(fit, NA, ahead)
    ahead <- values_of(fit, NA)
    if (all(abs(ahead - before) <= 1e-12 * pmax(1, abs(ahead)))) break
  }
  list(fit)
}

#' Fit the reward plus the value of the next state
#' @param ahead The value of each step's next state; `NULL` if nothing comes after this step.
#' @param used Which steps to use.
#' @noRd
fit_targets <- function(prepared, regression, ahead, step, discount, used = TRUE) {
  target <- prepared$reward
  weight <- prepared$weight * used
  if (!is.null(ahead)) {
    ahead[prepared$ends | !prepared$known] <- 0
    target <- target + discount * ahead
    # Steps whose next state was not recorded count nothing.
    weight[!prepared$ends & !prepared$known] <- 0
  }
  if (prepared$stages) weight[prepared$step != step] <- 0
  regression$fit(prepared$rows, target, weight)
}

# Does what fit_targets() does, for all pairs of a state and an action at once: it computes their
# mean rewards and next states in advance.
table_sweep <- function(prepared, regression, discount) {
  used <- which(prepared$ends | prepared$known)
  own <- unique(prepared$rows[used])
  from <- match(prepared$rows[used], own)
  share <- 1 / tabulate(from)[from]
  reward <- rowsum(share * prepared$reward[used], from, reorder = FALSE)[, 1L]
  goes_on <- !prepared$ends[used]
  moves <- Matrix::sparseMatrix(
    i = from[goes_on], j = prepared$after[used][goes_on], x = discount * share[goes_on],
    dims = c(length(own), nrow(regression$states))
  )
  function(fit, ahead) {
    fit[] <- NA
    fit[own] <- reward + times(moves, ahead)
    fit
  }
}

# In double Q-learning a fit consists of two, one for each half of the episodes.
double_update <- function(prepared, regression, fit, step, discount) {
  half <- prepared$episode %% 2L
  fits <- lapply(0:1, function(own) {
    ahead <- if (!is.null(fit)) {
      chooses <- known_values(regression$values(fit[[own + 1L]], prepared$after))
      valued <- regression$values(fit[[2L - own]], prepared$after)
      valued <- valued[cbind(seq_len(nrow(valued)), max.col(chooses, "first"))]
      ifelse(is.na(valued), 0, valued)
    }
    fit_targets(prepared, regression, ahead, step, discount, half == own)
  })
  structure(fits, class = "gym_double_fit")
}

known_values <- function(q) {
  q[is.na(q)] <- -Inf
  q
}

fit_values <- function(regression, fit, block) {
  if (inherits(fit, "gym_double_fit")) {
    return((regression$values(fit[[1L]], block) + regression$values(fit[[2L]], block)) / 2)
  }
  regression$values(fit, block)
}

# The values of actions in each row, by the fit of the row's step. `NA` if that step has no fit.
values_by_step <- function(regression, fits, block, step) {
  values <- fit_values(regression, fits[[1L]], block)
  for (own in if (length(fits) > 1L) setdiff(step, 1)) {
    here <- step == own
    values[here, ] <- if (own > length(fits)) {
      NA
    } else {
      fit_values(regression, fits[[own]], block)[here, ]
    }
  }
  values
}
