# Bandits with contexts: linear models that learn in an environment, or from logged steps.

# Makes the result of learn_bandit(). `played` is a list: `reward`, of the steps that the learner
# saw, and `weights`, a matrix with a column for each action.
learned_with_contexts <- function(played, context, steps, method, confidence, seed, env_id) {
  seen <- length(played$reward)
  colnames(played$weights) <- row_texts(steps$actions)
  # The policy cannot be learned again in folds, because other data would lead to other actions.
  context$label <- paste0(if (method == "linucb") "LinUCB" else "linear Thompson sampling",
                          ", confidence ", number_text(confidence))
  structure(
    list(
      curve = data.frame(
        step = seq_len(seen), mean_reward = cumsum(played$reward) / seq_len(seen), best_share = NA
      ),
      values = played$weights, label = context$label, learners = 1L, seed = seed, env_id = env_id,
      reward = mean(played$reward), se = stats::sd(played$reward) / sqrt(seen), seen = seen,
      rows = length(steps$action), policy = new_rule(context, list(played$weights), steps, NULL)
    ),
    class = "gym_bandit_learning"
  )
}

#' Replay logged steps to a learner
#'
#' @return As [learn_bandit()].
#' @noRd
replay_bandit <- function(data, method, confidence, seed, call) {
  steps <- steps_of(data, call)
  context <- context_regression(steps$state)
  x <- context$block(steps$state)
  # Each row is used with a probability that makes all actions equally likely.
  chosen <- steps$probability %||% 1
  played <- with_generator(
    new_generator(seed),
    replay_steps(x, steps, min(chosen) / chosen, method == "thompson", confidence)
  )
  abort_if(
    !length(played$reward), "env", data, call,
    "The learner never chose the action of the data.",
    i = "There are too few rows for so many actions, or their probabilities differ too much."
  )
  learned_with_contexts(played, context, steps, method, confidence, seed, "logged data")
}

#' Learn in an environment, whose observations are the contexts
#'
#' @return As [learn_bandit()].
#' @noRd
live_bandit <- function(env, method, confidence, horizon, seed, call) {
  if (rlang::is_string(env)) {
    env <- gym_make(env)
    on.exit(env$close())
  }
  abort_if(
    !is.null(env$num_envs), "env", env, call,
    "A learner with contexts plays in one environment, and this one has sub-environments.",
    i = "Make it without `num_envs`."
  )
  world <- single_env(env)
  actions <- table_index(world$action_space, "actions", call)
  observed <- world$observation_space
  # Numbers that only name a value, as in a Discrete space, become factors, if there are not too
  # many.
  index <- space_index(observed)
  levels <- if (!is.null(index) && index$count <= 1000) {
    lapply(observation_columns(observed, index$value(seq_len(index$count))), unique)
  }
  contexts <- function(observation) {
    columns <- data.frame(observation_columns(observed, observation), check.names = FALSE)
    for (i in which(lengths(levels) > 1L)) columns[[i]] <- factor(columns[[i]], levels[[i]])
    columns
  }
  first <- world$reset(seed)
  context <- context_regression(contexts(first))
  played <- with_generator(
    new_generator(seed),
    play_contexts(world, first, actions, function(observation) context$block(contexts(observation)),
                  horizon, method == "thompson", confidence)
  )
  steps <- list(
    episode = played$episode, labels = unique(played$episode), step = seq_along(played$action),
    state = contexts(bind_batches(observed, played$observation)), action = played$action,
    actions = decoded_actions(world$action_space, actions$value(seq_len(actions$count))),
    reward = played$reward
  )
  learned_with_contexts(played, context, steps, method, confidence, seed, env$spec$id)
}

# Turns contexts into numbers: the columns of a linear model without interactions.
context_regression <- function(states) {
  columns <- paste(sprintf("`%s`", names(states)), collapse = " + ")
  terms <- stats::terms(stats::as.formula(paste("~", columns), globalenv()))
  levels <- lapply(Filter(is.factor, states), levels)
  list(
    block = function(states) {
      stats::model.matrix(terms, stats::model.frame(terms, states, xlev = levels))
    },
    values = function(fit, block) block %*% fit
  )
}

# Makes linear models of the rewards of `many` actions. Each keeps the inverse of its matrix X'X,
# which a step updates by one outer product (Sherman and Morrison). `choose(now, tie)` returns the
# action for the numbers of a context. If several actions are best, `tie`, from 0 to 1, selects one.
context_learner <- function(width, many, draws, confidence) {
  inverse <- rep(list(diag(width)), many)
  sums <- weights <- matrix(0, width, many)
  score <- function(action, now) {
    if (draws) {
      root <- chol(inverse[[action]])
      return(sum(now * (weights[, action] + confidence * drop(stats::rnorm(width) %*% root))))
    }
    spread <- sum(now * (inverse[[action]] %*% now))
    sum(now * weights[, action]) + confidence * sqrt(spread)
  }
  list(
    choose = function(now, tie) {
      scores <- vapply(seq_len(many), score, 0, now)
      best <- which(scores == max(scores))
      best[[ceiling(tie * length(best))]]
    },
    learn = function(now, action, reward) {
      along <- drop(inverse[[action]] %*% now)
      inverse[[action]] <<- inverse[[action]] - tcrossprod(along) / (1 + sum(now * along))
      sums[, action] <<- sums[, action] + reward * now
      weights[, action] <<- inverse[[action]] %*% sums[, action]
    },
    weights = function(rows) structure(weights, dimnames = list(rows, NULL))
  )
}

# Shows the learner the rows one after the other. It learns from those in which it chooses the
# action of the data. `used` is the probability with which a row is used.
replay_steps <- function(x, steps, used, draws, confidence) {
  learner <- context_learner(ncol(x), nrow(steps$actions), draws, confidence)
  used <- stats::runif(nrow(x)) < used
  tie <- stats::runif(nrow(x))
  seen <- logical(nrow(x))
  for (row in seq_len(nrow(x))) {
    now <- x[row, ]
    chosen <- learner$choose(now, tie[[row]])
    if (used[[row]] && chosen == steps$action[[row]]) {
      seen[[row]] <- TRUE
      learner$learn(now, chosen, steps$reward[[row]])
    }
  }
  list(reward = steps$reward[seen], weights = learner$weights(colnames(x)))
}

play_contexts <- function(world, observation, actions, block, horizon, draws, confidence) {
  x <- block(observation)
  learner <- context_learner(ncol(x), actions$count, draws, confidence)
  reward <- numeric(horizon)
  action <- episode <- integer(horizon)
  observations <- vector("list", horizon)
  playing <- 1L
  finished <- 0L
  until_interrupted(
    for (step in seq_len(horizon)) {
      now <- block(observation)[1L, ]
      chosen <- learner$choose(now, stats::runif(1L))
      out <- world$step_one(batch_value(world$action_space, actions$value(chosen), 1L))
      suspendInterrupts({
        learner$learn(now, chosen, out$reward)
        observations[[step]] <- observation
        action[[step]] <- chosen
        reward[[step]] <- out$reward
        episode[[step]] <- playing
        finished <- step
      })
      ended <- out$terminated || out$truncated
      observation <- if (ended) world$reset(NULL) else out$next_observation
      playing <- playing + ended
    },
    "Interrupted: returning what was learned in {finished} of {total} steps.",
    function() finished, total = horizon
  )
  if (!finished) rlang::interrupt()
  played <- seq_len(finished)
  list(
    observation = observations[played], action = action[played], reward = reward[played],
    episode = episode[played], weights = learner$weights(colnames(x))
  )
}
