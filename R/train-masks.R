# Masks: which actions are valid, according to an environment's infos.

#' Let a vector environment tell a learner which actions are valid
#'
#' Its `reset()` and `step()` request infos, which [as_vector_env()] otherwise leaves out.
#' @param name The name of the info's element that is the mask.
#' @param note A function of a batch of observations and their masks (a logical matrix with a row
#'   for each observation and a column for each action), which is called whenever masks arrive.
#' @noRd
with_masks <- function(vector_env, name, note, call) {
  env <- vector_env$env
  if (vector_env$one_seed || !"return_info" %in% names(formals(env$reset))) {
    abort_wrong(
      "mask", name, call,
      "`mask` needs the infos of {environment_label(vector_env)}, which are not available in this
       vector environment.",
      i = 'Use a single environment, or one made by `gym_make()` with vectorization_mode "sync".'
    )
  }
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
  # If the environment starts the next episode itself, its info would replace that of the last step.
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
  count <- as.integer(actions$n)
  right <- (is.numeric(mask) || is.logical(mask)) && length(mask) == n * count &&
    (n == 1L || identical(dim(mask), c(n, count)))
  if (!right) {
    abort_wrong(
      "mask", mask, call,
      "The info's `{name}` must be a number or TRUE or FALSE for each of
       {count_of(count, \"action\")}{if (n > 1L) paste(\" and of\", n, \"sub-environments\")}, not
       {describe_argument(mask)}."
    )
  }
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
    if (all(learner$stores[[1L]]$row(row[[i]]) == -Inf)) {
      abort_wrong(
        "mask", mask[i, ], call,
        "The info's `{agent$mask}` forbids every action at the observation
         {describe_value(batch_value(agent$spaces$observation_space, observation, i))}."
      )
    }
  }
}
