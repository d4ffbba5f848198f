# The estimates of `evaluate_offline()` that weight episodes by the ratio of the probabilities of
# their actions, under the policy and in the data, and their bootstrap.

#' Estimate the value by each method
#'
#' @param design What all methods use.
#' @return A list: `parts`, see [weighted_parts()]; `fitting`, see [prepare_fqe()]; `estimates`, a
#'   named vector.
#' @noRd
estimate_methods <- function(design, method) {
  once <- matrix(1, design$steps$episodes, 1L)
  weighted <- setdiff(method, "fqe")
  parts <- if (length(weighted)) {
    q <- if (any(c("dr", "wdr") %in% weighted)) cross_fitted(design)
    weighted_parts(design, q, design$chosen$of(once[, 1L]))
  }
  estimates <- if (length(weighted)) weighted_estimates(parts, design$stratum, once, weighted)[1L, ]
  if (length(weighted) == 1L) names(estimates) <- weighted
  fitting <- if ("fqe" %in% method) prepare_fqe(design)
  if (!is.null(fitting)) {
    estimates <- c(fqe = fitted_value(design, fitting, once[, 1L]), estimates)
  }
  list(parts = parts, fitting = fitting, estimates = estimates[method])
}

replicate_methods <- function(design, method, estimated, replicates) {
  n <- design$steps$episodes
  counts <- matrix(0, n, replicates)
  for (own in split(seq_len(n), design$stratum)) {
    counts[own, ] <- stats::rmultinom(replicates, length(own), rep(1, length(own)))
  }
  weighted <- setdiff(method, "fqe")
  draws <- if (length(weighted) && !design$chosen$estimated) {
    weighted_estimates(estimated$parts, design$stratum, counts, weighted)
  } else if (length(weighted)) {
    do.call(rbind, lapply(seq_len(replicates), function(i) {
      parts <- reweighted(estimated$parts, design, design$chosen$of(counts[, i]))
      weighted_estimates(parts, design$stratum, counts[, i, drop = FALSE], weighted)
    }))
  }
  if ("fqe" %in% method) {
    fqe <- apply(counts, 2L, function(count) fitted_value(design, estimated$fitting, count))
    draws <- cbind(fqe = fqe, draws)
  }
  draws[, method, drop = FALSE]
}

#' Prepare the estimates with weights
#'
#' @param q A list of `taken`, the value of the action of each step, and `state`, the value of its
#'   state; or `NULL`.
#' @param chosen The probability of each step's action in the data.
#' @return A list of matrices with a row for each episode and a column for each step: `weight`, the
#'   product of ratios of probabilities until then (it stays after the end), `before`, that of the
#'   step before, and discounted `reward`, `residual` (of the regression) and `value`.
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
  means <- episode_scores(parts, intersect(methods, c("is", "pdis", "dr")))
  n <- nrow(counts)
  found <- if (length(means)) crossprod(counts, means) / n
  share <- tabulate(stratum) / n
  # The mean over strata of what is normalised in each.
  in_strata <- function(of) {
    Reduce(`+`, lapply(seq_along(share), function(own) share[[own]] * of(stratum == own)))
  }
  ratio <- function(own, x, weight) {
    over <- crossprod(counts[own, , drop = FALSE], x[own, , drop = FALSE])
    under <- crossprod(counts[own, , drop = FALSE], weight[own, , drop = FALSE])
    # Where no episode follows the policy any more nothing is known; only the regression counts.
    ifelse(under > 0, over / under, 0)
  }
  if ("wis" %in% methods) {
    last <- cbind(parts$last)
    wis <- in_strata(function(own) ratio(own, last * rowSums(parts$reward), last))
    found <- cbind(found, wis = drop(wis))
  }
  if ("wdr" %in% methods) {
    wdr <- in_strata(function(own) {
      rowSums(ratio(own, parts$weight * parts$residual, parts$weight)) +
        rowSums(ratio(own, parts$before * parts$value, parts$before))
    })
    found <- cbind(found, wdr = wdr)
  }
  found[, methods, drop = FALSE]
}

# A matrix with a row for each episode and a column for each method that is a mean over episodes.
episode_scores <- function(parts, methods) {
  scores <- lapply(rlang::set_names(methods), function(method) {
    switch(
      method, is = parts$last * rowSums(parts$reward), pdis = rowSums(parts$weight * parts$reward),
      dr = rowSums(parts$weight * parts$residual + parts$before * parts$value)
    )
  })
  do.call(cbind, scores)
}
