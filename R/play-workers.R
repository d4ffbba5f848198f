# Playing on the workers of the plan set with future::plan(): whether it is possible, and how a
# batch that R plays becomes a task (play-futures.R). Play beside the environment is sent as lists
# of episodes (play-beside.R).

#' Play on many cores and machines
#'
#' Set a plan of the package future, such as `future::plan(future::multisession, workers = 8)` or
#' `future::plan(future::cluster, workers = c("host1", "host2"))`. Its workers then play the
#' episodes of [rollout()], [evaluate_policy()], [search_random()] and the other searches,
#' [train_agent()] and [gym_objective()]. `train_agent(seeds = )` gives each
#' worker whole trainings. You need not change any call, and nothing changes without a plan.
#'
#' Results do not depend on the plan, to the last bit. A worker gets a list of episodes, or a batch
#' of them if R plays step by step (see [rollout()]), and their results do not depend on who plays
#' them. On another kind of machine the library of linear algebra, NumPy or the processor may change
#' the last bits. [provenance()] names them, and a different library gives a warning.
#'
#' Each worker plays on its own server, which it starts on first use and stops when it ends. The
#' variable `GYM_SERVER_URL` on the worker, with the token's variable, selects another one (see
#' [gym_client()]). To avoid overloading the cores, that server plays episodes in as many processes
#' as future gives the worker cores, normally one. In step-by-step play it runs the sub-environments
#' in its own process, unless `num_workers` asks for more.
#'
#' Functions, such as a policy or that of a wrapper, travel with what they use of the session: its
#' variables, other functions and attached packages.
#'
#' The session itself plays what it cannot send, and says so once: an environment given as an
#' object, or by a client other than the session's own; wrappers that remember something over
#' episodes; episodes with frames; agents that learn from each step; a policy, or a wrapper's
#' function, with a connection or a pointer. Plans whose workers end after each future (`multicore`,
#' those of batchtools) train whole seeds only.
#'
#' If the package progressr is loaded, its handlers show the progress.
#'
#' Set `options(socketOptions = "no-delay")` before the plan, especially if a batch takes less than
#' a second. Otherwise R waits some 40 ms for an acknowledgement in each message to a worker that
#' has more than a few thousand bytes.
#'
#' @section If a worker is lost:
#' A worker is lost if it dies, its server fails, or it is silent for longer than the option
#' `gym.batch_deadline` (in seconds; by default ten times the slowest part of a batch so far, and at
#' least 60). Another worker then plays its part, with a warning of class `gym_warning_worker` that
#' names the host. The third time the session plays it. If the plan accepts no more futures, the
#' session continues alone; set `future::plan("sequential")` and then a plan with new workers to
#' change that. Since version 1.40 the package future replaces a dead worker if it can. The result
#' is the same in all cases. The training of a seed has no deadline.
#'
#' @section Errors: `gym_error_worker` if a worker lacks the package, or has another version of it
#'   or of Gymnasium; the field `host` names the worker's machine. An error on a worker is the
#'   call's own error, with the field `host`.
#' @references H. Bengtsson (2021): A Unifying Framework for Parallel and Distributed Processing in
#'   R using Futures. The R Journal 13(2), \doi{10.32614/RJ-2021-048}.
#' @seealso `vignette("scaling")`; `system.file("examples/slurm.R", package = "gym")`, for a cluster
#'   with a queue.
#' @name workers
#' @examplesIf gym:::can_start_server() && requireNamespace("future", quietly = TRUE)
#' future::plan(future::multisession, workers = 2)
#' rollout("Acrobot-v1", policy_random(), episodes = 20, max_steps = 50, seed = 1)
#' future::plan(future::sequential)
NULL

# Whether the plan's workers accept tasks: "none" without a plan, "kept" if a worker lives on
# between futures, "short" if each future has its own process.
plan_kind <- function() {
  if (!"future" %in% loadedNamespaces()) {
    return("none")
  }
  plan <- future::plan("next")
  local <- inherits(plan, c("multisession", "mirai_multisession"))
  alone <- local && future::nbrOfWorkers() == 1L
  broken <- !is.null(the_session$broken_plan) && identical(plan_workers(), the_session$broken_plan)
  if (inherits(plan, "sequential") || alone || broken) {
    "none"
  } else if (inherits(plan, c("cluster", "multisession", "mirai_cluster", "mirai_multisession"))) {
    "kept"
  } else {
    "short"
  }
}

# The workers of the plan: the same call of plan() may have started new ones. Since future 1.40 a
# plan has a backend with its own id.
plan_workers <- function() {
  plan <- future::plan("next")
  backend <- attr(plan, "backend", exact = TRUE)
  if (!is.null(backend)) {
    return(backend$uuid %||% backend$reg)
  }
  workers <- tryCatch(plan(NULL, lazy = TRUE)$workers, error = function(cnd) NULL)
  attr(workers, "name", exact = TRUE) %||% plan
}

inform_plays_here <- function(reason, hint = NULL) {
  rlang::inform(
    c(i = paste0("The workers of the plan are not used here: ", reason, "."), i = hint),
    class = "gym_message_plays_here", .frequency = "once",
    .frequency_id = paste("gym_plays_here", reason)
  )
}

# Does an object, or what its functions use, refer to a connection, a pointer or anything else that
# only this process has?
refers_to_process <- function(x) {
  found <- FALSE
  used <- if (plan_kind() != "none") session_objects(x)$objects
  serialize(list(x, used), NULL, refhook = function(part) {
    if (typeof(part) == "externalptr") found <<- TRUE
    NULL
  })
  found
}

inform_learner_plays_here <- function() {
  inform_plays_here("a learner learns from each step before it takes the next one")
}

# Can batches go to workers? If there are workers and it cannot, says why.
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
    inform_learner_plays_here()
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

#' Play all batches on workers
#'
#' Each batch is a task. Results are added in the order of the batches.
#' @param batches As returned by [draw_batches()].
#' @inheritParams play_batches
#' @noRd
play_in_futures <- function(vector_env, batches, history, policy_of, report, ...) {
  recipe <- vector_env$recipe
  recipe$one_seed <- vector_env$one_seed
  arguments <- list(...)
  task <- function(number) {
    batch <- batches[[number]]
    num_envs <- vector_env$num_envs
    if (!vector_env$one_seed) num_envs <- min(num_envs, length(batch$episodes$episode))
    # It contains only the candidates of the batch.
    policy <- policy_of(unique(batch$episodes$candidate))
    new_worker_task(
      "batch", recipe, server_versions(vector_env$client), num_envs = num_envs,
      part = c(list(policy = policy), batch, arguments)
    )
  }
  do_in_order(
    length(batches), task, function(played) suspendInterrupts(enter_batch(history, played)),
    batch_deadline, vector_env$call,
    here = function(task) rlang::exec(play_batch, vector_env, !!!task$part),
    report = function(waiting) report(sum(lengths(lapply(waiting, `[[`, "episode"))))
  )
}

# The seconds after which a worker with a task counts as lost.
batch_deadline <- function(slowest) {
  getOption("gym.batch_deadline") %||% max(60, 10 * slowest)
}
