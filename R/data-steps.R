#' Describe logged steps
#'
#' Check a data frame of steps that somebody took, such as visits of patients, and sort it into a
#' row for each step, in order. [estimate_model()], [learn_q()], [learn_fitted_q()],
#' [evaluate_offline()] and [learn_bandit()] learn from the result. They also learn from the result
#' of [rollout()] with `steps = TRUE`, and from its `$steps`.
#'
#' # Episodes
#'
#' The next state of a step is the state in the next row of its episode, unless the data has columns
#' for it. An episode ends where `terminated` is `TRUE`. If the last step of an episode is not
#' terminated, the episode was cut off: it went on, but nobody recorded how. Without a column
#' `terminated` every episode ends with its last row.
#'
#' # States and actions
#'
#' A state has one or several columns of text, factors, logical values or numbers. An action has one
#' or several columns of text, factors, logical values or whole numbers. Several columns are the
#' parts of an action, such as a drug and its dose. Each combination in the data is an action.
#'
#' @param data A data frame with a row for each step, in any order.
#' @param episode The name of the column that tells which episode a step belongs to, a string. The
#'   default is `"episode"`.
#' @param state The names of the columns of the state, strings. `NULL`, the default, takes all
#'   columns that have no other meaning here.
#' @param action The name of the column of the action, or the names of its parts, strings. Without a
#'   column `"action"` the default takes all columns whose names start with `action_`, as in the
#'   steps of a rollout.
#' @param reward The name of the column of the reward, a string.
#' @param time The name of the column by which the steps of an episode are sorted, a string. `NULL`,
#'   the default, uses the column `step`. Without this column the rows of an episode must be in
#'   order.
#' @param terminated The name of the column that is `TRUE` for the last step of an episode that
#'   ended, a string. `NULL`, the default, uses the column `terminated`, if there is one.
#' @param probability The name of the column with the probability with which the action was chosen,
#'   a string. `NULL`, the default, uses the column `probability`, if there is one.
#' @param next_state The names of the columns of the next state, in the order of `state`. `NULL`,
#'   the default, uses the columns whose names are `next_` and the name of a column of the state, if
#'   all of them are there.
#' @return A data frame of class `gym_steps` with the columns `episode`, `step` (its number in the
#'   episode, an integer), those of the state, `action` (or `action_` and the name of each part),
#'   `reward`, `terminated`, perhaps `probability`, and `next_` and the name of each column of the
#'   state. The next state is `NA` where it is not known. You can select rows as from any data
#'   frame, and learn from the result, too.
#' @section Errors: `gym_error_argument` for a missing column, missing values (the message names the
#'   rows), a reward that is not a finite number, a probability of 0 or above 1, two steps of an
#'   episode at the same time, or an episode that goes on after its end.
#' @export
#' @examples
#' visits <- data.frame(
#'   patient = c("a", "a", "b", "b", "b"), visit = c(1, 2, 1, 2, 3),
#'   severity = c("high", "low", "low", "high", "low"), age = c(60, 60, 41, 41, 41),
#'   drug = c("new", "old", "old", "new", "old"), wellbeing = c(1, 3, 2, 1, 3)
#' )
#' steps_data(visits, episode = "patient", state = c("severity", "age"), action = "drug",
#'            reward = "wellbeing", time = "visit")
steps_data <- function(data, episode = "episode", state = NULL, action = "action",
                       reward = "reward", time = NULL, terminated = NULL, probability = NULL,
                       next_state = NULL) {
  call <- rlang::current_env()
  if (inherits(data, "gym_rollout")) data <- data$steps
  if (!is.data.frame(data) || !nrow(data)) {
    abort_argument(data, "a data frame with a row for each step", "data", call)
  }
  data <- as.data.frame(data)
  if ("candidate" %in% names(data) && episode == "episode") {
    data$episode <- paste(data$candidate, data$episode)
    data$candidate <- NULL
  }
  own <- step_columns(
    data, episode, state, action, reward, time, terminated, probability, next_state, call
  )
  state <- own$state
  actions <- named_as_actions(data[own$action])
  steps <- data.frame(
    episode = data[[episode]], .row = seq_len(nrow(data)), data[state], actions,
    reward = data[[reward]],
    terminated = if (is.null(own$terminated)) FALSE else data[[own$terminated]],
    stringsAsFactors = FALSE, check.names = FALSE
  )
  steps$probability <- if (!is.null(own$probability)) data[[own$probability]]
  check_step_columns(steps, state, names(actions), call)
  time <- data[[own$time %||% ""]]
  order <- order(match(steps$episode, unique(steps$episode)), time %||% steps$.row)
  steps <- steps[order, ]
  if (!is.null(time)) check_once(steps, time[order], own$time, call)
  last <- !duplicated(steps$episode, fromLast = TRUE)
  if (is.null(own$terminated)) steps$terminated <- last
  check_ends_once(steps, last, call)
  after <- paste0("next_", state)
  steps[after] <- if (is.null(own$next_state)) {
    following <- steps[c(seq_along(last)[-1L], length(last)), state, drop = FALSE]
    following[last, ] <- NA
    following
  } else {
    data[order, own$next_state]
  }
  steps$step <- sequence(rle(match(steps$episode, unique(steps$episode)))$lengths)
  columns <- c("episode", "step", state, names(actions), "reward", "terminated",
               if (!is.null(steps$probability)) "probability", after)
  row.names(steps) <- NULL
  structure(steps[columns], class = c("gym_steps", "data.frame"))
}

# The names of the columns, including the defaults.
step_columns <- function(data, episode, state, action, reward, time, terminated, probability,
                         next_state, call) {
  own <- function(name, given) given %||% if (name %in% names(data)) name
  time <- own("step", time)
  terminated <- own("terminated", terminated)
  probability <- own("probability", probability)
  if (identical(action, "action")) action <- columns_of_action(names(data))
  taken <- c(episode, action, reward, time, terminated, probability, "truncated", next_state)
  state <- state %||% grep("^next_", setdiff(names(data), taken), value = TRUE, invert = TRUE)
  after <- paste0("next_", state)
  next_state <- next_state %||% if (all(after %in% names(data))) after
  needed <- c(episode, state, action, reward, time, terminated, probability)
  check_columns(data, c(needed, next_state), "data", call)
  if (!length(state) || !is.null(next_state) && length(next_state) != length(state)) {
    abort_argument(next_state %||% state, "the names of columns, as many as of the next state",
                   "state", call)
  }
  reserved <- intersect(state, c(
    "episode", "step", names(named_as_actions(data[action])), "reward", "terminated", "probability"
  ))
  abort_if(
    length(reserved), "state", state, call,
    "The column `{reserved[[1L]]}` has another meaning in steps: give it another name in the
     state."
  )
  check_no_missing(data, needed, call)
  list(state = state, action = action, time = time, terminated = terminated,
       probability = probability, next_state = next_state)
}

# Checks --------------------------------------------------------------------------------

check_no_missing <- function(data, columns, call) {
  for (name in columns) {
    missing <- which(is.na(data[[name]]))
    abort_if(
      length(missing), "data", data, call,
      'The column `{name}` of `data` has missing values in {count_of(length(missing), "row")}:
       {rows_text(missing)}.',
      i = "Leave out whole episodes with missing values, or fill the values in."
    )
  }
}

rows_text <- function(rows) {
  paste0(toString(utils::head(rows, 5L)), if (length(rows) > 5L) ", ...")
}

check_step_columns <- function(steps, state, actions, call) {
  check_column(steps, "reward", "finite numbers", are_finite, "data", call)
  check_column(steps, "terminated", "TRUE or FALSE", are_flags, "data", call)
  if (!is.null(steps$probability)) {
    above_zero <- function(x) are_probabilities(x) & x > 0
    check_column(steps, "probability", "numbers above 0 and at most 1", above_zero, "data", call)
  }
  for (name in state) {
    if (!is.atomic(steps[[name]]) || !is.null(dim(steps[[name]]))) {
      abort_argument(steps[[name]], "text, a factor, logical values or numbers", name, call)
    }
  }
  for (action in steps[actions]) {
    abort_if(
      is.numeric(action) && !all(are_whole_numbers(action)) || !is.atomic(action),
      "action", action, call,
      "The actions must be text, a factor, logical values or whole numbers.",
      i = "`cut()` makes a factor of numbers."
    )
  }
}

check_once <- function(steps, time, name, call) {
  again <- which(duplicated(data.frame(steps$episode, time)))
  if (length(again)) {
    at <- again[[1L]]
    abort_wrong(
      "data", steps, call,
      "Rows {steps$.row[[at - 1L]]} and {steps$.row[[at]]} of `data` are steps of the same episode
       with the same `{name}`, {time[[at]]}: number the steps of each episode differently."
    )
  }
}

check_ends_once <- function(steps, last, call) {
  early <- which(steps$terminated & !last)
  if (length(early)) {
    at <- early[[1L]]
    abort_wrong(
      "data", steps, call,
      "Episode {steps$episode[[at]]} ends in row {steps$.row[[at]]} of `data` and goes on in row
       {steps$.row[[at + 1L]]}.",
      i = "Give what follows an end another value of `episode`."
    )
  }
}

# Reading -------------------------------------------------------------------------------

#' Prepare logged steps for learning
#'
#' @param data A user's argument: steps, a rollout, or a data frame with their column names.
#' @return A list with an element, or a row, for each step, in order: `episode` (from 1), `step`,
#'   `state` and `after` (data frames; text is a factor), `known` (is the next state known?),
#'   `action` (its number, from 1), `reward`, `ends`, `probability` (or `NULL`), `last`. And
#'   `actions`, a data frame with a row for each action of the data; `episodes`, `labels` (of the
#'   episodes) and `longest`, numbers; `cut`, the lengths of the episodes that were cut off.
#' @noRd
steps_of <- function(data, call = rlang::caller_env()) {
  if (!inherits(data, "gym_steps")) {
    data <- naming_own_call(steps_data(data), "steps_data", call)
  }
  data <- as.data.frame(data)
  after <- grep("^next_", names(data), value = TRUE)
  state <- sub("^next_", "", after)
  for (i in seq_along(state)) {
    column <- data[[state[[i]]]]
    if (is.character(column) || is.factor(column)) {
      levels <- if (is.factor(column)) levels(column) else sort(unique(column))
      next_one <- as.character(data[[after[[i]]]])
      levels <- union(levels, sort(unique(next_one[!is.na(next_one)])))
      data[[state[[i]]]] <- factor(column, levels)
      data[[after[[i]]]] <- factor(next_one, levels)
    }
  }
  taken <- data[columns_of_action(names(data))]
  actions <- sorted_rows(unique(taken))
  episode <- match(data$episode, unique(data$episode))
  last <- !duplicated(episode, fromLast = TRUE)
  next_state <- stats::setNames(data[after], state)
  list(
    episode = episode, step = data$step, state = data[state], after = next_state,
    known = stats::complete.cases(next_state), action = match(row_texts(taken), row_texts(actions)),
    actions = actions, reward = as.double(data$reward), ends = data$terminated,
    probability = data$probability, last = last, episodes = max(episode),
    labels = unique(data$episode), longest = max(data$step),
    cut = data$step[last & !data$terminated]
  )
}

# Selects some rows. Episodes keep their numbers.
steps_in <- function(steps, rows) {
  each <- c("episode", "step", "known", "action", "reward", "ends", "probability", "last")
  steps[each] <- lapply(steps[each], function(x) x[rows])
  steps$state <- steps$state[rows, , drop = FALSE]
  steps$after <- steps$after[rows, , drop = FALSE]
  steps
}

# A text for each episode. Episodes with the same name and the same steps have the same text.
episode_keys <- function(steps) {
  row <- do.call(paste, c(unname(as.list(steps$state)), list(steps$action, steps$reward)))
  keys <- vapply(split(row, steps$episode), rlang::hash, "")
  paste(steps$labels[as.integer(names(keys))], keys)
}

# Methods -------------------------------------------------------------------------------

# A selection of rows may lack a part of an episode, so it becomes a plain data frame.
#' @export
`[.gym_steps` <- function(x, ...) as.data.frame(x)[...]

#' @export
as.data.frame.gym_steps <- function(x, row.names = NULL, optional = FALSE, ...) {
  structure(x, class = "data.frame")
}

#' @export
print.gym_steps <- function(x, ...) {
  steps <- steps_of(x)
  lengths <- range(tabulate(steps$episode))
  cut <- length(steps$cut)
  share <- tabulate(steps$action, nrow(steps$actions)) / length(steps$action)
  kinds <- vapply(steps$state, function(column) {
    if (is.numeric(column)) "number" else count_of(length(unique(column)), "value")
  }, "")
  print_lines(x, c(
    paste0("<", count_of(nrow(x), "step"), " of ", count_of(steps$episodes, "episode"), ", ",
           paste(unique(lengths), collapse = " to "), " steps each, ",
           if (cut) paste(whole_number_text(cut), "cut off") else "all ended", ">"),
    paste0("State: ", toString(paste0(names(kinds), " (", kinds, ")"))),
    paste0("Actions: ", paste(
      c(utils::head(paste(row_texts(steps$actions), percent_text_each(share)), 8L),
        if (length(share) > 8L) "..."),
      collapse = if (length(steps$actions) > 1L) "; " else ", "
    )),
    paste0("Mean return: ", number_text(sum(steps$reward) / steps$episodes),
           if (!is.null(steps$probability)) "; with the probabilities of the actions")
  ))
}

percent_text_each <- function(share) vapply(share, percent_text, "")

# A model of them ------------------------------------------------------------------------

#' @export
estimate_model.gym_steps <- function(x, ...) {
  steps <- steps_of(x)
  rows <- which(steps$known | steps$ends)
  dropped <- length(steps$known) - length(rows)
  if (dropped) {
    cli::cli_inform(
      c(i = "{dropped} step{?s} whose next state is not known {?was/were} left out."),
      class = "gym_message_model"
    )
  }
  steps$after[!steps$known, ] <- steps$state[!steps$known, ]
  states <- names(steps$state)
  # If the state is a single column of numbers, the model keeps these numbers.
  own <- if (length(states) == 1L) "state" else states
  table <- data.frame(
    episode = steps$episode, step = steps$step, stats::setNames(steps$state, own),
    steps$actions[steps$action, , drop = FALSE], stats::setNames(steps$after, paste0("next_", own)),
    reward = steps$reward, terminated = steps$ends, row.names = NULL, check.names = FALSE
  )[rows, ]
  coded <- coded_transitions(table, own, names(steps$actions), rlang::current_env())
  if (!is.null(coded$states)) names(coded$states$values) <- states
  attr(coded$table, "spaces") <- list(
    observation_space = coded$states, action_space = coded$actions
  )
  estimate_model(coded$table)
}
