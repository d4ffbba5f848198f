# Shared by the learners of values: how they start, act, and move a value towards a target.

#' Make a learner of values
#'
#' @param class Its class.
#' @param settings The user's settings, a list with `features`, `discount`, `learning_rate`,
#'   `epsilon`, `temperature` and `initial`, and perhaps `n` and `lambda`.
#' @return The learner. During learning it also has `basis`, see [basis_of()]; `weights`, a matrix
#'   with a row for each feature and a column for each action; and `taken`, the number of steps
#'   observed.
#' @noRd
new_learner <- function(class, settings) {
  new_agent(class, settings, c("gym_value_learner", "gym_learner"))
}

check_learner <- function(settings, call = rlang::caller_env()) {
  check_discount(settings$discount, "discount", call)
  given <- names(settings)
  check_schedules(settings, intersect(c("learning_rate", "epsilon"), given), max = 1, call = call)
  if (!is.null(settings$temperature)) {
    check_schedules(settings, "temperature", min = lowest_temperature, call = call)
  }
  if (is.null(settings$temperature) && !isTRUE(settings$exploring_starts)) {
    check_explores(settings$epsilon, call)
  }
  features <- settings$features
  initial <- plain_numbers(settings$initial, "initial", call)
  # With a function as `features`, `initial` may have a number for each feature.
  if (!is.function(features) || length(initial) <= 1L) {
    check_number(initial, arg = "initial", call = call)
  } else if (!is.numeric(initial) || !all(is.finite(initial))) {
    abort_argument(initial, "finite numbers", "initial", call)
  }
  if (!is.null(features) && !is.function(features) && !inherits(features, "gym_features")) {
    must <- "NULL, the result of `tile_coding()`, or a function of observations"
    abort_argument(features, must, "features", call)
  }
  check_string(settings$mask, arg = "mask", allow_null = TRUE, call = call)
  if (!is.null(settings$mask) && !is.null(features)) {
    abort_wrong("mask", settings$mask, call, "`mask` works with a table only, not with features.")
  }
}

# Beginning ---------------------------------------------------------------------------

#' @export
agent_start.gym_value_learner <- function(agent, policy) {
  table_index(policy$action_space, "actions", NULL)
  agent$spaces <- policy[c("observation_space", "action_space")]
  agent$basis <- basis_of(agent$features, policy$observation_space, NULL)
  agent$taken <- 0
  agent["weights"] <- list(first_weights(agent, policy))
  agent
}

# The number of columns of the weights: one for each action, or one for the values of states.
value_columns_of <- function(agent) {
  of_states <- inherits(agent, c("gym_agent_td", "gym_agent_actor_critic"))
  if (of_states) 1L else count_actions(agent)
}

count_actions <- function(agent) as.integer(space_index(agent$spaces$action_space)$count)

first_weights <- function(agent, policy) {
  if (!is.null(policy$q)) {
    abort_if(
      !is.null(agent$features) || ncol(policy$q) != value_columns_of(agent), "policy", policy, NULL,
      "Only a learner of a table with a column for each action can start with a table."
    )
    weights <- policy$q
  } else if (is.na(agent$basis$count)) {
    # The number of features is unknown until the user's function is called.
    return(NULL)
  } else {
    rows <- agent$basis$count
    columns <- value_columns_of(agent)
    check_fits_memory(
      as.double(rows) * columns,
      paste0("Learning a value for each of ", count_of(columns, "action"), " in ",
             count_of(rows, "state")), NULL, "env",
      "With `features`, such as `tile_coding()`, states share a value."
    )
    weights <- matrix(as.double(agent$initial) / agent$basis$each, rows, columns)
  }
  if (is.null(agent$features) && identical(dim(weights), dim(policy$possible))) {
    # An action that a state does not have is never taken. A terminal state has no actions.
    weights[!policy$possible & rowSums(policy$possible) > 0] <- -Inf
  }
  weights
}

# Learning ----------------------------------------------------------------------------

#' Make the functions that all learners of values share
#'
#' They are closures, which change elements of vectors in place. An agent that is passed from step
#' to step would be copied each time.
#' @return A list: `store`, see [value_store()]; `choose`, see [action_chooser()]; `learn`, see
#'   [lookahead()].
#' @noRd
learning_of <- function(agent, draw) {
  store <- value_store(agent$basis, agent$weights, agent$initial, value_columns_of(agent))
  list(store = store, choose = action_chooser(agent, draw), learn = lookahead(agent, store))
}

#' Make a learner from the functions of its steps
#' @param learning As [learning_of()] makes it.
#' @param act,observe,sees As [learner_of()] describes them.
#' @param keeps A function that returns the elements that the agent keeps besides its weights, a
#'   list with names: the number of steps so far, `taken`, and others.
#' @param stores All its tables; the first one has the values of the actions.
#' @noRd
new_steps <- function(agent, learning, act, observe, keeps, stores = list(learning$store),
                      sees = FALSE) {
  list(
    act = act, observe = observe, stores = stores, sees = sees,
    export = function() {
      kept <- c(list(weights = learning$store$get()), keeps())
      agent[names(kept)] <- kept
      agent
    }
  )
}

#' Keep values that are linear in the features of an observation
#'
#' @param basis As [basis_of()] returns it. Below, `x` is the result of its `one()`.
#' @param weights A matrix with a row for each feature and a column for each action; `NULL` if the
#'   number of features of a user's function is not known yet.
#' @param initial The first weights if `weights` is `NULL`: a number, or one for each feature.
#' @return A list of functions: `row(x)`, the values of all actions; `value(x, column)`, the value
#'   of one; `toward(x, column, target, rate)`, which moves it; `cells(x, column)`, the weights in
#'   its sum, and `gradient(x)`, their factors; `add(cells, by)`; `forbid(x, forbidden)`, after
#'   which these actions are never taken; `get()`, the weights.
#' @noRd
value_store <- function(basis, weights, initial, columns) {
  if (is.null(basis$each)) {
    return(feature_store(weights, initial, columns))
  }
  rows <- as.double(nrow(weights))
  offsets <- rows * (seq_len(columns) - 1)
  each <- basis$each
  own <- if (each == 1L) {
    list(
      row = function(x) weights[x + offsets],
      value = function(x, column) weights[[x + rows * (column - 1)]],
      toward = function(x, column, target, rate) {
        cell <- x + rows * (column - 1)
        value <- weights[[cell]]
        weights[[cell]] <<- value + rate * (target - value)
      },
      forbid = function(x, forbidden) weights[x + offsets[forbidden]] <<- -Inf
    )
  } else {
    list(
      row = function(x) .colSums(weights[x, ], each, columns),
      value = function(x, column) sum(weights[x + rows * (column - 1)]),
      toward = function(x, column, target, rate) {
        cells <- x + rows * (column - 1)
        present <- weights[cells]
        weights[cells] <<- present + rate / each * (target - sum(present))
      }
    )
  }
  ones <- rep(1, each)
  c(own, list(
    each = each, cells = function(x, column) x + rows * (column - 1), gradient = function(x) ones,
    add = function(cells, by) weights[cells] <<- weights[cells] + by, get = function() weights
  ))
}

feature_store <- function(weights, initial, columns) {
  known <- function(x) {
    if (is.null(weights)) {
      if (!length(initial) %in% c(1L, length(x))) {
        must <- paste("one number, or one for each of", count_of(length(x), "feature"))
        abort_argument(initial, must, "initial", NULL)
      }
      weights <<- matrix(as.double(initial), length(x), columns)
    } else if (length(x) != nrow(weights)) {
      abort_wrong(
        "features", NULL, NULL,
        '`features` returned {count_of(nrow(weights), "feature")} at first, and now {length(x)}.'
      )
    }
  }
  list(
    each = 1, row = function(x) {
      known(x)
      as.vector(x %*% weights)
    },
    value = function(x, column) {
      known(x)
      sum(x * weights[, column])
    },
    toward = function(x, column, target, rate) {
      known(x)
      error <- target - sum(x * weights[, column])
      weights[, column] <<- weights[, column] + rate * error * x
    },
    cells = function(x, column) which(x != 0) + length(x) * (column - 1),
    gradient = function(x) x[x != 0],
    add = function(cells, by) weights[cells] <<- weights[cells] + by, get = function() weights
  )
}

#' Make the function by which a learner chooses an action
#'
#' If values are equal, it draws one of them, so that a new learner tries all actions.
#' @param draw Draws a number from 0 to 1.
#' @return A function of the values of the actions and the steps so far, which returns the number of
#'   an action, from 1.
#' @noRd
action_chooser <- function(agent, draw) {
  epsilon <- agent$epsilon %||% 0
  temperature <- agent$temperature
  if (!is.null(temperature)) {
    return(function(values, taken) {
      heat <- scheduled(temperature, taken, "temperature", lowest_temperature, Inf)
      weight <- exp((values - max(values)) / heat)
      draw_place(weight, draw())
    })
  }
  changes <- is.function(epsilon)
  explores <- if (changes) 0 else epsilon
  actions <- seq_len(value_columns_of(agent))
  function(values, taken) {
    if (changes) explores <<- scheduled(epsilon, taken, "epsilon")
    from <- if (explores > 0 && draw() < explores) {
      actions[values > -Inf]
    } else {
      best <- max(values)
      if (is.na(best)) {
        gym_abort(
          c("The learned values have become infinite.",
            i = "Use a smaller `learning_rate`, or other `features`."),
          class = "gym_error_agent", call = NULL
        )
      }
      actions[values == best]
    }
    count <- length(from)
    # Like draw_place() with equal weights, but twice as fast.
    if (count == 1L) from else from[[as.integer(draw() * count) + 1L]]
  }
}

# Draws a place with a probability proportional to its weight. `u` is a random number from 0 to 1.
draw_place <- function(weight, u) {
  until <- cumsum(weight)
  count <- length(until)
  place <- sum(until <= u * until[[count]]) + 1L
  # Because of rounding, the place may be one too large.
  if (place > count) max(which(weight > 0)) else place
}

rate_of <- function(rate, name = "learning_rate") {
  if (is.function(rate)) function(taken) scheduled(rate, taken, name) else function(taken) rate
}

# Its policy ------------------------------------------------------------------------

#' @export
agent_policy.gym_value_learner <- function(agent) {
  weights_policy(agent, value_columns_of(agent))
}

weights_policy <- function(agent, columns) {
  weights <- action_weights(agent)
  if (is.null(agent$features)) {
    policy <- policy_table(weights)
    policy[c("observation_space", "action_space")] <- agent$spaces
    policy
  } else {
    weights <- weights %||% matrix(0, 0L, columns)
    new_feature_policy(agent$basis, weights, agent$spaces)
  }
}

# Results -----------------------------------------------------------------------------

#' Get the learned values
#'
#' Return the values in the table (or by the features) of an agent that learned them.
#' @param x The result of `learn_q()` and the like, or their agent; or a rule that was learned from
#'   data.
#' @param actions Return the value of each action? `FALSE`, the default, or `TRUE`.
#' @return For Discrete observations, a numeric vector with an element for each state, named by its
#'   number: the value of its best action, or, from [learn_td()], the value of the state. For
#'   observations with several parts, such as Blackjack's, a data frame with a column for each part,
#'   under its name, and `value`. A rule from data has a data frame of the states of the data, with
#'   the column `step` if it has a horizon. With `actions = TRUE` a data frame with a row for each
#'   state and action: the column `state`, or one for each part, `action` (its number), or one for
#'   each part, such as `action_dose`, and `value`. States in which no action was taken, such as
#'   terminal ones, keep their first value.
#' @section Errors: `gym_error_argument` if `x` was not learned by a table or by features of
#'   Discrete observations.
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' learned <- learn_td(walk, policy_random(), iterations = 50, seed = 1)
#' state_values(learned)
state_values <- function(x, actions = FALSE) {
  check_flag(actions)
  if (inherits(x, "gym_policy_fitted")) {
    return(rule_state_values(x, actions))
  }
  agent <- if (inherits(x, "gym_training")) x$agent else x
  space <- if (inherits(agent, "gym_value_learner")) agent$spaces$observation_space
  discrete <- inherits(space, "gym_space_discrete")
  if (is.null(space) || is.null(agent$weights) || !is.null(agent$features) && !discrete) {
    must <- "the result of a learner of a table, such as `learn_q()`"
    abort_argument(x, must, "x", rlang::current_env())
  }
  q <- action_weights(agent)
  if (!is.null(agent$features)) {
    states <- state_numbers(space)
    q <- linear_values(agent$basis, q, agent$basis$of(states, length(states)))
  }
  if (actions) {
    states <- all_values(space)
    row <- rep(seq_len(nrow(q)), each = ncol(q))
    actions <- countable_actions(agent$spaces$action_space)
    numbers <- rep(state_numbers(actions)[seq_len(ncol(q))], nrow(q))
    return(data.frame(
      states[row, , drop = FALSE], decoded_actions(actions, numbers), value = as.vector(t(q)),
      row.names = NULL
    ))
  }
  # For a given policy, the value of a state is the mean over the policy's actions.
  values <- if (is.null(agent$learns) || ncol(q) == 1L) {
    row_max(q)
  } else {
    mean_values(q, row_probabilities(agent$learns, agent$learns$q))
  }
  if (discrete && length(space$values) <= 1L) {
    stats::setNames(values, value_labels(space))
  } else {
    data.frame(all_values(space), value = values)
  }
}

# The table of values of the greedy policy. Double Q-learning has two tables.
action_weights <- function(agent) {
  if (is.null(agent$second)) agent$weights else (agent$weights + agent$second) / 2
}

learner_text <- function(name, agent, settings = NULL) {
  texts <- c(
    if (length(settings)) paste(names(settings), vapply(settings, format, "")),
    if (!is.null(agent$learning_rate)) paste("learning_rate", schedule_text(agent$learning_rate)),
    if (!is.null(agent$temperature)) {
      paste("temperature", schedule_text(agent$temperature))
    } else if (!is.null(agent$epsilon)) {
      paste("epsilon", schedule_text(agent$epsilon))
    },
    paste("discount", number_text(agent$discount))
  )
  paste0(name, ": ", paste(texts, collapse = ", "))
}
