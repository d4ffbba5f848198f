# One step at a time: the loop in which a learner of this package plays a single sub-environment (a
# model, an environment in R, or one on a server); and the same learner in several of them.

#' Make the functions by which a learner of values learns
#'
#' They are made for an iteration and change their state in place. `x` is an observation as `one()`
#' of the learner's basis returns it. Actions are numbered from 1.
#' @param draw Draws a number from 0 to 1.
#' @return A list: the functions `act(x, sub_env, observation)`, the first action of an episode, and
#'   `observe(x, column, reward, after, terminated, ended, sub_env, observation)`, which learns from
#'   a step and returns the next action, `NA` at the end of the episode; `sees`, whether both need
#'   the observation, which may otherwise be `NULL`; `stores`, see [value_store()], in which masks
#'   are recorded; and `export()`, the current agent.
#' @noRd
learner_of <- function(agent, draw) UseMethod("learner_of")

#' @exportS3Method
learner_of.default <- function(agent, draw) NULL

#' Let a learner play the episodes of an iteration in a single sub-environment
#' @param world As made by [world_of()].
#' @param limit The number of steps after which an episode is cut off.
#' @return A list: `returns` and `lengths` of the episodes.
#' @noRd
play_steps <- function(learner, world, seeds, limit, report, call) {
  act <- learner$act
  observe <- learner$observe
  step <- world$step
  returns <- numeric(length(seeds))
  lengths <- integer(length(seeds))
  for (episode in seq_along(seeds)) {
    first <- world$reset(seeds[[episode]])
    x <- first[[1L]]
    column <- act(x, 1L, first[[2L]])
    taken <- 0L
    total <- 0
    repeat {
      out <- step(x, column)
      after <- out[[1L]]
      reward <- out[[2L]]
      if (!is.finite(reward)) check_rewards(reward, call)
      terminated <- out[[3L]]
      taken <- taken + 1L
      total <- total + reward
      ended <- terminated || out[[4L]] || taken >= limit
      column <- observe(x, column, reward, after, terminated, ended, 1L, out[[5L]])
      if (ended) break
      x <- after
    }
    returns[[episode]] <- total
    lengths[[episode]] <- taken
    report(episode)
  }
  list(returns = returns, lengths = lengths)
}

# Worlds ------------------------------------------------------------------------------

#' Make a learner's view of a single sub-environment
#'
#' @param basis The learner's, see [basis_of()].
#' @param draw Draws a number from 0 to 1.
#' @return A list of functions: `reset(seed)`, which returns a list of `x` and the observation, a
#'   batch of one; and `step(x, column)`, which returns a list of the next `x`, the reward, whether
#'   the episode terminated, whether it was truncated, and the observation. `guard` is a function of
#'   code that steps, or `NULL`.
#' @noRd
world_of <- function(vector_env, basis, draw) {
  if (!is.null(vector_env$model)) {
    model_world(vector_env$model, basis, draw)
  } else {
    stepped_world(vector_env, basis)
  }
}

# Any environment with functions for reset and step.
stepped_world <- function(vector_env, basis) {
  first <- as.integer(vector_env$action_space$start) - 1L
  reset <- vector_env$reset
  step <- vector_env$step_one %||% function(action) vector_env$step(action, 1L)
  one <- basis$one
  list(
    guard = vector_env$guard,
    reset = function(seed) {
      observation <- reset(seed, 1L)
      list(one(observation), observation)
    },
    step = function(x, column) {
      out <- step(column + first)
      observation <- out$next_observation
      list(one(observation), out$reward, out$terminated, out$truncated, observation)
    }
  )
}

# A model plays with its own state numbers. The loop applies its step limit.
model_world <- function(model, basis, draw) {
  moves <- moves_of(model)
  states <- moves$states
  count <- as.double(length(states))
  first <- moves$first
  last <- moves$last
  from <- moves$from
  width <- moves$width
  until <- moves$until
  next_row <- moves$next_row
  reward <- moves$reward
  terminated <- moves$terminated
  own <- is.null(basis$features)
  seen <- if (own) NULL else lapply(states, basis$one)
  row <- 0L
  x_of <- function(row) if (own) row else seen[[row]]
  list(
    reset = function(seed) {
      row <<- min(sum(moves$start <= draw()) + 1L, moves$last_start)
      list(x_of(row), states[[row]])
    },
    step = function(x, column) {
      pair <- row + count * (column - 1)
      move <- first[[pair]]
      end <- last[[pair]]
      if (is.na(move)) {
        action <- state_numbers(model$action_space)[[column]]
        check_possible(moves, model, row, action, pair, FALSE)
      }
      if (move < end) {
        at <- from[[pair]] + draw() * width[[pair]]
        while (move < end) {
          middle <- (move + end) %/% 2L
          if (until[[middle]] > at) end <- middle else move <- middle + 1L
        }
      }
      row <<- next_row[[move]]
      list(if (own) row else seen[[row]], reward[[move]], terminated[[move]], FALSE, states[[row]])
    }
  )
}

# Several sub-environments --------------------------------------------------------------

#' Let a learner play several sub-environments, one after the other in each step
#' @return A list of `act` and `observe`, for [play_batch()].
#' @noRd
side_by_side <- function(learner, agent, call) {
  basis <- agent$basis
  space <- agent$spaces$observation_space
  first <- as.integer(agent$spaces$action_space$start) - 1L
  pick <- if (identical(basis$each, 1L)) .subset2 else function(present, i) present[i, ]
  see <- function(observation, i) if (learner$sees) batch_rows(space, observation, i)
  observe <- learner$observe
  next_column <- integer()
  present <- column <- NULL
  list(
    act = function(observation, sub_env) {
      present <<- basis$of(observation, length(sub_env))
      column <<- next_column[sub_env]
      for (i in which(is.na(column))) {
        column[[i]] <<- learner$act(pick(present, i), sub_env[[i]], see(observation, i))
      }
      column + first
    },
    observe = function(transitions) {
      reward <- transitions$reward
      check_rewards(reward, call)
      sub_env <- transitions$sub_env
      after <- basis$of(transitions$next_observation, length(reward))
      terminated <- transitions$terminated
      ended <- terminated | transitions$truncated
      # Local variables save a tenth of the time where there are many sub-environments.
      before <- present
      taken <- column
      following <- integer(length(reward))
      for (i in seq_along(reward)) {
        following[[i]] <- observe(
          pick(before, i), taken[[i]], reward[[i]], pick(after, i), terminated[[i]], ended[[i]],
          sub_env[[i]], see(transitions$next_observation, i)
        )
      }
      following[ended] <- NA_integer_
      next_column[sub_env] <<- following
    }
  )
}
