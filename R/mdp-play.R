#' Play a model
#'
#' Make an environment that follows a model, with random numbers from R's own generator. It needs no
#' server and moves all sub-environments together, so [rollout()] plays it fast. Functions that need
#' an environment also accept the model itself; use this function for its `$reset()` and `$step()`.
#'
#' @param model A model, see [gym_model()].
#' @param num_envs The number of sub-environments, a whole number of at least 1. `NULL`, the
#'   default, makes a single environment.
#' @return An environment as made by [gym_env()]. An invalid action raises an error.
#' @section Errors: `gym_error_argument` if `model` is not a model.
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' env <- model_env(walk)
#' env$reset(seed = 1)
#' env$step(1)
#' rollout(walk, policy_random(), episodes = 100, seed = 1)
model_env <- function(model, num_envs = NULL) {
  check_is_model(model)
  check_count(num_envs, allow_null = TRUE)
  moves <- moves_of(model)
  make <- function(...) {
    gym_env(
      reset = function(self) {
        drawn <- findInterval(stats::runif(self$num_envs %||% 1L), moves$start) + 1L
        self$row <- pmin(drawn, moves$last_start)
        self$over <- logical(length(self$row))
        moves$states[self$row]
      },
      step = function(self, action) {
        pair <- pair_rows(model, self$row, action)
        check_possible(moves, model, self$row, action, pair, self$over)
        drawn <- draw_transition(moves, pair)
        # All sub-environments step together. If the episode of one has ended, it stays where it is.
        self$row <- ifelse(self$over, self$row, moves$next_row[drawn])
        self$over <- self$over | moves$terminated[drawn]
        list(
          observation = moves$states[self$row], reward = moves$reward[drawn],
          terminated = self$over
        )
      },
      observation_space = model$observation_space, action_space = model$action_space,
      model = model, id = model$spec$id, max_episode_steps = model$spec$max_episode_steps,
      reward_threshold = model$spec$reward_threshold, ...
    )
  }
  if (is.null(num_envs)) make() else make(vectorized = TRUE, num_envs = num_envs)
}

#' @export
as_vector_env.gym_model <- function(x, num_envs = NULL, ..., max_envs = Inf, frames = FALSE,
                                    client = NULL, num_workers = NULL) {
  check_made_before(NULL, c(list(...), num_workers = num_workers), x)
  env <- model_env(x, num_envs %||% vectorized_sub_envs)
  vector_env <- as_vector_env(env, num_envs, frames = frames)
  vector_env$endless <- is.null(x$spec$max_episode_steps) && !can_end(x)
  vector_env$possible <- possible_actions(x)
  vector_env$model <- x
  vector_env
}

# Can an episode reach an end from its start?
can_end <- function(model) {
  moves <- ways_of(model)
  any(moves$terminated & moves$reached[moves$from])
}

# The first state that an episode may reach and can never end from, or NULL.
state_without_end <- function(model) {
  moves <- ways_of(model)
  ends <- seq_along(moves$reached) %in% moves$from[moves$terminated]
  goes_on <- !moves$terminated
  leads <- function(states) {
    seq_along(states) %in% moves$from[goes_on & states[moves$to]]
  }
  trap <- which(moves$reached & !closure(leads, ends))
  if (length(trap)) state_numbers(model$observation_space)[[trap[[1L]]]]
}

# The possible moves of a model, and the states in which an episode may choose an action because it
# can reach them from its start.
ways_of <- function(model) {
  moves <- numbered_transitions(model)
  leads <- function(reached) {
    seq_along(reached) %in% moves$to[reached[moves$from] & !moves$terminated]
  }
  c(moves[c("from", "to", "reward", "terminated")],
    list(reached = closure(leads, model$start > 0)))
}

#' Prepare the drawing of a model's transitions
#'
#' Put the probabilities of all transitions side by side on a line; transition i ends at `until[i]`.
#' The transitions of a pair of a state and an action are neighbours, and start at `from`. To draw
#' one, draw a uniform number in this part of the line and find the transition there.
#' @noRd
moves_of <- function(model) {
  table <- numbered_transitions(model)
  until <- cumsum(table$probability)
  pairs <- length(model$start) * as.integer(model$action_space$n)
  first <- match(seq_len(pairs), table$pair)
  last <- first + tabulate(table$pair, pairs) - 1L
  list(
    states = state_numbers(model$observation_space),
    start = cumsum(model$start), last_start = max(which(model$start > 0)),
    until = until, from = c(0, until)[first], width = until[last] - c(0, until)[first],
    first = first, last = last,
    next_row = table$to, reward = table$reward, terminated = table$terminated
  )
}

draw_transition <- function(moves, pair) {
  at <- moves$from[pair] + stats::runif(length(pair)) * moves$width[pair]
  drawn <- findInterval(at, moves$until) + 1L
  # By rounding, the number may fall just outside the pair's own part. After the end of an episode,
  # any transition will do.
  drawn <- pmin(pmax(drawn, moves$first[pair]), moves$last[pair])
  drawn[is.na(drawn)] <- 1L
  drawn
}

check_possible <- function(moves, model, row, action, pair, over) {
  barred <- is.na(moves$first[pair]) & !over
  if (any(barred)) {
    actions <- state_numbers(model$action_space)
    at <- row[barred][[1L]]
    has <- actions[!is.na(moves$first[pair_rows(model, at, actions)])]
    abort_wrong(
      "action", action, NULL,
      "Action {action[barred][[1L]]} cannot be taken in state {moves$states[[at]]} of
       {model$spec$id}.",
      i = "Valid actions there: {toString(has)}. Use -Inf for the others in a `policy_table()`."
    )
  }
}
