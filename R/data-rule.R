# A rule learned from data is a policy: it acts, predicts and prints itself.

# The values of all actions in some states, a data frame.
rule_values <- function(policy, states, step = NULL, call = rlang::caller_env()) {
  own <- names(policy$steps$state)
  check_columns(states, own, "newdata", call)
  states <- as.data.frame(states)[own]
  for (name in own) {
    levels <- levels(policy$steps$state[[name]])
    if (!is.null(levels)) {
      new <- setdiff(as.character(states[[name]]), levels)
      abort_if(
        length(new), "newdata", states, call,
        "The rule knows no {name} {describe_value(new[[1L]])}.",
        i = "The data has {few_names(levels)}."
      )
      states[[name]] <- factor(states[[name]], levels)
    }
  }
  block <- policy$regression$block(states)
  if (length(policy$fits) > 1L) {
    step <- rep_len(step, nrow(states))
    wrong <- setdiff(step, seq_along(policy$fits))
    if (length(wrong)) {
      must <- paste("a step from 1 to", length(policy$fits))
      abort_argument(wrong[1L], must, "newdata$step", call)
    }
  }
  values_by_step(policy$regression, policy$fits, block, step)
}

best_known <- function(policy, values) {
  values <- known_values(values)
  most_taken <- which.max(tabulate(policy$steps$action))
  ifelse(rowSums(values > -Inf) > 0, max.col(values, "first"), most_taken)
}

#' @exportS3Method
predict_policy.gym_policy_fitted <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (!is.data.frame(newdata)) {
    newdata <- data.frame(matrix(newdata, ncol = length(policy$steps$state)))
    names(newdata) <- names(policy$steps$state)
  }
  if (length(policy$fits) > 1L) check_columns(newdata, "step", "newdata", call)
  values <- rule_values(policy, newdata, newdata[["step"]], call)
  colnames(values) <- row_texts(policy$steps$actions)
  best <- best_known(policy, values)
  switch(
    type, action = named_numbers(labelled_space(policy$steps$actions), best - 1L), output = values,
    probability = `colnames<-`(one_hot(best, ncol(values)), colnames(values))
  )
}

#' @export
act.gym_policy_fitted <- function(policy, observation, ...) {
  predict_policy(policy, observation, "action")
}

# A rule with a horizon counts the steps in its memory. After the horizon it acts as in the last
# step.
#' @exportS3Method
act_batch.gym_policy_fitted <- function(policy, observation, n, vector_env) {
  last <- length(policy$fits)
  choose <- function(observation, step = NULL) {
    columns <- data.frame(
      observation_columns(vector_env$observation_space, observation), check.names = FALSE
    )
    own <- names(policy$steps$state)
    if (!all(own %in% names(columns)) && length(columns) == length(own)) names(columns) <- own
    columns$step <- step
    actions <- predict_policy(policy, columns, "action", vector_env$call)
    encoded_actions(vector_env, actions, n)
  }
  if (last == 1L) {
    return(choose(observation))
  }
  policy$act <- function(observation, memory) {
    list(action = choose(observation, memory[, "step"]), memory = pmin(memory + 1, last))
  }
  act_batch.gym_policy_memory(policy, observation, n, vector_env)
}

# Converts actions of the data, or the columns of their parts, to a batch of the environment's
# actions.
encoded_actions <- function(vector_env, actions, n) {
  space <- vector_env$action_space
  if (inherits(space, "gym_space_discrete")) {
    return(encoded_values(space, actions, "action", vector_env$call))
  }
  if (has_parts(space)) {
    actions <- as.list(actions)
    # The keys of a Dict.
    if (!is.null(names(space$spaces))) names(actions) <- sub("^action_", "", names(actions))
  } else if (is.data.frame(actions)) {
    actions <- as.matrix(actions)
  }
  batch_actions(actions, n, vector_env)
}

#' @export
format.gym_policy_fitted <- function(x, ...) {
  recipe <- x$recipe
  if (is.null(recipe)) {
    return(x$regression$label)
  }
  paste0(
    "fitted Q", if (recipe$double) ", double", ", ", x$regression$label,
    if (recipe$discount < 1) paste0(", discount ", number_text(recipe$discount)),
    if (!is.null(recipe$horizon)) paste0(", horizon ", recipe$horizon)
  )
}

#' @export
print.gym_policy_fitted <- function(x, ...) {
  cat("<policy: ", format(x), ">\n", sep = "")
  steps <- x$steps
  if (length(x$fits) > 1L) steps <- steps_in(steps, steps$step <= length(x$fits))
  share <- function(action) {
    percent_text_each(tabulate(action, nrow(steps$actions)) / length(action))
  }
  taken <- best_known(x, rule_values(x, steps$state, steps$step))
  print(data.frame(
    action = row_texts(steps$actions), rule = share(taken), data = share(steps$action)
  ), row.names = FALSE)
  cat(rule_lines(x), sep = "\n")
  invisible(x)
}

# Shows a linear rule for two actions as an inequality, and a small table as it is.
rule_lines <- function(x) {
  regression <- x$regression
  labels <- row_texts(x$steps$actions)
  simple <- length(labels) == 2L && length(x$steps$actions) == 1L && !isTRUE(x$recipe$double)
  if (!is.null(regression$coefficients) && simple) {
    return(unlist(lapply(seq_along(x$fits), function(step) {
      own <- regression$coefficients(x$fits[[step]])
      action <- paste0("action", labels[[2L]])
      own <- own[grepl(action, names(own), fixed = TRUE)]
      terms <- gsub(paste0(":?", action, ":?"), "", names(own))
      terms <- ifelse(nzchar(terms), paste0(" x ", gsub("`", "", terms)), "")
      sum <- paste0(ifelse(own < 0, " - ", " + "), number_text_each(abs(own)), terms, collapse = "")
      paste0(
        if (length(x$fits) > 1L) paste0("Step ", step, ": "), "Takes ", labels[[2L]], " if ",
        sub("^ - ", "-", sub("^ [+] ", "", sum)), " > 0"
      )
    })))
  }
  if (!is.null(regression$states) && nrow(regression$states) <= 12L && length(x$fits) == 1L) {
    best <- best_known(x, rule_values(x, regression$states))
    return(paste0(row_texts(regression$states), ": ", labels[best]))
  }
  character()
}

# The values of the states of the data, for state_values().
rule_state_values <- function(policy, actions) {
  states <- policy$steps$state
  if (length(policy$fits) > 1L) {
    step <- policy$steps$step
    states <- data.frame(step, states, check.names = FALSE)[step <= length(policy$fits), ]
  }
  states <- sorted_rows(unique(states))
  q <- rule_values(policy, states, states[["step"]])
  if (!actions) {
    return(data.frame(states, value = best_values(known_values(q)), check.names = FALSE))
  }
  row <- rep(seq_len(nrow(q)), each = ncol(q))
  action <- rep(seq_len(ncol(q)), nrow(q))
  data.frame(
    states[row, , drop = FALSE], policy$steps$actions[action, , drop = FALSE],
    value = as.vector(t(q)), row.names = NULL, check.names = FALSE
  )
}
