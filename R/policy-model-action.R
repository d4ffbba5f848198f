# From a model's prediction to an action.

model_actions <- function(policy, columns, call) {
  check_was_played(policy, call)
  space <- policy$action_space
  n <- length(columns[[1L]])
  predicted <- model_predictions(policy, columns, call)
  discrete <- inherits(space, "gym_space_discrete")
  if (discrete && inherits(policy$model, "nnet") && NCOL(predicted) == space$n && space$n > 1) {
    # nnet() with several outputs gives a column for each action.
    if (anyNA(predicted)) {
      abort_no_action(policy, NA, call)
    }
    labels <- colnames(predicted) %||% (space$start + seq_len(space$n) - 1L)
    predicted <- labels[max.col(predicted, ties.method = "first")]
  }
  # The names of the columns come from the table of steps or from the model's formula.
  predicted <- action_by_name(space, predicted, NULL, call)
  check_predictions(policy, predicted, n, if (discrete) 1L else prod(space$shape), call)
  values <- if (is.factor(predicted)) as.character(predicted) else predicted
  values <- matrix(values, n, NCOL(predicted))
  actions <- if (discrete) chosen_actions(policy, values[, 1L]) else values
  wrong <- if (discrete) is.na(actions) else !is.finite(actions)
  if (any(wrong)) {
    abort_no_action(policy, values[wrong][[1L]], call)
  }
  if (discrete) actions else shape_values(as.vector(t(actions)), c(n, space$shape))
}

# Checks that there is an action for each observation, with the right number of numbers.
check_predictions <- function(policy, predicted, n, width, call) {
  discrete <- inherits(policy$action_space, "gym_space_discrete")
  right <- if (discrete) is.atomic(predicted) else is.numeric(predicted)
  must <- "must give one action for each observation, not"
  if (!right || NCOL(predicted) != width) {
    hint <- if (right && discrete) {
      paste("If these are probabilities, name the type that gives the most probable action,",
            "such as `as_policy(model, type = \"class\")`")
    } else if (right) {
      paste0("An action of ", format(policy$action_space), " has ", count_of(width, "number"))
    }
    abort_prediction(policy, paste(must, describe_argument(predicted)), hint, call)
  }
  if (NROW(predicted) != n) {
    hint <- paste("Fit the model by the columns' names, as in",
                  "`lm(action ~ pole_angle, data = as.data.frame(played))`: a model of",
                  "`data$action` predicts for the data that it was fitted to")
    problem <- paste(must, NROW(predicted), "for", count_of(n, "observation"))
    abort_prediction(policy, problem, hint, call)
  }
}

# Discrete actions from labels or the nearest numbers; NA for a label without an action.
chosen_actions <- function(policy, values) {
  space <- policy$action_space
  if (!is.null(policy$labels) && is.numeric(values)) {
    values <- policy$labels[1L + (values > 0.5)]
  }
  if (!is.character(values)) {
    return(nearest_actions(space, as.numeric(values)))
  }
  # Labels are the actions' numbers, or their names in the documentation.
  numbers <- as.integer(space$start + seq_len(space$n) - 1L)
  found <- match(values, as.character(numbers))
  found <- ifelse(is.na(found), match(values, action_meaning(policy$env_id, space$n)), found)
  numbers[found]
}

# NA for a whole number that is not an action.
nearest_actions <- function(space, numbers) {
  last <- space$start + space$n - 1
  whole <- numbers == trunc(numbers)
  nearest <- pmin(pmax(ceiling(numbers - 0.5), space$start), last)
  nearest[!is.finite(numbers) | whole & nearest != numbers] <- NA
  as.integer(nearest)
}

abort_no_action <- function(policy, predicted, call) {
  space <- policy$action_space
  missing <- is.na(predicted) && !is.nan(predicted)
  actions <- if (!inherits(space, "gym_space_discrete")) {
    "The numbers of an action must be finite"
  } else {
    actions_text(policy$env_id, space)
  }
  abort_prediction(
    policy,
    paste0("gave ", if (missing) "NA" else describe_value(predicted), ", which is no action of ",
           format(space)),
    c(actions, if (missing) "Is a part of the observation missing in the data of the model?"), call
  )
}

abort_prediction <- function(policy, problem, hints, call, parent = NULL) {
  lines <- c(paste("The `predict()` of the", format(policy), problem), hints)
  lines <- ifelse(grepl("[.?]$", lines), lines, paste0(lines, "."))
  names(lines) <- c("", rep("i", length(hints)))
  gym_abort(
    lines,
    class = "gym_error_argument", argument = "policy", value = policy, call = call, parent = parent
  )
}

# Check what a model was fitted to: it must be the actions of the environment -------------

check_response <- function(policy, space, env_id, call) {
  check_labels(policy, space, env_id, call)
  numbers <- response_numbers(policy)
  strange <- numbers[is.na(nearest_actions(space, numbers))]
  if (length(strange)) {
    problem <- paste0("was fitted to ", strange[[1L]], ", which is no action of ", format(space))
    hints <- c(actions_text(env_id, space),
               "The codes of a factor count from 1 and are not its levels.")
  } else if (length(numbers) && space$n > 2L) {
    problem <- paste("predicts a mean of the numbers of", space$n, "actions: the nearest action is",
                     "often not the most likely one")
    hints <- NULL
  } else {
    return(invisible())
  }
  text <- format(policy)
  hints <- c(hints, if (space$n > 2L) {
    paste("`rpart::rpart(factor(action) ~ ...)` and `nnet::multinom(factor(action) ~ ...)` choose",
          "the most likely one.")
  } else {
    "`glm(factor(action) ~ ..., binomial)` chooses the more likely one."
  })
  names(hints) <- rep("i", length(hints))
  rlang::warn(
    c(paste0("The ", text, " ", problem, "."), hints), class = "gym_warning_response",
    .frequency = "once", .frequency_id = paste("gym_response", text)
  )
}

# The numbers that a model was fitted to, if it predicts numbers and keeps them.
response_numbers <- function(policy) {
  model <- policy$model
  chooses <- !is.null(policy$labels) || any(policy$arguments$type %in% c("class", "prob"))
  if (chooses || !is.null(policy$predict)) {
    return(numeric())
  }
  response <- if (is.data.frame(model[["model"]])) {
    model[["model"]][[1L]]
  } else if (inherits(model, "nnet")) {
    round(model$fitted.values + model$residuals, 6L)
  } else {
    model[["y"]]
  }
  # lm() fits the codes of a factor.
  if (is.factor(response) && identical(class(model), "lm")) response <- as.integer(response)
  if (is.numeric(response) && NCOL(response) == 1L) as.vector(response) else numeric()
}

# The levels of a binomial model's factor must be actions: their numbers or their names.
check_labels <- function(policy, space, env_id, call) {
  numbers <- as.character(state_numbers(space))
  strange <- setdiff(policy$labels, c(numbers, action_meaning(env_id, space$n)))
  abort_if(
    length(strange), "policy", policy, call,
    "The levels of the model's response, {quoted_names(policy$labels)}, must be actions;
     {quoted_names(strange)} {if (length(strange) > 1L) 'are' else 'is'} none.",
    i = actions_text(env_id, space),
    i = "`glm(factor(action) ~ ..., binomial)` is fitted to their numbers."
  )
}

actions_text <- function(env_id, space) {
  actions <- if (space$n > 8L) {
    paste("from", space$start, "to", space$start + space$n - 1L)
  } else {
    paste(action_names(env_id, space$n, space$start), collapse = ", ")
  }
  paste0("The actions are ", actions, ".")
}
