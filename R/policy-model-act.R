# From a batch of observations to what a model predicts, and from there to actions.

#' @exportS3Method
act_batch.gym_policy_model <- function(policy, observation, n, vector_env) {
  columns <- observation_columns(policy$observation_space, observation)
  model_actions(policy, columns, vector_env$call)
}

#' @export
act.gym_policy_model <- function(policy, observation, ...) {
  call <- rlang::current_env()
  observed <- observed_columns(policy, observation, call)
  actions <- model_actions(policy, observed$columns, call)
  if (observed$one) batch_value(policy$action_space, actions, 1L) else actions
}

predict_model <- function(policy, newdata, type, call) {
  observed <- observed_columns(policy, newdata, call)
  if (type == "output") {
    model_predictions(policy, observed$columns, call)
  } else {
    model_actions(policy, observed$columns, call)
  }
}

#' Put one or many observations, or a table of them, into columns
#' @return A list: `columns`, and `one`, whether there was a single observation rather than a batch.
#' @noRd
observed_columns <- function(policy, observation, call) {
  if (is.data.frame(observation)) {
    return(list(columns = as.list(narrow_values(observation)), one = FALSE))
  }
  space <- policy$observation_space
  if (is.null(space)) {
    abort_unplayed(policy, call)
  }
  one <- FALSE
  if (is_stackable(space)) {
    rows <- observation_rows(observation, space)
    one <- rows$one
    observation <- shape_values(as.vector(t(rows$values)), c(nrow(rows$values), space$shape))
  }
  list(columns = observation_columns(space, observation), one = one)
}

abort_unplayed <- function(policy, call) {
  gym_abort(
    c("The model does not know what is observed, nor what actions there are.",
      i = "Play it with `rollout()`: the policy in what that returns knows the environment."),
    class = "gym_error_argument", argument = "policy", value = policy, call = call
  )
}

model_actions <- function(policy, columns, call) {
  if (is.null(policy$action_space)) {
    abort_unplayed(policy, call)
  }
  n <- length(columns[[1L]])
  predicted <- model_predictions(policy, columns, call)
  if (inherits(policy$action_space, "gym_space_discrete")) {
    predicted_choices(policy, predicted, n, call)
  } else {
    predicted_numbers(policy, predicted, n, call)
  }
}

#' Ask a model about observations
#' @param columns A named list, the columns of a table of observations.
#' @return What its predict() gives, a data frame of one column as a vector.
#' @noRd
model_predictions <- function(policy, columns, call) {
  load_model_package(policy, call)
  newdata <- model_newdata(policy$model, columns)
  predicted <- tryCatch(
    do.call(stats::predict, c(list(quote(policy$model), quote(newdata)), policy$arguments)),
    error = function(cnd) {
      gym_abort(
        c(
          paste0("The `predict()` of the ", format(policy), " failed: ", conditionMessage(cnd)),
          i = paste0("The columns that it can use are ",
                     paste0("`", names(columns), "`", collapse = ", "), ".")
        ),
        class = "gym_error_argument", argument = "policy", value = policy, call = call,
        parent = cnd
      )
    }
  )
  predicted <- if (is.data.frame(predicted) && ncol(predicted) == 1L) predicted[[1L]] else predicted
  plain_numbers(predicted, "predict()", call)
}

model_newdata <- function(model, columns) {
  has_formula <- !is.null(tryCatch(stats::terms(model), error = function(cnd) NULL))
  if (has_formula) list2DF(columns) else do.call(cbind, columns)
}

# Discrete actions ---------------------------------------------------------------------

predicted_choices <- function(policy, predicted, n, call) {
  space <- policy$action_space
  if (is.matrix(predicted)) {
    predicted <- single_choice(policy, predicted, call)
  }
  check_prediction_count(policy, predicted, n, call)
  if (!is.null(policy$labels) && is.numeric(predicted)) {
    predicted <- policy$labels[1L + (predicted > 0.5)]
  }
  if (is.factor(predicted) || is.character(predicted)) {
    actions <- labelled_actions(policy, as.character(predicted), call)
  } else if (is.numeric(predicted) || is.logical(predicted)) {
    actions <- nearest_actions(space, as.numeric(predicted))
  } else {
    abort_prediction(policy, paste("not", describe_argument(predicted)), call = call)
  }
  if (anyNA(actions)) {
    abort_no_action(policy, predicted[is.na(actions)], call)
  }
  actions
}

# A matrix of one column is a vector. Several columns of nnet() are outputs to be compared.
single_choice <- function(policy, predicted, call) {
  if (ncol(predicted) == 1L) {
    return(predicted[, 1L])
  }
  space <- policy$action_space
  if (!inherits(policy$model, "nnet") || ncol(predicted) != space$n || anyNA(predicted)) {
    abort_prediction(
      policy, paste("not", describe_argument(predicted)),
      paste("If these are probabilities, name the type that gives the most probable action,",
            "such as `as_policy(model, type = \"class\")`."),
      call
    )
  }
  labels <- colnames(predicted) %||% (space$start + seq_len(space$n) - 1L)
  labels[max.col(predicted, ties.method = "first")]
}

# The actions with these labels: their numbers, or what the documentation calls them.
labelled_actions <- function(policy, labels, call) {
  space <- policy$action_space
  numbers <- as.integer(space$start + seq_len(space$n) - 1L)
  found <- match(labels, as.character(numbers))
  found <- ifelse(is.na(found), match(labels, action_meaning(policy$env_id, space$n)), found)
  numbers[found]
}

# NA for a whole number that is no action.
nearest_actions <- function(space, numbers) {
  last <- space$start + space$n - 1
  whole <- numbers == trunc(numbers)
  nearest <- pmin(pmax(ceiling(numbers - 0.5), space$start), last)
  nearest[!is.finite(numbers) | whole & nearest != numbers] <- NA
  as.integer(nearest)
}

# Actions that are a Box -----------------------------------------------------------------

predicted_numbers <- function(policy, predicted, n, call) {
  space <- policy$action_space
  if (!is.numeric(predicted)) {
    abort_prediction(policy, paste("not", describe_argument(predicted)), call = call)
  }
  width <- prod(space$shape)
  values <- matrix(as.vector(predicted), nrow = NROW(predicted))
  if (ncol(values) != width) {
    abort_prediction(
      policy, paste0("not ", describe_argument(predicted)),
      paste0("An action of ", format(space), " has ", count_of(width, "number"), "."), call
    )
  }
  check_prediction_count(policy, values[, 1L], n, call)
  if (!all(is.finite(values))) {
    abort_no_action(policy, values[!is.finite(values)], call)
  }
  shape_values(as.vector(t(values)), c(n, space$shape))
}

# Predictions that are no actions ----------------------------------------------------------

check_prediction_count <- function(policy, predicted, n, call) {
  if (length(predicted) != n) {
    abort_prediction(
      policy, paste0("not ", length(predicted), " for ", count_of(n, "observation")),
      paste("Fit the model by the columns' names, as in",
            "`lm(action ~ pole_angle, data = as.data.frame(played))`: a model of `data$action`",
            "predicts for the data that it was fitted to."),
      call
    )
  }
}

abort_prediction <- function(policy, given, hint = NULL, call) {
  gym_abort(
    c(paste0("The `predict()` of the ", format(policy),
             " must give one action for each observation, ", given, "."),
      i = hint),
    class = "gym_error_argument", argument = "policy", value = policy, call = call
  )
}

abort_no_action <- function(policy, predicted, call) {
  space <- policy$action_space
  first <- if (is.factor(predicted)) as.character(predicted[[1L]]) else predicted[[1L]]
  missing <- is.na(first) && !is.nan(first)
  gym_abort(
    c(
      paste0("The `predict()` of the ", format(policy), " gave ",
             if (missing) "NA" else describe_value(first), ", which is no action of ",
             format(space), "."),
      i = actions_text(space, policy$env_id),
      i = if (missing) "Is a part of the observation missing in the data of the model?"
    ),
    class = "gym_error_argument", argument = "policy", value = policy, call = call
  )
}

actions_text <- function(space, env_id) {
  if (!inherits(space, "gym_space_discrete")) {
    "The numbers of an action must be finite."
  } else if (space$n <= 8L) {
    names <- action_names(env_id, space$n, space$start)
    paste0("The actions are ", paste(names, collapse = ", "), ".")
  } else {
    paste0("The actions are from ", space$start, " to ", space$start + space$n - 1L, ".")
  }
}
