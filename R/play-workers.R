# Playing on the workers of the plan that the user has set with future::plan(): whether it can be
# done, and what becomes of a batch. A batch's slices are divided among the workers, each share is a
# task (play-futures.R), and what was played is put together in order.

#' Play on many cores and machines
#'
#' Where the user has set a plan of the package future, such as
#' `future::plan(future::multisession, workers = 8)` or
#' `future::plan(future::cluster, workers = c("host1", "host2"))`, its workers play the episodes of
#' [rollout()], [evaluate_policy()], [search_random()] and the other searches, [train_agent()],
#' [search_landscape()] and [gym_objective()]; `train_agent(seeds = )` gives each of them whole
#' trainings. Nothing else needs to be said, and nothing changes without a plan.
#'
#' Results do not depend on the plan, to the last bit: a batch of episodes is cut into at most 16
#' slices by a rule that does not look at workers, and each slice draws from a random stream of its
#' own. Only the library of linear algebra may make a difference on another machine;
#' [provenance()] names it, and one that differs is warned of.
#'
#' Each worker plays on a server of its own, which it starts when it is first needed, keeps, and
#' ends when it ends itself; the variable `GYM_SERVER_URL` on the worker, with the token's variable,
#' names another one (see [gym_client()]). The worker's sub-environments run in that one process
#' unless `num_workers` asks for more, so that cores are not used twice.
#'
#' What cannot be sent is played in the session, which is said once: an environment that was given
#' as an object, or by a client other than the session's own; wrappers that remember something over
#' episodes; episodes whose frames are kept; agents that learn from each step; a policy with a
#' connection or a pointer. Plans whose workers end after each future (`multicore`, those of
#' batchtools) train whole seeds only.
#'
#' Where the package progressr is loaded its handlers are told of the progress.
#'
#' Set `options(socketOptions = "no-delay")` before the plan, above all where a batch takes less
#' than a second: without it, R waits some 40 ms for an acknowledgement in the middle of every
#' message to a worker that has more than a few thousand bytes.
#'
#' @section A worker that is lost:
#' When a worker dies, its server fails, or it is silent for longer than the option
#' `gym.batch_deadline` (seconds; by default ten times as long as the slowest part of a batch so
#' far, and at least 60), its part is played by another one, with a warning of class
#' `gym_warning_worker` that names the host; the third time the session plays it. When the plan
#' takes no more futures the session plays on by itself; `future::plan("sequential")` and then a
#' plan with new workers end that. Since version 1.40 the package future starts another worker in
#' the place of one that died, where it can. The result is the same in all cases. A training of a
#' seed has no deadline.
#'
#' @section Errors: `gym_error_worker` where a worker lacks the package, or has another version of
#'   it or of Gymnasium; the element `host` names the worker's machine. An error on a worker is the
#'   call's own error, with the element `host`.
#' @references H. Bengtsson (2021): A Unifying Framework for Parallel and Distributed Processing in
#'   R using Futures. The R Journal 13(2), <https://doi.org/10.32614/RJ-2021-048>.
#' @seealso `vignette("scaling")`; `system.file("examples/slurm.R", package = "gym")`, for a cluster
#'   with a queue.
#' @name workers
#' @examplesIf gym:::can_start_server() && requireNamespace("future", quietly = TRUE)
#' future::plan(future::multisession, workers = 2)
#' rollout("Acrobot-v1", policy_random(), episodes = 20, max_steps = 50, seed = 1)
#' future::plan(future::sequential)
NULL

# Whether tasks can go to the workers of the plan: "none" without a plan, "kept" where a worker
# lives on between futures, "short" where each future has a process of its own.
plan_kind <- function() {
  if (!"future" %in% loadedNamespaces()) {
    return("none")
  }
  plan <- future::plan("next")
  local <- inherits(plan, c("multisession", "mirai_multisession"))
  alone <- local && future::nbrOfWorkers() == 1L
  if (inherits(plan, "sequential") || alone || is_broken_plan()) {
    "none"
  } else if (inherits(plan, c("cluster", "multisession", "mirai_cluster", "mirai_multisession"))) {
    "kept"
  } else {
    "short"
  }
}

# Which workers the plan has: the same call of plan() may have started new ones. Since future 1.40
# a plan has a backend with an id of its own.
plan_workers <- function() {
  plan <- future::plan("next")
  backend <- attr(plan, "backend", exact = TRUE)
  if (!is.null(backend)) {
    return(backend$uuid %||% backend$reg)
  }
  workers <- tryCatch(plan(NULL, lazy = TRUE)$workers, error = function(cnd) NULL)
  attr(workers, "name", exact = TRUE) %||% plan
}

is_broken_plan <- function() {
  !is.null(the_session$broken_plan) && identical(plan_workers(), the_session$broken_plan)
}

inform_plays_here <- function(reason, hint = NULL) {
  rlang::inform(
    c(i = paste0("The workers of the plan are not used here: ", reason, "."), i = hint),
    class = "gym_message_plays_here", .frequency = "once",
    .frequency_id = paste("gym_plays_here", reason)
  )
}

# Does something refer to a connection, a pointer or anything else that only this process has?
refers_to_process <- function(x) {
  found <- FALSE
  serialize(x, NULL, refhook = function(part) {
    if (typeof(part) == "externalptr") found <<- TRUE
    NULL
  })
  found
}

# Can batches go to workers? Says why not where there are some.
plays_on_workers <- function(vector_env, policy_of, learner) {
  kind <- plan_kind()
  if (kind == "none") {
    return(FALSE)
  }
  if (kind == "short") {
    inform_plays_here(
      "they end after each future, and a batch is too short for that",
      "`train_agent(seeds = )` gives each worker a training of its own."
    )
  } else if (!is.null(learner)) {
    inform_plays_here("a learner learns from each step before it takes the next one")
  } else if (!is.list(vector_env$recipe)) {
    inform_plays_here(vector_env$recipe %||% "the environment cannot be made there")
  } else if (refers_to_process(policy_of(1L))) {
    inform_plays_here("the policy has a connection or a pointer, which cannot be sent")
  } else {
    return(TRUE)
  }
  FALSE
}

# Batches --------------------------------------------------------------------------------

#' Play all batches of a history on workers
#' @inheritParams play_batches
#' @noRd
play_in_futures <- function(vector_env, history, policy_of, report, target = NULL, ...) {
  open <- list()
  waiting <- list()
  arguments <- list(...)
  enter_finished <- function() {
    while (length(open) && open[[1L]]$left == 0L) {
      first <- open[[1L]]
      whole <- bind_parts(first$batch, first$parts, first$played, target)
      whole$candidate <- first$candidates[whole$candidate]
      suspendInterrupts(enter_batch(history, whole))
      open <<- open[-1L]
    }
  }
  next_part <- function() {
    if (!length(waiting)) {
      batch <- next_batch(vector_env, history)
      if (is.null(batch)) {
        return(NULL)
      }
      one <- open_batch(batch, policy_of)
      open <<- c(open, list(one))
      waiting <<- lapply(seq_along(one$parts), function(i) list(one = one, i = i))
    }
    first <- waiting[[1L]]
    waiting <<- waiting[-1L]
    one <- first$one
    task <- slices_task(vector_env, one, first$i, arguments)
    list(
      task = task,
      here = function() {
        rlang::exec(play_batch, vector_env, task$policy, !!!task$part, !!!task$arguments)
      },
      done = function(played) {
        own <- one$parts[[first$i]]$episodes$candidate
        played$candidate <- unique(own)[played$candidate]
        one$played[[first$i]] <- played
        one$left <- one$left - 1L
        enter_finished()
        report(sum(vapply(open, ended_episodes, 0)))
      }
    )
  }
  do_tasks(next_part, slice_deadline, vector_env$call)
}

ended_episodes <- function(one) sum(vapply(one$played, function(x) length(x$episode), 0))

# A batch whose slices are being played, a part of them by each worker.
open_batch <- function(batch, policy_of) {
  candidates <- unique(batch$episodes$candidate)
  batch$episodes$candidate <- match(batch$episodes$candidate, candidates)
  shares <- share_slices(length(batch$streams), future::nbrOfWorkers())
  parts <- lapply(unname(shares), slices_of, batch = batch)
  rlang::env(
    batch = batch, candidates = candidates, policy = policy_of(candidates), parts = parts,
    num_envs = max(vapply(parts, function(part) length(part$slice), 0L)),
    played = vector("list", length(parts)), left = length(parts)
  )
}

slices_task <- function(vector_env, one, i, arguments) {
  part <- one$parts[[i]]
  part$at <- NULL
  candidates <- unique(part$episodes$candidate)
  part$episodes$candidate <- match(part$episodes$candidate, candidates)
  num_envs <- if (vector_env$one_seed) vector_env$num_envs else one$num_envs
  recipe <- vector_env$recipe
  recipe$one_seed <- vector_env$one_seed
  new_worker_task(
    "slices", recipe, server_versions(vector_env$client), part = part, num_envs = num_envs,
    policy = keep_candidates(one$policy, candidates), arguments = arguments
  )
}

# After how many seconds a worker that plays a slice counts as lost.
slice_deadline <- function(slowest) {
  getOption("gym.batch_deadline") %||% max(60, 10 * slowest)
}
