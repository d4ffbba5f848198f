# check_env() compares an environment in R with its model, if it has one.

# The largest number of steps in total, and that in an episode.
most_compared <- 1000L
most_compared_in_episode <- 100L

#' @exportS3Method
look_at_model.gym_r_env <- function(env, check, seed) {
  if (is.null(definition_of(env)$model) || is_wrong(check)) {
    return()
  }
  model <- call_and_look(check, "model", "`gym_env(model = )`", suppressMessages(
    model_of_env(env, NULL), classes = "gym_message_model"
  ))
  if (has_raised(model)) {
    return()
  }
  played <- with_generator(new_generator(seed), play_by_model(check, model, seed))
  if (!is_wrong(check)) {
    compare_starts(check, model, played$starts)
    compare_steps(check, model, played$steps)
  }
}

is_wrong <- function(check) {
  any(vapply(check$found, function(finding) finding$severity == "wrong", NA))
}

# Plays episodes of random valid actions. With several sub-environments an episode goes on until the
# first of them ends. Returns the steps, one sub-environment after the other.
play_by_model <- function(check, model, seed) {
  possible <- possible_actions(model)
  starts <- steps <- list()
  while (length(steps) < most_compared && length(starts) < most_compared && !is_wrong(check)) {
    seed <- seed + 1
    place <- paste0("`reset(seed = ", seed, ")`")
    state <- call_and_look(check, "reset", place, check$env$reset(seed = seed))
    if (has_raised(state)) break
    look_at_observation(check, "reset", state, "The first observation")
    starts <- c(starts, list(state))
    steps <- c(steps, steps_by_model(check, model, possible, state, seed))
  }
  columns <- c("state", "action", "next_state", "reward", "terminated")
  names(columns) <- columns
  list(
    starts = unlist(starts),
    steps = list2DF(lapply(columns, function(name) unlist(lapply(steps, `[[`, name))))
  )
}

# The steps of one episode, which starts in `state`.
steps_by_model <- function(check, model, possible, state, seed) {
  steps <- list()
  ended <- FALSE
  while (!ended && length(steps) < most_compared_in_episode && !is_wrong(check)) {
    choices <- possible[state_rows(model, state), , drop = FALSE]
    # By the model, an episode ends in a state without actions, so this one should have ended.
    if (!all(rowSums(choices) > 0)) break
    action <- state_numbers(model$action_space)[draw_by_row(choices / rowSums(choices))]
    place <- paste0("step ", length(steps) + 1L, " of the episode with seed ", seed)
    out <- call_and_look(check, "step", paste("`step()` in", place), check$env$step(action))
    if (has_raised(out)) break
    look_at_step(check, out, place)
    steps <- c(steps, list(list(
      state = state, action = action, next_state = out$observation, reward = out$reward,
      terminated = out$terminated
    )))
    state <- out$observation
    ended <- any(out$terminated | out$truncated)
  }
  steps
}

compare_starts <- function(check, model, starts) {
  states <- state_numbers(model$observation_space)
  unknown <- states[states %in% starts & model$start == 0]
  if (length(unknown)) {
    note_finding(check, "model", paste0(
      "An episode started in state ", unknown[[1L]], " in play, which has the ",
      "probability 0 in the model."
    ))
  }
}

# Finds the first step that the model does not have, because of its next state, the end of the
# episode, or the reward.
compare_steps <- function(check, model, steps) {
  table <- model$transitions[model$transitions$probability > 0, ]
  parts <- c("state", "action", "next_state", "terminated", "reward")
  # Rewards may have been rounded.
  key <- function(rows, first) {
    rows$reward <- signif(rows$reward, 7L)
    do.call(paste, rows[parts[seq_len(first)]])
  }
  for (first in 3:5) {
    unlike <- which(!key(steps, first) %in% key(table, first))
    if (length(unlike)) break
  }
  if (!length(unlike)) {
    return(invisible())
  }
  one <- steps[unlike[[1L]], ]
  led <- paste0("Action ", one$action, " led from state ", one$state, " to state ",
                one$next_state, " in play")
  note_finding(check, "model", switch(
    parts[[first]],
    next_state = paste0(led, ", which has the probability 0 in the model."),
    terminated = paste0(
      led,
      if (one$terminated) {
        " and ended the episode, which goes on in the model."
      } else {
        " and the episode went on, which ends there in the model."
      }
    ),
    reward = {
      known <- unique(table$reward[key(table, 4L) == key(one, 4L)])
      paste0(led, " for the reward ", number_text(one$reward), ", which by the model is ",
             paste(number_text_each(known), collapse = " or "), ".")
    }
  ))
}
