# Playing on the workers of the plan set with future::plan(): whether it is possible, and how a
# batch that R plays becomes a task (play-futures.R). If the server plays, tasks are lists of
# episodes (play-beside.R).

#' Play on many cores and machines
#'
#' Set a plan of the package future, such as `future::plan(future::multisession, workers = 8)` or
#' `future::plan(future::cluster, workers = c("host1", "host2"))`. Its workers then play the
#' episodes of [rollout()], [evaluate_policy()], [search_random()] and the other searches,
#' [train_agent()] and [gym_objective()]. `train_agent(seeds = )` gives each worker whole trainings.
#' You need not change any call. Without a plan, nothing changes.
#'
#' Results do not depend on the plan, to the last bit. A worker gets a list of episodes, or a batch
#' of them if R plays step by step (see [rollout()]), whose results are the same on every worker.
#' Only on another kind of machine, the library of linear algebra, NumPy or the processor may change
#' the last bits. [provenance()] lists these three, and another library of linear algebra gives a
#' warning.
#'
#' Each worker plays on its own server. The worker starts the server on first use, and stops it at
#' its own end. The environment variables `GYM_SERVER_URL` and `GYM_SERVER_TOKEN` on the worker
#' select another server (see [gym_client()]). To avoid overloading the cores, that server plays
#' episodes in as many processes as future gives the worker cores, normally one. In step-by-step
#' play it runs the sub-environments in its own process, unless `num_workers` asks for more.
#'
#' A function, such as a policy or the function of a wrapper, can use variables, other functions and
#' attached packages of the session: these are sent with it.
#'
#' The session itself plays what it cannot send, and says so once: an environment given as an
#' object, or made by a client other than the session's own; wrappers that remember earlier
#' episodes; episodes with frames; agents that learn from each step; a policy, or a wrapper's
#' function, with a connection or a pointer. With plans whose workers end after each future
#' (`multicore`, those of batchtools), workers only train whole seeds.
#'
#' If the package progressr is loaded, its handlers show the progress.
#'
#' Set `options(socketOptions = "no-delay")` before the plan, especially if a batch takes less than
#' a second. Otherwise each message of more than a few thousand bytes to a worker takes about 40 ms
#' longer, because R waits for an acknowledgement.
#'
#' @section If a worker is lost: A worker is lost if it dies, its server fails, or it is silent for
#' longer than the option `gym.batch_deadline` (in seconds; by default ten times as long as the
#' slowest task so far, and at least 60). Another worker then does its task, and a warning of class
#' `gym_warning_worker` names the host. After the third loss of a task, the session does it. If the
#' plan accepts no more futures, the session continues alone; set `future::plan("sequential")` and
#' then a plan with new workers to change that. Since version 1.40 the package future replaces a
#' dead worker if it can. The result is the same in all cases. The training of a seed has no
#' deadline.
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

# Whether the plan's workers accept tasks: "none" without a plan, "kept" if a worker stays alive
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

# Identifies the workers of the plan, because the same call of plan() may start new ones. Since
# future 1.40, a plan has a backend with its own id.
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

# Can batches go to workers? If there are workers that cannot play them, tells the user why.
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
    # The policy contains only the candidates of the batch.
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

# The worker's part ------------------------------------------------------------------------------

# A task arrives in one message and depends on nothing else. Between tasks, a worker keeps its
# vector environments, which are on its own server.

the_worker <- new.env(parent = emptyenv())
the_worker$kept <- list()
most_kept <- 4L

#' Describe an environment so that a worker can make the same one
#'
#' @param arguments The further arguments of [as_vector_env()].
#' @return A list; or a string with the reason why the environment cannot be sent.
#' @noRd
environment_recipe <- function(env, vector_env, arguments) {
  if (length(vector_env$remembers)) {
    return(paste(vector_env$remembers[[1L]], "remembers earlier episodes"))
  }
  if (!is.null(vector_env$frame)) {
    return("frames are kept")
  }
  given <- given_id(env)
  if (isTRUE(given$calls_r) && refers_to_process(env)) {
    return("the function of a wrapper has a connection or a pointer, which cannot be sent")
  }
  own <- setdiff(names(arguments), c("num_envs", "num_workers", "frames"))
  recipe <- list(env = env, arguments = arguments[own], num_workers = arguments$num_workers)
  if (isTRUE(given$registered)) {
    recipe$entry <- the_session$environments[given$id]
  } else if (!is.null(given)) {
    session <- list(the_session$client, the_session$named_client)
    if (!any(vapply(session, identical, NA, vector_env$client))) {
      return("it was made by a client that is not the session's own")
    }
  } else if (!inherits(env, "gym_model")) {
    return("it was given as an object, not by its id")
  }
  recipe
}

#' Make a task
#'
#' @param kind A kind that [run_task()] has a method for.
#' @param versions The versions of the session's server, see [server_versions()].
#' @noRd
new_worker_task <- function(kind, recipe, versions, ...) {
  gym <- as.character(utils::packageVersion("gym"))
  task <- list(gym = gym, versions = versions, recipe = recipe, ...)
  structure(c(task, list(session = session_objects(task))), class = paste0("gym_task_", kind))
}

#' Do a task
#'
#' @param task As made by [new_worker_task()].
#' @return A list: `value`, or `error` and whether the same task may succeed elsewhere (`lost`);
#'   `host`, `pid`, `seconds`, `BLAS`.
#' @noRd
do_task <- function(task) {
  started <- now()
  done <- tryCatch(
    {
      check_worker_version(task$gym, as.character(utils::packageVersion("gym")), "the package gym")
      the_session$environments[names(task$recipe$entry)] <- task$recipe$entry
      # The task's functions look for objects of the session in attached packages and globalenv().
      for (package in task$session$packages) {
        suppressPackageStartupMessages(library(package, character.only = TRUE))
      }
      list2env(task$session$objects, globalenv())
      # The worker's server plays with as many processes as future gives the worker cores, normally
      # one.
      the_session$cores <- parallelly::availableCores()[[1L]]
      # A forked child has its own server, which must end with the child.
      if (Sys.getpid() != the_session$pid) {
        parent <- mget(c("pid", "client", "servers"), the_session)
        list2env(list(pid = Sys.getpid(), client = NULL, servers = list()), the_session)
        on.exit({
          lapply(the_session$servers, stop_server)
          list2env(parent, the_session)
        })
      }
      list(value = run_task(task))
    },
    error = function(cnd) {
      forget_kept()
      cnd$trace <- NULL
      list(error = cnd, lost = inherits(cnd, "gym_error_connection"))
    }
  )
  c(done, list(
    host = Sys.info()[["nodename"]], pid = Sys.getpid(), BLAS = extSoftVersion()[["BLAS"]],
    seconds = now() - started
  ))
}

check_worker_version <- function(wanted, own, of) {
  if (!identical(wanted, own)) {
    gym_abort(
      c(paste0("Worker ", Sys.getpid(), " on ", Sys.info()[["nodename"]], " has ", of,
               " in version ", own %||% "unknown", ", and the session has ", wanted %||% "unknown",
               "."),
        i = "Install the same version on both."),
      class = "gym_error_worker", host = Sys.info()[["nodename"]]
    )
  }
}

check_worker_gymnasium <- function(task, client) {
  versions <- server_versions(client)
  if (!is.null(task$versions) && !is.null(versions)) {
    check_worker_version(task$versions$gymnasium, versions$gymnasium, "Gymnasium")
  }
}

# Does a task; its class selects the method.
run_task <- function(task) UseMethod("run_task")

#' @exportS3Method
run_task.gym_task_batch <- function(task) {
  rlang::exec(play_batch, kept_vector_env(task), !!!task$part)
}

# The worker's vector environment for a recipe, made on first use.
kept_vector_env <- function(task) {
  recipe <- task$recipe
  key <- rlang::hash(list(recipe, task$num_envs))
  kept <- the_worker$kept[[key]]
  client <- if (!is.null(kept$client)) gym_client()
  if (!is.null(kept) && identical(kept$client, client)) {
    return(kept)
  }
  if (length(the_worker$kept) >= most_kept) forget_kept()
  make <- function(...) rlang::exec(as_vector_env, recipe$env, ..., !!!recipe$arguments)
  num_envs <- task$num_envs
  made <- if (inherits(recipe$env, "gym_model") || is_registered(recipe$env)) {
    make(num_envs = num_envs)
  } else if (num_envs == 1L) {
    make(max_envs = 1L)
  } else {
    make(num_envs = num_envs, num_workers = recipe$num_workers %||% if (!recipe$one_seed) 0L)
  }
  check_worker_gymnasium(task, made$client)
  made$call <- quote(play_batch())
  the_worker$kept[[key]] <- made
  made
}

forget_kept <- function() {
  kept <- the_worker$kept
  the_worker$kept <- list()
  for (vector_env in kept) try(vector_env$close(wait = FALSE), silent = TRUE)
}

# Objects of the session ------------------------------------------------------------------

# Functions that go to a worker may use objects of the session: a number, another function, a
# package. Serialization does not include the global environment, so these objects are sent with the
# function.

#' Find what functions use from the global environment
#'
#' @param x Anything that contains functions: a policy, a recipe, the settings of a training.
#' @return A list: `objects`, a named list, and `packages`, the names of the packages to attach.
#' @noRd
session_objects <- function(x, found = list(objects = list(), packages = character())) {
  functions <- session_functions(x)
  if (!length(functions)) {
    return(found)
  }
  names(functions) <- paste0("function_", seq_along(functions))
  used <- future::getGlobalsAndPackages(
    as.call(c(quote(list), lapply(names(functions), as.name))),
    envir = list2env(functions, parent = globalenv())
  )
  names <- setdiff(intersect(names(used$globals), names(globalenv())), names(found$objects))
  objects <- mget(names, globalenv())
  found$packages <- union(found$packages, used$packages)
  found$objects <- c(found$objects, objects)
  # The objects may be or contain functions themselves.
  if (length(objects)) session_objects(objects, found) else found
}

# The functions in an object that were written in the session. Functions of packages are on the
# worker, too, but they may enclose functions of the session.
session_functions <- function(x, seen = rlang::env(list = list())) {
  if (is.function(x)) {
    if (is.primitive(x)) {
      NULL
    } else if (isNamespace(topenv(environment(x)))) {
      session_functions(environment(x), seen)
    } else {
      list(x)
    }
  } else if (is.environment(x)) {
    passed <- c(list(globalenv(), baseenv(), emptyenv()), seen$list)
    if (isNamespace(x) || any(vapply(passed, identical, NA, x))) {
      return(NULL)
    }
    seen$list <- c(seen$list, x)
    # An R6 class has the class that it inherits from as an expression.
    parent <- if (inherits(x, "R6ClassGenerator")) as.function(list(x$inherit), x$parent_env)
    inside <- c(list(parent, parent.env(x)), as.list.environment(x, all.names = TRUE))
    session_functions(inside, seen)
  } else if (is.list(x)) {
    x <- Filter(function(part) !rlang::is_missing(part), unclass(x))
    unlist(lapply(x, session_functions, seen), recursive = FALSE, use.names = FALSE)
  }
}
