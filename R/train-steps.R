# The loop in which a learner of this package plays a single sub-environment, step by step: a model,
# an environment in R, or one on a server. Below it, the same learner in several of them.

#' Make the functions by which a learner of values learns
#'
#' These functions are made for one iteration and change their state in place. `x` is an observation
#' as `one()` of the learner's basis returns it. Actions are numbered from 1.
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
#'   the episode terminated, whether it was truncated, and the observation. `guard` is a function
#'   around the code that takes steps, or `NULL`.
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
  space <- vector_env$action_space
  action_of <- space_index(space)$value
  reset <- vector_env$reset
  # A single number is also a batch of one.
  step_one <- if (inherits(space, "gym_space_discrete")) vector_env$step_one
  step <- step_one %||% function(action) vector_env$step(action, 1L)
  one <- basis$one
  list(
    guard = vector_env$guard,
    reset = function(seed) {
      observation <- reset(seed, 1L)
      list(one(observation), observation)
    },
    step = function(x, column) {
      out <- step(action_of(column))
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
  action_of <- space_index(agent$spaces$action_space)$value
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
      action_of(column)
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

# Masks ----------------------------------------------------------------------------------

# A mask says which actions are valid. It is an element of an environment's infos.

#' Let a vector environment tell a learner which actions are valid
#'
#' Its `reset()` and `step()` request infos, which [as_vector_env()] otherwise leaves out.
#' @param name The name of the info's element that is the mask.
#' @param note A function of a batch of observations and their masks (a logical matrix with a row
#'   for each observation and a column for each action), which is called whenever masks arrive.
#' @noRd
with_masks <- function(vector_env, name, note, call) {
  env <- vector_env$env
  abort_if(
    vector_env$one_seed || !"return_info" %in% names(formals(env$reset)), "mask", name, call,
    "`mask` needs the infos of {environment_label(vector_env)}, which are not available in this
     vector environment.",
    i = 'Use a single environment, or one made by `gym_make()` with vectorization_mode "sync".'
  )
  space <- vector_env$observation_space
  actions <- vector_env$action_space
  if (is.null(env$num_envs)) {
    # A single environment, with batches of one observation and one action.
    single <- env
    batched <- function(out) {
      out$observation <- batch_of(space, list(out$observation))
      out
    }
    env <- list(
      num_envs = 1L, reset = function(...) batched(single$reset(...)),
      step = function(action) batched(single$step(batch_value(actions, action, 1L)))
    )
  }
  n <- env$num_envs
  was_reset <- FALSE
  vector_env$reset <- function(seeds, which = 1L) {
    some <- was_reset && length(which) < n
    seed <- rep(if (some) NA_real_ else seeds, length.out = n)
    seed[which] <- seeds
    resets <- if (some) list(mask = seq_len(n) %in% which)
    out <- rlang::exec(env$reset, seed = seed, !!!resets, return_info = TRUE)
    was_reset <<- TRUE
    observation <- batch_rows(space, out$observation, which)
    mask <- mask_in(out$info, name, n, actions, call)
    if (!is.null(mask)) note(observation, mask[which, , drop = FALSE])
    observation
  }
  vector_env$step <- function(action, which = 1L) {
    count <- length(which)
    out <- if (count < n) env$step(action, which = which) else env$step(action)
    out$next_observation <- out$next_observation %||% out$observation
    mask <- mask_in(out$info, name, count, actions, call)
    if (is.null(mask)) {
      has <- paste0('"', names(out$info), '"', collapse = ", ", recycle0 = TRUE)
      abort_wrong(
        "mask", name, call,
        '`mask` names "{name}", but the environment\'s info has no such element.',
        i = if (nzchar(has)) "It has {has}."
      )
    }
    final <- mask_in(out$info$final_info, name, count, actions, call)
    ended <- out$terminated | out$truncated
    if (!is.null(final)) mask[ended, ] <- final[ended, ]
    goes_on <- which(!out$terminated)
    if (length(goes_on)) {
      note(batch_rows(space, out$next_observation, goes_on), mask[goes_on, , drop = FALSE])
    }
    out
  }
  # If the environment started the next episode itself, its info would replace that of the last
  # step.
  vector_env$begins_next <- FALSE
  vector_env$step_one <- NULL
  vector_env
}

#' Read the mask in an info
#' @param n The number of sub-environments.
#' @return A logical matrix, `NULL` if the info has no such element.
#' @noRd
mask_in <- function(info, name, n, actions, call) {
  mask <- plain_numbers(info[[name]], "mask", call)
  if (is.null(mask)) {
    return(NULL)
  }
  count <- as.integer(space_index(actions)$count)
  right <- (is.numeric(mask) || is.logical(mask)) && length(mask) == n * count &&
    (n == 1L || identical(dim(mask), c(n, count)))
  abort_if(
    !right, "mask", mask, call,
    "The info's `{name}` must be a number or TRUE or FALSE for each of
     {count_of(count, \"action\")}{if (n > 1L) paste(\" and of\", n, \"sub-environments\")}, not
     {describe_argument(mask)}."
  )
  if (n == 1L) mask <- row_major(mask)
  matrix(mask != 0, n, count)
}

#' Keep a learner from taking masked actions again
#'
#' Their values become -Inf, so its policy does not take them either.
#' @param mask As passed to `note` of [with_masks()].
#' @noRd
forbid_actions <- function(learner, agent, observation, mask, call) {
  row <- agent$basis$of(observation, nrow(mask))[, 1L]
  for (i in seq_along(row)) {
    forbidden <- !mask[i, ]
    for (store in learner$stores) store$forbid(row[[i]], forbidden)
    abort_if(
      all(learner$stores[[1L]]$row(row[[i]]) == -Inf), "mask", mask[i, ], call,
      "The info's `{agent$mask}` forbids every action at the observation
       {describe_value(batch_value(agent$spaces$observation_space, observation, i))}."
    )
  }
}
