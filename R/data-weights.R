# The estimates of `evaluate_offline()` that weight episodes, and their bootstrap. A weight is the
# probability of an episode's actions under the policy, divided by that in the data.

#' Prepare the estimates by each method
#'
#' @param design What all methods use.
#' @return A list: `parts`, see [weighted_parts()]; `fitting`, see [prepare_fqe()].
#' @noRd
prepare_methods <- function(design, method) {
  list(
    parts = if (any(method != "fqe")) {
      q <- if (any(c("dr", "wdr") %in% method)) cross_fitted(design)
      weighted_parts(design, q, design$chosen$of(rep(1, design$steps$episodes)))
    },
    fitting = if ("fqe" %in% method) prepare_fqe(design)
  )
}

#' Estimate the value by each method
#'
#' @param counts A matrix with a column for each replicate: how often each episode counts.
#' @return A matrix with a row for each replicate and a column for each method.
#' @noRd
estimate_methods <- function(design, method, prepared, counts) {
  weighted <- setdiff(method, "fqe")
  found <- if (length(weighted) && !design$chosen$estimated) {
    weighted_estimates(prepared$parts, design$stratum, counts, weighted)
  } else if (length(weighted)) {
    # Each replicate estimates the probabilities again.
    do.call(rbind, lapply(seq_len(ncol(counts)), function(i) {
      parts <- reweighted(prepared$parts, design, design$chosen$of(counts[, i]))
      weighted_estimates(parts, design$stratum, counts[, i, drop = FALSE], weighted)
    }))
  }
  if ("fqe" %in% method) {
    fqe <- apply(counts, 2L, function(count) fitted_value(design, prepared$fitting, count))
    found <- cbind(fqe = fqe, found)
  }
  found[, method, drop = FALSE]
}

# How often each episode is drawn in each replicate. Each stratum draws as many as it has.
drawn_counts <- function(design, replicates) {
  counts <- matrix(0, design$steps$episodes, replicates)
  for (own in split(seq_along(design$stratum), design$stratum)) {
    counts[own, ] <- stats::rmultinom(replicates, length(own), rep(1, length(own)))
  }
  counts
}

#' Prepare the estimates with weights
#'
#' @param q A list of `taken`, the value of the action of each step, and `state`, the value of its
#'   state; or `NULL`.
#' @param chosen The probability of each step's action in the data.
#' @return A list of matrices with a row for each episode and a column for each step: `weight`, the
#'   product of ratios of probabilities up to this step (it stays the same after the end); `before`,
#'   the weight of the step before; and discounted `reward`, `residual` (of the regression) and
#'   `value`.
#' @noRd
weighted_parts <- function(design, q, chosen) {
  steps <- design$steps
  longest <- min(design$horizon %||% steps$longest, steps$longest)
  check_fits_memory(
    as.double(steps$episodes) * longest, "A weight of each step", design$call, "data",
    "Give a shorter `horizon`."
  )
  within <- steps$step <= longest
  at <- cbind(steps$episode, steps$step)[within, , drop = FALSE]
  shrink <- design$discount^(steps$step - 1)
  spread <- function(x, empty = 0) {
    matrix <- matrix(empty, steps$episodes, longest)
    matrix[at] <- x[within]
    matrix
  }
  parts <- list(
    at = at, within = within, reward = spread(shrink * steps$reward),
    residual = if (!is.null(q)) spread(shrink * (steps$reward - q$taken)),
    value = if (!is.null(q)) spread(shrink * q$state)
  )
  reweighted(parts, design, chosen)
}

reweighted <- function(parts, design, chosen) {
  own <- design$act$here[cbind(seq_along(chosen), design$steps$action)]
  weight <- matrix(1, nrow(parts$reward), ncol(parts$reward))
  weight[parts$at] <- (own / chosen)[parts$within]
  for (step in seq_len(ncol(weight))[-1L]) weight[, step] <- weight[, step] * weight[, step - 1L]
  parts$weight <- weight
  parts$before <- cbind(1, weight[, -ncol(weight), drop = FALSE])
  parts$last <- weight[, ncol(weight)]
  parts
}

#' Compute the estimates with weights
#' @param counts A matrix with a column for each replicate: how often each episode was drawn.
#' @return A matrix with a row for each replicate and a column for each method.
#' @noRd
weighted_estimates <- function(parts, stratum, counts, methods) {
  n <- nrow(counts)
  each <- lapply(rlang::set_names(methods), function(method) {
    if (!method %in% c("wis", "wdr")) {
      return(crossprod(counts, episode_scores(parts, method)) / n)
    }
    # Normalise within each stratum, then take the mean over strata.
    Reduce(`+`, lapply(seq_len(max(stratum)), function(one) {
      own <- stratum == one
      count <- counts[own, , drop = FALSE]
      mean(own) * Reduce(`+`, lapply(terms_of(parts, method), function(term) {
        weight <- term$weight[own, , drop = FALSE]
        over <- crossprod(count, weight * term$x[own, , drop = FALSE])
        under <- crossprod(count, weight)
        # Where no episode follows the policy any more, only the regression counts.
        rowSums(ifelse(under > 0, over / under, 0))
      }))
    }))
  })
  matrix(unlist(each), ncol = length(methods), dimnames = list(NULL, methods))
}

# The score of each episode. The estimate of a method that does not normalise is the mean score.
episode_scores <- function(parts, method) {
  rowSums(Reduce(`+`, lapply(terms_of(parts, method), function(term) term$weight * term$x)))
}

# The terms that a method weights: matrices with a row for each episode. Their columns are added up.
terms_of <- function(parts, method) {
  term <- function(weight, x) list(weight = cbind(weight), x = cbind(x))
  switch(
    method, is = , wis = list(term(parts$last, rowSums(parts$reward))),
    pdis = list(term(parts$weight, parts$reward)),
    dr = , wdr = list(term(parts$weight, parts$residual), term(parts$before, parts$value))
  )
}
