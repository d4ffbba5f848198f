#' Make a policy from a fitted model
#'
#' Make a policy whose action is a model's prediction. So you can imitate another policy: fit a
#' model of its actions, given the parts of the observation, and play the model. `as_policy()` knows
#' models of [lm()], [glm()], `rpart::rpart()` and `nnet::nnet()`. For any other model, `predict`
#' says how it predicts.
#'
#' # Observations
#'
#' The model gets a data frame with a row for each observation and the column names of the table of
#' steps of a [rollout()]. A network of `nnet::nnet(x, y)`, which has no formula, gets a matrix with
#' these columns.
#'
#' # From a prediction to an action
#'
#' For discrete actions:
#'
#' - A factor or a string is the action with this label: its number, such as `"1"`, or its name in
#'   Gymnasium's documentation, such as `"push left"`. The codes of a factor are ignored.
#' - `TRUE` is action 1, `FALSE` action 0.
#' - A whole number is the action itself. Any other number selects the nearest action, or the lower
#'   one if two are equally near. So a probability above one half selects action 1.
#' - A binomial [glm()] of a factor selects the second level if its probability is above one half.
#' - [nnet::nnet()] with several outputs selects the action with the largest output, or the first of
#'   equal ones.
#'
#' If the action space is a Box, predictions are the actions: a numeric vector, or a matrix with an
#' action in each row if an action has several numbers, as from [lm()] of `cbind(action_1,
#' action_2)`.
#'
#' # Models of Stable-Baselines3
#'
#' `as_policy("model.zip")` reads a zip file that `model.save()` of Stable-Baselines3 wrote, such as
#' those of rl-baselines3-zoo. The result is a [policy_network()]. A convolutional or recurrent
#' policy stays with Stable-Baselines3, which plays it, see [learn_sb3()]. Reading the file needs
#' the server's extra `"sb3"`. The file has weights, settings in plain text, and pickles. A pickle
#' from elsewhere can run any program with your rights, so `as_policy()` loads no pickle. If only a
#' pickle has a setting, give it as the argument `activation` or `moments`.
#'
#' @param x A fitted model, or the path of a zip file of Stable-Baselines3. Policies and functions
#'   of observations are returned unchanged. A training, a search or a rollout returns its policy.
#' @param ... Further arguments of the model's [predict()], or of `predict`, by name. The default of
#'   `type` for a [glm()] is `"response"`; for `rpart::rpart()` `"class"` for a classification,
#'   otherwise `"vector"`; for `nnet::nnet()` `"class"` if it was fitted to a factor, otherwise
#'   `"raw"`.
#' @param predict `NULL` for a known model, or a function of the model and a data frame of
#'   observations that returns their actions in one of the forms below, such as
#'   `function(model, newdata) predict(model, newdata)$predictions`.
#' @return A policy. A policy made of a model has the class `gym_policy_model` and is a list with
#'   the elements `model`, `predict`, `arguments` (a list: those of `predict()`), `labels` (the two
#'   levels of a binomial [glm()]'s factor, otherwise `NULL`), `package` (the package of its method,
#'   a string or `NULL`), `observation_space`, `action_space` and `env_id` (`NULL` until it is
#'   played).
#' @section Errors: `gym_error_argument` for an unknown model without `predict`. Playing raises it
#'   if `predict()` fails or its result is not an action.
#' @section Warnings: `gym_warning_response` if a model was fitted to numbers that are not actions,
#'   such as the codes of a factor, or if it is a regression on the numbers of more than two
#'   actions. The warning comes once a session for each formula.
#' @export
#' @examples
#' # Fit a model to made-up data.
#' steps <- data.frame(pole_angle = rnorm(100))
#' steps$action <- as.integer(steps$pole_angle + rnorm(100, sd = 0.5) > 0)
#' as_policy(glm(action ~ pole_angle, binomial, steps))
#'
#' # For another kind of model, say how it predicts.
#' fit <- loess(action ~ pole_angle, steps)
#' as_policy(fit, predict = function(model, newdata) predict(model, newdata) > 0.5)
#'
#' @examplesIf gym:::can_start_server()
#' # Imitate a good policy.
#' good <- search_random("CartPole-v0", seed = 1)$policy
#' played <- rollout("CartPole-v1", good, episodes = 5, seed = 1, steps = TRUE)
#' fit <- glm(action ~ pole_angle + pole_angular_velocity, binomial, as.data.frame(played))
#' rollout("CartPole-v1", as_policy(fit), episodes = 20, seed = 2)
as_policy <- function(x, ...) UseMethod("as_policy")

#' @rdname as_policy
#' @export
as_policy.default <- function(x, ..., predict = NULL) {
  if (has_method(x, "act")) {
    check_dots_empty(...)
    return(x)
  }
  call <- rlang::current_env()
  arguments <- list(...)
  known <- if (is.null(predict)) model_defaults(x, arguments$type, call)
  abort_if(
    is.null(predict) && is.null(known), "x", x, call,
    "`x` must be a policy, a function of observations or a model of `lm()`, `glm()`,
     `rpart::rpart()` or `nnet::nnet()`, not {describe_argument(x)}.",
    i = if (is.object(x)) {
      "For another model, give `predict = function(model, newdata) ...`, which returns actions."
    }
  )
  if (!is.null(predict) && !is.function(predict)) {
    abort_argument(predict, "a function of the model and a data frame", "predict", call)
  }
  check_dots_named(arguments, "type = \"response\"", call)
  arguments$type <- arguments$type %||% known$type
  structure(
    list(
      model = x, predict = predict, arguments = arguments, labels = known$labels,
      package = known$package, observation_space = NULL, action_space = NULL, env_id = NULL
    ),
    class = c("gym_policy_model", "gym_policy")
  )
}

#' @export
as_policy.gym_policy <- function(x, ...) {
  check_dots_empty(...)
  x
}

#' @export
as_policy.function <- function(x, ...) {
  check_dots_empty(...)
  check_policy(x)
  x
}

#' @export
as_policy.gym_training <- function(x, ...) {
  check_dots_empty(...)
  x$policy
}

#' @export
as_policy.gym_rollout <- as_policy.gym_training

#' Find out how a model of a known class predicts actions
#' @param type The user's `type` of predictions, `NULL` for the default.
#' @return A list: `type`; `package`, which has the method of predict(); `labels`, the two levels of
#'   a binomial model's factor, if there are any. `NULL` for an unknown model.
#' @noRd
model_defaults <- function(model, type, call) {
  if (inherits(model, "glm")) {
    type <- type %||% "response"
    labels <- if (identical(model$family$family, "binomial")) {
      levels(stats::model.frame(model)[[1L]])
    }
    abort_if(
      length(labels) > 2L, "x", model, call,
      "A binomial model tells two actions apart, but its response has {length(labels)} levels.",
      i = "`rpart::rpart()` and `nnet::multinom()` tell more of them apart."
    )
    list(type = type, labels = if (type == "response") labels)
  } else if (inherits(model, "lm")) {
    list(type = type)
  } else if (inherits(model, "rpart")) {
    default <- if (identical(model$method, "class")) "class" else "vector"
    list(type = type %||% default, package = "rpart")
  } else if (inherits(model, "nnet")) {
    list(type = type %||% if (is.null(model$lev)) "raw" else "class", package = "nnet")
  }
}

#' @export
format.gym_policy_model <- function(x, ...) {
  formula <- tryCatch(stats::formula(x$model), error = function(cnd) NULL)
  # Remove the formula's environment, which would be printed, too.
  text <- if (inherits(formula, "formula")) describe_value(`attributes<-`(formula, NULL))
  paste(c(paste(class(x$model)[[1L]], "model"), text), collapse = ", ")
}

#' @exportS3Method
policy_bind.gym_policy_model <- function(policy, env, call = rlang::caller_env()) {
  actions <- env$action_space
  abort_if(
    !inherits(actions, c("gym_space_discrete", "gym_space_box")), "policy", policy, call,
    "A model cannot choose from {format(actions)} of {environment_label(env)}.",
    i = "It can predict discrete actions and those of a Box; a function of observations can put
         several predictions together."
  )
  load_model_package(policy, call)
  if (inherits(actions, "gym_space_discrete")) check_response(policy, actions, env$spec$id, call)
  policy$observation_space <- env$observation_space
  policy$action_space <- actions
  policy["env_id"] <- list(env$spec$id)
  policy$wrappers <- env$spec$wrappers
  policy
}

# Reading a policy from a file does not load the model's package.
load_model_package <- function(policy, call) {
  package <- policy$package
  if (!is.null(package) && !isNamespaceLoaded(package)) {
    check_suggested(package, paste("let a model of class", class(policy$model)[[1L]], "predict"),
                    call)
  }
}

# Asking it ----------------------------------------------------------------------------

#' @exportS3Method
act_batch.gym_policy_model <- function(policy, observation, n, vector_env) {
  columns <- observation_columns(policy$observation_space, observation)
  model_actions(policy, columns, vector_env$call)
}

#' @export
act.gym_policy_model <- function(policy, observation, ...) {
  call <- rlang::current_env()
  observed_action(policy, model_columns(policy, observation, "observation", call), call)
}

#' @exportS3Method
predict_policy.gym_policy_model <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (type == "probability") abort_no_probabilities(policy, call)
  observed <- model_columns(policy, newdata, "newdata", call)
  if (type == "output") {
    model_predictions(policy, observed$columns, call)
  } else {
    observed_action(policy, observed, call)
  }
}

observed_action <- function(policy, observed, call) {
  actions <- model_actions(policy, observed$columns, call)
  if (observed$one) batch_value(policy$action_space, actions, 1L) else actions
}

#' Put observations given by hand into the columns of a table
#'
#' A model with a formula finds its columns in a data frame by name, so a data frame is returned as
#' it is.
#' @return A list: `columns`, and `one`, whether it is a single observation.
#' @noRd
model_columns <- function(policy, observation, arg, call) {
  space <- policy$observation_space
  if (is.data.frame(observation) && (takes_table(policy) || is.null(space))) {
    return(list(columns = as.list(plain_numbers(observation, arg, call)), one = FALSE))
  }
  check_was_played(policy, call)
  observed <- if (is_stackable(space) || is.data.frame(observation)) {
    observed_batch(observation, space, arg, call)
  } else {
    list(batch = in_order(space, parts_by_name(observation, space, arg, call)), one = FALSE)
  }
  list(columns = observation_columns(space, observed$batch), one = observed$one)
}

takes_table <- function(policy) {
  !is.null(policy$predict) ||
    !is.null(tryCatch(stats::terms(policy$model), error = function(cnd) NULL))
}

check_was_played <- function(policy, call) {
  abort_if(
    is.null(policy$action_space), "policy", policy, call,
    "The model does not know the observations and actions of an environment.",
    i = "Play it with `rollout()`: the element `policy` of the result knows the environment."
  )
}

#' Get a model's predictions for observations
#' @param columns A named list, the columns of a table of observations.
#' @return The result of predict(), with a data frame of one column as a vector.
#' @noRd
model_predictions <- function(policy, columns, call) {
  if (!length(columns[[1L]])) {
    # Many models cannot predict for no observations.
    width <- prod(policy$action_space$shape)
    return(if (width == 1) numeric() else matrix(numeric(), 0L, width))
  }
  load_model_package(policy, call)
  newdata <- if (takes_table(policy)) list2DF(columns) else do.call(cbind, columns)
  predict <- policy$predict %||% stats::predict
  predicted <- tryCatch(
    do.call(predict, c(list(quote(policy$model), quote(newdata)), policy$arguments)),
    error = function(cnd) {
      abort_prediction(
        policy, paste("failed:", conditionMessage(cnd)),
        paste("The columns that it can use are", few_names(names(columns))), call, parent = cnd
      )
    }
  )
  predicted <- if (is.data.frame(predicted) && ncol(predicted) == 1L) predicted[[1L]] else predicted
  plain_numbers(predicted, "predict()", call)
}
