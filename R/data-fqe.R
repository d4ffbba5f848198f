# Fitted Q evaluation: the values of a policy by a regression. For doubly robust estimates, each
# episode's values come from a regression on other episodes.

#' Fit the values of the policy
#'
#' @param prepared As [weigh_steps()] returns it.
#' @param next_at A function of a step that returns the policy's probabilities in the next states.
#' @param start A fit to start from, or `NULL`.
#' @return A list of fits, one for each step of a horizon, or a single one.
#' @noRd
policy_fits <- function(design, prepared, next_at, start = NULL) {
  regression <- design$regression
  discount <- design$discount
  if (is.null(design$horizon) && !is.null(regression$fixed)) {
    usable <- prepared$ends | prepared$known
    go_on <- ifelse(prepared$ends | !usable, 0, discount)
    return(list(regression$fixed(
      prepared$rows, prepared$after, prepared$reward, go_on, next_at(NA),
      prepared$weight * usable, design$call
    )))
  }
  # Go backwards from the last step. The number of the step matters only with `stages` or a policy
  # that counts steps.
  iterate_fits(
    function(fit, step, ahead) fit_targets(prepared, regression, ahead, step, discount),
    function(fit, step) policy_mean(regression$values(fit, prepared$after), next_at(step + 1)),
    design$horizon, most_evaluations, start
  )
}

most_evaluations <- 200L

# The mean over the actions. An action without a value in the table counts 0.
policy_mean <- function(q, p) {
  q[is.na(q)] <- 0
  rowSums(q * p)
}

# Fitted Q evaluation --------------------------------------------------------------------

# Prepares the steps of each stratum, to evaluate the stratum's own policy.
prepare_fqe <- function(design) {
  lapply(sort(unique(design$stratum)), function(own) {
    rows <- which(design$stratum[design$steps$episode] == own)
    first <- rows[design$steps$step[rows] == 1L]
    c(fitting_of(design, own, rows), list(
      starts = design$steps$episode[first],
      first_block = design$regression$block(design$steps$state[first, , drop = FALSE]),
      first_p = design$act$here[first, , drop = FALSE], share = mean(design$stratum == own)
    ))
  })
}

# Fits the values of a stratum's policy to some rows, and keeps what it needs to fit them again.
fitting_of <- function(design, own, rows) {
  prepared <- prepare_steps(steps_in(design$steps, rows), design$regression, design$stages)
  if (!is.null(design$regression$states)) prepared <- equal_steps_together(prepared)
  rows <- rows[!duplicated(prepared$group %||% rows)]
  next_at <- once_per_key(function(step) design$act$after(own, step)[rows, , drop = FALSE])
  prepared <- weigh_steps(prepared, rep(1, length(prepared$episode)))
  list(prepared = prepared, next_at = next_at, fit = policy_fits(design, prepared, next_at))
}

# All replicates need the same values of `f`, so keep each value.
once_per_key <- function(f) {
  kept <- list()
  function(x) {
    key <- toString(x)
    if (is.null(kept[[key]])) kept[[key]] <<- f(x)
    kept[[key]]
  }
}

# The value of the policy if each episode counts this often.
fitted_value <- function(design, fitting, count) {
  sum(vapply(fitting, function(own) {
    fits <- if (all(count == 1)) {
      own$fit
    } else {
      # Give episodes that were not drawn almost no weight, but keep their rows, because a model
      # needs to know their factor levels.
      prepared <- weigh_steps(own$prepared, pmax(count, tiny_weight)[own$prepared$episode])
      policy_fits(design, prepared, own$next_at, own$fit[[1L]])
    }
    values <- policy_mean(design$regression$values(fits[[1L]], own$first_block), own$first_p)
    own$share * stats::weighted.mean(values, count[own$starts])
  }, 0))
}

tiny_weight <- 1e-6

# For doubly robust estimates -------------------------------------------------------------

#' Compute the values of each step by a regression on the other folds' episodes
#' @return A list of `taken`, the value of the action of each step, and `state`, that of its state.
#' @noRd
cross_fitted <- function(design) {
  steps <- design$steps
  taken <- state <- numeric(length(steps$step))
  of_step <- design$fold[steps$episode]
  for (own in sort(unique(design$fold))) {
    rows <- which(of_step == own)
    fits <- fitting_of(design, own, which(of_step != own))$fit
    block <- design$regression$block(steps$state[rows, , drop = FALSE])
    q <- values_by_step(design$regression, fits, block, steps$step[rows])
    q[is.na(q)] <- 0
    taken[rows] <- q[cbind(seq_along(rows), steps$action[rows])]
    state[rows] <- policy_mean(q, design$act$here[rows, , drop = FALSE])
  }
  list(taken = taken, state = state)
}
