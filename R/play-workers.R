# Playing on the workers of the plan that the user has set with future::plan(): whether it can be
# done, and what becomes of a batch that is played from R, which is a task (play-futures.R). What is
# played beside the environment travels as lists of episodes (play-beside.R).

#' Play on many cores and machines
#'
#' Where the user has set a plan of the package future, such as
#' `future::plan(future::multisession, workers = 8)` or
#' `future::plan(future::cluster, workers = c("host1", "host2"))`, its workers play the episodes of
#' [rollout()], [evaluate_policy()], [search_random()] and the other searches, [train_agent()],
#' [search_landscape()] and [gym_objective()]; `train_agent(seeds = )` gives each of them whole
#' trainings. Nothing else needs to be said, and nothing changes without a plan.
#'
#' Results do not depend on the plan, to the last bit: what a worker is given is a list of episodes,
#' or a batch of them where R plays step by step (see [rollout()]), and what comes of these does not
#' depend on who plays them. On another kind of machine the library of linear algebra, NumPy or the
#' processor may make a difference in the last bits; [provenance()] names them, and a library that
#' differs is warned of.
#'
#' Each worker plays on a server of its own, which it starts when it is first needed, keeps, and
#' ends when it ends itself; the variable `GYM_SERVER_URL` on the worker, with the token's variable,
#' names another one (see [gym_client()]). So that cores are not used twice, that server plays
#' episodes in as many processes as future gives the worker cores, normally one; and where R plays
#' step by step it runs the sub-environments in its own process, unless `num_workers` asks for more.
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

inform_learner_plays_here <- function() {
  inform_plays_here("a learner learns from each step before it takes the next one")
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
#' A task is a batch. They are entered in their order.
#' @param batches As [draw_batches()] returns them.
#' @inheritParams play_batches
#' @noRd
play_in_futures <- function(vector_env, batches, history, policy_of, report, ...) {
  sent <- entered <- 0L
  played <- vector("list", length(batches))
  enter <- function() {
    while (entered < sent && !is.null(played[[entered + 1L]])) {
      suspendInterrupts({
        entered <<- entered + 1L
        enter_batch(history, played[[entered]])
      })
    }
  }
  next_task <- function() {
    if (sent == length(batches)) {
      return(NULL)
    }
    sent <<- sent + 1L
    number <- sent
    task <- batch_task(vector_env, batches[[number]], policy_of, list(...))
    list(
      task = task,
      here = function() rlang::exec(play_batch, vector_env, !!!task$part),
      done = function(batch) {
        played[[number]] <<- batch
        enter()
        report(sum(lengths(lapply(played[seq_len(sent)[-seq_len(entered)]], `[[`, "episode"))))
      }
    )
  }
  do_tasks(next_task, batch_deadline, vector_env$call)
}

# The policy of a batch has its candidates alone.
batch_task <- function(vector_env, batch, policy_of, arguments) {
  recipe <- vector_env$recipe
  recipe$one_seed <- vector_env$one_seed
  num_envs <- vector_env$num_envs
  if (!vector_env$one_seed) num_envs <- min(num_envs, length(batch$episodes$episode))
  policy <- policy_of(unique(batch$episodes$candidate))
  new_worker_task(
    "batch", recipe, server_versions(vector_env$client), num_envs = num_envs,
    part = c(list(policy = policy), batch, arguments)
  )
}

# After how many seconds a worker that plays a task counts as lost.
batch_deadline <- function(slowest) {
  getOption("gym.batch_deadline") %||% max(60, 10 * slowest)
}
