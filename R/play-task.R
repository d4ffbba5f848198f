# The worker's part: a task arrives in one message and depends on nothing else.
#
# A worker keeps its vector environments between tasks, on its own server, which ends with it.

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
  if (calls_r(env) && refers_to_process(env)) {
    return("the function of a wrapper has a connection or a pointer, which cannot be sent")
  }
  own <- setdiff(names(arguments), c("num_envs", "num_workers", "frames"))
  recipe <- list(env = env, arguments = arguments[own], num_workers = arguments$num_workers)
  if (is_registered(env)) {
    recipe$entry <- the_session$environments[bare_id(env)]
  } else if (is_given_by_id(env)) {
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
#' @param versions Those of the server.
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
      # Where the task's functions look for objects of the session.
      for (package in task$session$packages) {
        suppressPackageStartupMessages(library(package, character.only = TRUE))
      }
      list2env(task$session$objects, globalenv())
      # As many processes play beside the environment as future gives the worker cores: normally
      # one.
      the_session$cores <- parallelly::availableCores()[[1L]]
      # A forked child has its own server, too, which must not outlive it.
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

# Does a task by its class. The worker has the right package.
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

# Functions that go to a worker use objects of the session: a number, another function, a package.
# Serialized functions leave the global environment behind, so its objects travel beside them.

#' Find what functions use from the global environment
#'
#' @param x Anything that contains functions: a policy, a recipe, the settings of a training.
#' @return A list: `objects`, a list with names, and `packages`, the names of those to attach.
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
  # These may contain functions themselves, such as a list of them.
  if (length(objects)) session_objects(objects, found) else found
}

# The functions in an object that were written in the session. Those of packages are on the worker,
# too, but may have been made from functions of the session.
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
    # A class of R6 names the one that it inherits from in an expression.
    parent <- if (inherits(x, "R6ClassGenerator")) as.function(list(x$inherit), x$parent_env)
    inside <- c(list(parent, parent.env(x)), as.list.environment(x, all.names = TRUE))
    session_functions(inside, seen)
  } else if (is.list(x)) {
    x <- Filter(function(part) !rlang::is_missing(part), unclass(x))
    unlist(lapply(x, session_functions, seen), recursive = FALSE, use.names = FALSE)
  }
}
