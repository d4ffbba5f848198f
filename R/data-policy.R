# The probability of each action in logged steps: under the policy to evaluate, and in the data.

#' Check the policy to evaluate
#' @return The policy. Without folds, a rule that was learned from the same data is an error.
#' @noRd
offline_policy <- function(policy, steps, folds, call) {
  policy <- trained_policy(policy)
  if (inherits(policy, "gym_policy_fitted")) {
    shared <- mean(episode_keys(steps) %in% episode_keys(policy$steps))
    # A few short episodes of different data may be equal by chance.
    abort_if(
      is.null(folds) && shared > 0.2, "policy", policy, call,
      "The policy was learned from the same data ({percent_text(shared)} of the episodes), so its
       value there is too large.",
      i = "`folds = 5` learns it again without each fold; or evaluate it on episodes that it has
           not seen."
    )
  }
  if (!is.null(folds) && !inherits(policy, "gym_policy_fitted")) {
    abort_argument(policy, "a rule of `learn_fitted_q()` or `learn_q()` if there are `folds`",
                   "policy", call)
  }
  policy
}

# Returns the policy of each fold: learned again without the fold's episodes, or without folds the
# same one for all.
rules_of_folds <- function(policy, steps, fold, folds) {
  if (is.null(folds)) {
    return(list(policy))
  }
  lapply(seq_len(folds), function(own) {
    fit_rule(steps_in(steps, fold[steps$episode] != own), policy$recipe, NULL)
  })
}

#' Compute the probabilities with which policies act
#'
#' @return A list: `here`, a matrix with a row for each step and a column for each action, by the
#'   rule of the step's fold; and `after`, a function of the number of a rule and a step (`NA`
#'   without a horizon) that returns such a matrix for all next states, by this rule.
#' @noRd
action_probabilities <- function(rules, steps, fold, call) {
  many <- length(rules)
  # Only a rule with a horizon depends on the step, and only up to the horizon.
  horizon <- if (inherits(rules[[1L]], "gym_policy_fitted")) length(rules[[1L]]$fits) else 0L
  counts <- horizon > 1L
  ask <- function(own, states, step) {
    if (counts) step <- pmin(step, horizon)
    probabilities_of(rules[[own]], states, step, steps$actions, call)
  }
  here <- matrix(0, length(steps$step), nrow(steps$actions))
  of_step <- if (many > 1L) fold[steps$episode] else rep(1L, length(steps$step))
  for (own in unique(of_step)) {
    some <- of_step == own
    here[some, ] <- ask(own, steps$state[some, , drop = FALSE], steps$step[some])
  }
  next_states <- steps$after[steps$known, , drop = FALSE]
  after <- once_per_key(function(key) {
    found <- matrix(0, length(steps$step), nrow(steps$actions))
    if (any(steps$known)) {
      found[steps$known, ] <- ask(key[[1L]], next_states, rep(key[[2L]], nrow(next_states)))
    }
    found
  })
  list(here = here, after = function(own, step) {
    after(c(min(own, many), if (counts) step else 1))
  })
}

# A row for each state, a column for each action of the data.
probabilities_of <- function(policy, states, step, actions, call) {
  n <- nrow(states)
  labels <- row_texts(actions)
  said <- if (inherits(policy, "gym_policy_fitted")) {
    predict_policy(policy, data.frame(states, step = step, check.names = FALSE), "probability",
                   call)
  } else if (inherits(policy, "gym_policy_random")) {
    matrix(1 / length(labels), n, length(labels))
  } else if (inherits(policy, "gym_policy")) {
    known_policy_says(policy, states, call)
  } else if (is.function(policy)) {
    policy(states)
  } else {
    policy
  }
  if (is.data.frame(said)) {
    # An action of several parts, or probabilities.
    parts <- names(actions)
    said <- if (all(parts %in% names(said))) row_texts(said[parts]) else as.matrix(said)
  }
  if (is.matrix(said)) {
    checked_probabilities(said, n, labels, call)
  } else {
    one_of_actions(said, n, labels, call)
  }
}

# Asks a policy for its probabilities if it has them, as tables and networks do, and otherwise for
# its actions.
known_policy_says <- function(policy, states, call) {
  observed <- if (length(states) == 1L) states[[1L]] else states
  if (inherits(policy$observation_space, "gym_space_discrete")) {
    observed <- encoded_values(policy$observation_space, observed, "state", call)
  }
  own <- policy$action_space
  counted <- countable_actions(own)
  said <- tryCatch(
    predict_policy(policy, observed, "probability", call), gym_error_argument = function(cnd) {
      action <- predict_policy(policy, observed, "action", call)
      of_parts <- !is.null(counted) && !inherits(own, "gym_space_discrete")
      if (of_parts) space_index(own)$index(action, nrow(states)) - 1L else action
    }
  )
  space <- counted %||% space_discrete(max(NCOL(said), 1L))
  if (is.matrix(said)) colnames(said) <- value_labels(space) else said <- named_numbers(space, said)
  said
}

checked_probabilities <- function(said, n, labels, call) {
  # `cbind(1 - p, p)` has a name for only one of its two columns.
  named <- function() length(colnames(said)) && all(nzchar(colnames(said)))
  if (!named() && ncol(said) == length(labels)) colnames(said) <- labels
  good <- is.numeric(said) && nrow(said) == n && named() &&
    all(are_probabilities(said)) && all(abs(rowSums(said) - 1) < sum_tolerance)
  abort_if(
    !good, "policy", said, call,
    '`policy` must return an action for each state, or a matrix of probabilities with
     {count_of(length(labels), "column")} that add up to 1 in each row, not
     {describe_argument(said)}.'
  )
  check_seen_actions(colSums(said) / max(n, 1L), labels, call)
  place <- match(labels, colnames(said))
  found <- unname(said[, place, drop = FALSE])
  found[is.na(found)] <- 0
  found
}

one_of_actions <- function(said, n, labels, call) {
  said <- if (is.list(said)) NA else as.character(said)
  if (!length(said) %in% c(1L, n) || anyNA(said)) {
    abort_argument(said, paste("an action, or one for each of", count_of(n, "state")), "policy",
                   call)
  }
  said <- rep_len(said, n)
  check_seen_actions(table(said) / n, labels, call)
  one_hot(match(said, labels), length(labels))
}

# The data says nothing about actions that it does not have, so the policy may not take them.
check_seen_actions <- function(shares, labels, call) {
  never <- setdiff(names(shares)[shares > 0], labels)
  abort_if(
    length(never), "policy", never, call,
    'The policy takes the action "{never[[1L]]}" in {percent_text(sum(shares[never]))} of the
     steps, which the data never took.',
    i = did_you_mean(never[[1L]], labels, "\"%s\""), i = "The data has {few_names(labels)}."
  )
}

# Behavior ------------------------------------------------------------------------------

#' Find out with which probability the actions of the data were chosen
#'
#' @return A list: `of`, a function of the weight of each episode that returns the probability of
#'   each step's action; `estimated`, whether these probabilities depend on the weights; `label`,
#'   how they are known, in words.
#' @noRd
behavior_of <- function(behavior, steps, call) {
  at <- cbind(seq_along(steps$action), steps$action)
  if (is.null(behavior) && !is.null(steps$probability)) {
    return(known_behavior(steps$probability, "as in the data"))
  }
  if (!is.null(behavior) && !inherits(behavior, "formula")) {
    p <- probabilities_of(behavior, steps$state, steps$step, steps$actions, call)[at]
    abort_if(
      any(p == 0), "behavior", behavior, call,
      "By `behavior` the action in step {steps$step[p == 0][[1L]]} of episode
       {steps$labels[[steps$episode[p == 0][[1L]]]]} has the probability 0, but it was taken:
       correct `behavior`."
    )
    return(known_behavior(p, "given by `behavior`"))
  }
  if (is.null(behavior) && is_table_like(steps)) {
    state <- match(row_keys(steps$state), unique(row_keys(steps$state)))
    pair <- paste(state, steps$action)
    pair <- match(pair, unique(pair))
    shares <- function(weight) {
      weight <- weight[steps$episode]
      p <- rowsum(weight, pair)[pair] / rowsum(weight, state)[state]
      # Episodes that were not drawn count nothing, so their probability may be any.
      ifelse(weight > 0, p, 1)
    }
    return(list(of = shares, estimated = TRUE, label = "shares of actions in each state"))
  }
  columns <- paste(sprintf("`%s`", names(steps$state)), collapse = " + ")
  behavior <- behavior %||% stats::as.formula(paste("~", columns), globalenv())
  list(
    of = function(weight) {
      pmax(logistic_probabilities(behavior, steps, weight[steps$episode], call)[at], 1e-12)
    },
    estimated = TRUE, label = paste("logistic regression,", deparse1(behavior))
  )
}

known_behavior <- function(p, label) {
  list(of = function(weight) p, estimated = FALSE, label = label)
}

logistic_probabilities <- function(formula, steps, weight, call) {
  many <- nrow(steps$actions)
  data <- data.frame(steps$state, taken = steps$action - 1L, weight = weight, check.names = FALSE)
  formula <- stats::reformulate(deparse1(formula[[length(formula)]]), "taken",
                                env = environment(formula))
  if (many == 1L) {
    return(matrix(1, nrow(data), 1L))
  }
  tryCatch({
    if (many == 2L) {
      # Weights are counts of episodes.
      x <- stats::model.matrix(formula, data)
      fit <- stats::glm.fit(x, data$taken, weights = weight, family = stats::binomial())
      p <- stats::fitted(fit)
      return(cbind(1 - p, p))
    }
    check_suggested("nnet", "estimate the probabilities of more than two actions", call)
    data$taken <- factor(data$taken, seq_len(many) - 1L)
    environment(formula) <- rlang::current_env()
    stats::fitted(nnet::multinom(formula, data, weights = weight, trace = FALSE))
  }, gym_error = function(cnd) rlang::cnd_signal(cnd), error = function(cnd) {
    gym_abort(
      c("The regression of the actions on the state cannot be fitted.",
        i = "`behavior = ~ ...` names the columns that the actions depended on."),
      class = "gym_error_argument", argument = "behavior", call = call, parent = cnd
    )
  })
}
