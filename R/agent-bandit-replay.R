# Bandits with contexts, which learn from logged steps.

#' Replay logged steps to a learner
#'
#' @return As [learn_bandit()].
#' @noRd
replay_bandit <- function(data, method, confidence, seed, call) {
  if (!is.data.frame(data) && !inherits(data, "gym_rollout")) {
    abort_argument(data, "logged steps if the method is \"linucb\" or \"thompson\"", "env", call)
  }
  steps <- steps_of(data, call)
  context <- context_regression(steps, call)
  x <- context$block(steps$state)
  # As if all actions had been equally likely.
  chosen <- steps$probability %||% 1
  played <- with_generator(
    new_generator(seed),
    replay_steps(x, steps, min(chosen) / chosen, method == "thompson", confidence)
  )
  seen <- length(played$reward)
  abort_if(
    !seen, "env", data, call, "The learner never chose the action of the data.",
    i = "There are too few rows for so many actions, or too unequal probabilities."
  )
  label <- paste0(if (method == "linucb") "LinUCB" else "linear Thompson sampling",
                  ", confidence ", number_text(confidence))
  # The policy cannot be learned again in folds: that would be another replay.
  context$label <- label
  structure(
    list(
      curve = data.frame(
        step = seq_len(seen), mean_reward = cumsum(played$reward) / seq_len(seen), best_share = NA
      ),
      values = played$weights, label = label, learners = 1L, seed = seed, env_id = "logged data",
      reward = mean(played$reward), se = stats::sd(played$reward) / sqrt(seen), seen = seen,
      rows = length(steps$step), policy = new_rule(context, list(played$weights), steps, NULL)
    ),
    class = "gym_bandit_learning"
  )
}

# Contexts as numbers: the columns of a linear model without interactions.
context_regression <- function(steps, call) {
  columns <- paste(sprintf("`%s`", names(steps$state)), collapse = " + ")
  terms <- stats::terms(stats::as.formula(paste("~", columns), globalenv()))
  levels <- lapply(Filter(is.factor, steps$state), levels)
  list(
    label = paste("linear,", deparse1(terms[[2L]])),
    block = function(states) {
      stats::model.matrix(terms, stats::model.frame(terms, states, xlev = levels))
    },
    values = function(fit, block) block %*% fit
  )
}

#' Show the rows one after the other, and let the learner learn from those it agrees with
#'
#' Each action has the inverse of its matrix of squares, which a row changes by one product
#' (Sherman and Morrison).
#' @param used The probability with which a row is used.
#' @return A list: `reward`, of the steps it saw, and `weights`, a matrix with a column for each
#'   action.
#' @noRd
replay_steps <- function(x, steps, used, draws, confidence) {
  width <- ncol(x)
  many <- nrow(steps$actions)
  inverse <- rep(list(diag(width)), many)
  sums <- weights <- matrix(0, width, many)
  used <- stats::runif(nrow(x)) < used
  tie <- stats::runif(nrow(x))
  seen <- logical(nrow(x))
  scores <- numeric(many)
  for (row in seq_len(nrow(x))) {
    now <- x[row, ]
    for (action in seq_len(many)) {
      scores[[action]] <- if (draws) {
        root <- chol(inverse[[action]])
        sum(now * (weights[, action] + confidence * drop(stats::rnorm(width) %*% root)))
      } else {
        spread <- sum(now * (inverse[[action]] %*% now))
        sum(now * weights[, action]) + confidence * sqrt(spread)
      }
    }
    best <- which(scores == max(scores))
    chosen <- best[[ceiling(tie[[row]] * length(best))]]
    if (used[[row]] && chosen == steps$action[[row]]) {
      seen[[row]] <- TRUE
      along <- drop(inverse[[chosen]] %*% now)
      inverse[[chosen]] <- inverse[[chosen]] - tcrossprod(along) / (1 + sum(now * along))
      sums[, chosen] <- sums[, chosen] + steps$reward[[row]] * now
      weights[, chosen] <- inverse[[chosen]] %*% sums[, chosen]
    }
  }
  dimnames(weights) <- list(colnames(x), row_texts(steps$actions))
  list(reward = steps$reward[seen], weights = weights)
}
