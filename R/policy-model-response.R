# What a model was fitted to, which must be the actions of the environment.

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
  if (length(strange)) {
    gym_abort(
      c(paste0("The levels of the model's response, ", quoted_names(policy$labels),
               ", must be actions; ", quoted_names(strange), if (length(strange) > 1L) {
                 " are none."
               } else {
                 " is none."
               }),
        i = actions_text(env_id, space),
        i = "`glm(factor(action) ~ ..., binomial)` is fitted to their numbers."),
      class = "gym_error_argument", argument = "policy", value = policy, call = call
    )
  }
}

actions_text <- function(env_id, space) {
  actions <- if (space$n > 8L) {
    paste("from", space$start, "to", space$start + space$n - 1L)
  } else {
    paste(action_names(env_id, space$n, space$start), collapse = ", ")
  }
  paste0("The actions are ", actions, ".")
}
