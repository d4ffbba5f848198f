#' Make a policy of a fitted model
#'
#' What a model predicts becomes the action. So a policy can be learned from steps that another one
#' played: fit a model of the action, given the parts of the observation, and play it.
#'
#' # Observations
#'
#' The model is asked about a data frame with a row for each observation, whose columns are named as
#' in the table of steps of a [rollout()]. A model without a formula (no `terms()`), such as
#' `nnet::nnet(x, y)`, is asked about a matrix with these columns.
#'
#' # From a prediction to an action
#'
#' Where actions are discrete:
#'
#' - A factor or a string is the action with this label: its number, such as `"1"`, or what
#'   Gymnasium's documentation calls it, such as `"push left"`. The codes of a factor do not matter.
#' - `TRUE` is action 1, `FALSE` action 0.
#' - A whole number is the action itself, any other number stands for the action nearest to it,
#'   half way for the lower one. So a probability above one half is action 1.
#' - A binomial [glm()] of a factor gives the second of its two levels where that one's probability
#'   is above one half.
#' - [nnet::nnet()] with several outputs gives the action with the largest, of equal ones the first.
#'
#' Where actions are a Box, predictions are the actions: a numeric vector or, for actions of several
#' numbers, a matrix with an action in each row, as [lm()] of `cbind(action_1, action_2)` gives it.
#'
#' @param x A fitted model for which there is a method of [predict()], for instance of [lm()],
#'   [glm()], `rpart::rpart()` or `nnet::nnet()`. Policies and functions of observations come back
#'   as they are; of a search or a rollout it is the policy.
#' @param ... Further arguments of the model's `predict()`.
#' @param type What `predict()` is to give, a string. For a [glm()] the default is `"response"`; for
#'   `rpart::rpart()` `"class"` for a classification, otherwise `"vector"`; for `nnet::nnet()`
#'   `"class"` where it was fitted to a factor, otherwise `"raw"`. Other models' `predict()` gets
#'   none, unless it is named.
#' @return A policy; of a model one of class `gym_policy_model`, a list with the elements `model`,
#'   `arguments` (a list: what `predict()` gets), `labels` (the two levels of a binomial [glm()]'s
#'   factor, otherwise `NULL`), `package` (the package of its method, a string or `NULL`),
#'   `observation_space`, `action_space` and `env_id` (`NULL` until it is played).
#' @section Errors: `gym_error_argument` when there is no method of `predict()`; while it is played,
#'   when `predict()` fails, or gives what no action is.
#' @export
#' @examples
#' # A model of any kind that predicts: here one that was fitted to made-up data.
#' steps <- data.frame(pole_angle = rnorm(100))
#' steps$action <- as.integer(steps$pole_angle + rnorm(100, sd = 0.5) > 0)
#' as_policy(glm(action ~ pole_angle, binomial, steps))
#'
#' @examplesIf gym:::can_start_server()
#' # Learn from a policy that is good, without knowing how it decides.
#' good <- search_random("CartPole-v0", seed = 1)$policy
#' played <- rollout("CartPole-v1", good, episodes = 5, seed = 1, steps = TRUE)
#' fit <- glm(action ~ pole_angle + pole_angular_velocity, binomial, as.data.frame(played))
#' rollout("CartPole-v1", as_policy(fit), episodes = 20, seed = 2)
as_policy <- function(x, ...) UseMethod("as_policy")

#' @export
as_policy.default <- function(x, ...) {
  if (has_act_method(x)) {
    check_dots_empty(...)
    return(x)
  }
  new_model_policy(x, list(...))
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
as_policy.gym_search <- function(x, ...) {
  check_dots_empty(...)
  x$policy
}

#' @export
as_policy.gym_rollout <- as_policy.gym_search

#' @rdname as_policy
#' @export
as_policy.glm <- function(x, ..., type = "response") {
  labels <- if (identical(x$family$family, "binomial")) levels(stats::model.frame(x)[[1L]])
  if (length(labels) > 2L) {
    gym_abort(
      c(paste0("A binomial model tells two actions apart, but its response has ", length(labels),
               " levels."),
        i = "`rpart::rpart()` and `nnet::multinom()` tell more of them apart."),
      class = "gym_error_argument", argument = "x", value = x
    )
  }
  new_model_policy(x, list(type = type, ...), if (type == "response") labels)
}

#' @rdname as_policy
#' @export
as_policy.rpart <- function(x, ..., type = NULL) {
  type <- type %||% if (identical(x$method, "class")) "class" else "vector"
  new_model_policy(x, list(type = type, ...))
}

#' @rdname as_policy
#' @export
as_policy.nnet <- function(x, ..., type = NULL) {
  type <- type %||% if (is.null(x$lev)) "raw" else "class"
  new_model_policy(x, list(type = type, ...))
}

#' Make a policy of a model
#' @param labels The two levels that a probability tells apart; `NULL` for other predictions.
#' @noRd
new_model_policy <- function(model, arguments, labels = NULL, call = rlang::caller_env()) {
  method <- predict_method(model)
  if (is.null(method)) {
    abort_no_model(model, call)
  }
  check_dots_named(arguments, "type = \"response\"", call)
  structure(
    list(
      model = model, arguments = arguments, labels = labels, package = method$package,
      observation_space = NULL, action_space = NULL, env_id = NULL
    ),
    class = c("gym_policy_model", "gym_policy")
  )
}

#' Find the method of predict() for an object
#' @return A list with the element `package`, the name of the package that must be loaded for the
#'   method; `NULL` where there is no method.
#' @noRd
predict_method <- function(x) {
  if (!is.object(x)) {
    return(NULL)
  }
  if (isS4(x)) {
    return(list(package = attr(class(x), "package")))
  }
  for (class in class(x)) {
    method <- utils::getS3method("predict", class, optional = TRUE)
    if (!is.null(method)) {
      home <- topenv(environment(method))
      return(list(package = if (isNamespace(home)) getNamespaceName(home)[[1L]]))
    }
  }
}

abort_no_model <- function(x, call) {
  gym_abort(
    c(
      paste0("`x` must be a policy, a function of observations or a fitted model with a method of ",
             "`predict()`, not ", describe_argument(x), "."),
      i = if (is.object(x)) "If its method is in a package, load that first with `library()`."
    ),
    class = "gym_error_argument", argument = "x", value = x, call = call
  )
}

#' @export
format.gym_policy_model <- function(x, ...) {
  formula <- tryCatch(stats::formula(x$model), error = function(cnd) NULL)
  paste0(
    class(x$model)[[1L]], " model",
    if (inherits(formula, "formula")) paste0(", ", describe_value(plain_formula(formula)))
  )
}

# Without the environment, which would be printed, too.
plain_formula <- function(formula) {
  attributes(formula) <- NULL
  formula
}

#' @exportS3Method
policy_bind.gym_policy_model <- function(policy, env, call = rlang::caller_env()) {
  actions <- env$action_space
  if (!inherits(actions, "gym_space_discrete") && !inherits(actions, "gym_space_box")) {
    gym_abort(
      c(paste0("A model cannot choose from ", format(actions), " of ", environment_label(env), "."),
        i = paste("It can predict discrete actions and those of a Box; a function of observations",
                  "can put several predictions together.")),
      class = "gym_error_argument", argument = "policy", value = policy, call = call
    )
  }
  load_model_package(policy, call)
  policy$observation_space <- env$observation_space
  policy$action_space <- actions
  policy["env_id"] <- list(env$spec$id)
  policy
}

# A policy that was read from a file does not bring the package along.
load_model_package <- function(policy, call) {
  package <- policy$package
  if (!is.null(package) && !isNamespaceLoaded(package)) {
    check_suggested(package, paste("let a model of class", class(policy$model)[[1L]], "predict"),
                    call)
  }
}
