# Tasks for the workers of the plan set with future::plan(). Each task is a future. There are never
# more futures than free workers. The result of a task does not depend on the worker, so a lost task
# can be done again. Results are combined in the order of the tasks.
#
# If a future has failed, R never asks for its value again. The package future before 1.40 then
# counts the worker as busy and gives it nothing more. Later versions start another worker in its
# place.

most_tries <- 3L

#' Do tasks on the workers of the plan
#'
#' @param next_task A function that returns the next task, `NULL` after the last one: a list with
#'   `task`, the data to send, `here`, a function that does it in this session, and `done`, a
#'   function of its value.
#' @param deadline A function of the seconds of the slowest task so far, which returns the seconds
#'   after which a worker counts as lost.
#' @param call The call that errors name.
#' @noRd
do_tasks <- function(next_task, deadline, call) {
  # R checks a future only when its worker has sent something, so future need not wait.
  old <- options(future.resolved.timeout = 0)
  on.exit(options(old))
  crew <- rlang::env(
    running = list(), again = list(), slowest = 0, next_task = next_task, ended = FALSE,
    broken = FALSE, deadline = deadline, call = call
  )
  on.exit(add = TRUE, {
    left <- lapply(crew$running, `[[`, "future")
    the_session$left_futures <- c(the_session$left_futures, left)
  })
  repeat {
    launch_tasks(crew)
    if (!length(crew$running)) {
      if (crew$ended && !length(crew$again)) break
      do_here(crew)
    }
    ready <- await_workers(crew)
    for (number in rev(seq_along(crew$running))) look_at(crew, number, number %in% ready)
  }
}

#' Do numbered tasks on the workers, and enter their values in this order
#' @param task A function of a number, which returns the data to send.
#' @param enter A function of a task's value, called when all values before it were entered.
#' @param here A function that does a task in this session.
#' @param report A function that is called after each task, with the values that wait for their
#'   turn.
#' @noRd
do_in_order <- function(count, task, enter, deadline, call, here = run_task,
                        report = function(waiting) NULL) {
  sent <- entered <- 0L
  values <- vector("list", count)
  next_task <- function() {
    if (sent == count) {
      return(NULL)
    }
    sent <<- number <- sent + 1L
    own <- task(number)
    list(
      task = own, here = function() here(own),
      done = function(value) {
        values[[number]] <<- value
        while (entered < count && !is.null(values[[entered + 1L]])) {
          entered <<- entered + 1L
          enter(values[[entered]])
        }
        report(values[seq_len(count) > entered])
      }
    )
  }
  do_tasks(next_task, deadline, call)
}

# The longest time, in seconds, between two checks of the deadlines, and between two checks of a
# future without a deadline.
longest_wait <- 0.5
longest_wait_without_deadline <- 10

# Waits until a worker has sent something, and returns the numbers of tasks that may be ready.
# Polling future would use a core that a local worker needs, so this sleeps on the workers'
# connections. From time to time it returns all tasks, because future may have read an answer
# itself.
await_workers <- function(crew) {
  if (!length(crew$running)) {
    return(integer())
  }
  ready <- select_workers(crew$running)
  if (is.null(ready)) {
    # Sleep for a hundredth of the time since the last task was sent.
    waited <- now() - max(vapply(crew$running, function(one) one$started, 0))
    has_deadline <- is.finite(crew$deadline(crew$slowest))
    longest <- if (has_deadline) longest_wait else longest_wait_without_deadline
    Sys.sleep(min(longest, max(0.002, waited / 100)))
  }
  if (any(ready)) which(ready) else seq_along(crew$running)
}

# `NULL` if a worker's connection is unknown.
select_workers <- function(running) {
  # The sockets by which the workers answer, if they are known.
  connections <- lapply(running, function(one) {
    connection <- worker_node(one$future)$con
    is_open <- inherits(connection, "sockconn") &&
      tryCatch(isOpen(connection), error = function(cnd) FALSE)
    if (is_open) connection
  })
  if (!any(vapply(connections, is.null, NA))) {
    tryCatch(socketSelect(connections, FALSE, longest_wait), error = function(cnd) NULL)
  }
}

# Since future 1.40 the workers belong to the future's backend.
worker_node <- function(future) {
  workers <- future$backend$workers %||% future$workers
  if (is.list(workers) && !is.null(future$node)) workers[[future$node]]
}

# Futures of an interrupted call keep their workers busy until somebody takes their values. Do not
# take those that were cancelled with their plan: future would start workers for them.
collect_left_futures <- function() {
  is_under_way <- function(future) {
    identical(future$state, "running") &&
      !isTRUE(tryCatch(future::resolved(future), error = function(cnd) FALSE))
  }
  the_session$left_futures <- Filter(is_under_way, the_session$left_futures)
}

# Returns the next task: first the lost ones, then a new one.
take_task <- function(crew) {
  if (length(crew$again)) {
    one <- crew$again[[1L]]
    crew$again <- crew$again[-1L]
    return(one)
  }
  if (crew$ended) {
    return(NULL)
  }
  one <- crew$next_task()
  crew$ended <- is.null(one)
  if (!is.null(one)) one$tries <- 0L
  one
}

launch_tasks <- function(crew) {
  collect_left_futures()
  while (!crew$broken && free_workers() > 0 && !is.null(one <- take_task(crew))) {
    one$tries <- one$tries + 1L
    one$future <- tryCatch(launch(one$task), error = function(cnd) cnd)
    if (inherits(one$future, "condition")) {
      crew$broken <- TRUE
      the_session$broken_plan <- plan_workers()
      warn_of_workers(paste0(
        "The plan accepts no more futures (", first_message_line(one$future),
        "): the session continues alone."
      ), "Set `future::plan(\"sequential\")` and then your plan again, to go on with workers.")
      crew$again <- c(list(one), crew$again)
    } else {
      one$started <- now()
      crew$running <- c(crew$running, list(one))
    }
  }
}

free_workers <- function() tryCatch(future::nbrOfFreeWorkers(), error = function(cnd) 0)

# Called between batches, when all remaining workers of the plan are free.
workers_note <- function() {
  if (plan_kind() == "kept") paste0(count_of(free_workers(), "worker"), ", ")
}

# The first sentence of a message, because messages of future are long.
first_message_line <- function(cnd) {
  line <- c(strsplit(cnd$message %||% "", "\n", fixed = TRUE)[[1L]], "")[[1L]]
  sub("[.] [A-Z].*", "", line)
}

# Sends the task as bytes. The worker decodes them only after it has found the package.
launch <- function(task) {
  run <- function(bytes) {
    if (!requireNamespace("gym", quietly = TRUE)) {
      return(list(lacks = TRUE, host = Sys.info()[["nodename"]]))
    }
    utils::getFromNamespace("do_task", "gym")(unserialize(bytes))
  }
  environment(run) <- baseenv()
  future::future(
    quote(run(bytes)), substitute = FALSE, seed = NULL, lazy = FALSE,
    globals = list(run = run, bytes = serialize(task, NULL)), label = "gym"
  )
}

# Does a task in this session if there is no worker for it.
do_here <- function(crew) {
  if (!crew$broken && crew$slowest == 0 && !length(crew$again)) {
    inform_plays_here("none of them is free, or alive")
  }
  one <- take_task(crew)
  if (!is.null(one)) one$done(one$here())
}

# Checks a running task, which may be `ready`. After its deadline it counts as lost.
look_at <- function(crew, number, ready) {
  one <- crew$running[[number]]
  seconds <- now() - one$started
  state <- tryCatch(
    if (ready && future::resolved(one$future)) future::value(one$future),
    error = function(cnd) list(failed = first_message_line(cnd))
  )
  if (is.null(state)) {
    if (seconds <= crew$deadline(crew$slowest)) {
      return(invisible())
    }
    state <- list(failed = paste("it has been silent for", seconds_text(seconds)))
    the_session$left_futures <- c(the_session$left_futures, list(one$future))
  }
  crew$running[[number]] <- NULL
  if (!is.null(state$value)) {
    crew$slowest <- max(crew$slowest, seconds)
    warn_of_blas(state)
    one$done(state$value)
  } else {
    task_failed(crew, one, state)
  }
}

task_failed <- function(crew, one, state) {
  if (isTRUE(state$lacks)) {
    gym_abort(
      c(paste0("A worker on ", state$host, " lacks the package gym."),
        i = "Install it there, in the version that the session has."),
      class = "gym_error_worker", host = state$host, call = crew$call
    )
  }
  if (!is.null(state$error) && !isTRUE(state$lost)) {
    error <- state$error
    error["call"] <- list(rlang::error_call(crew$call))
    error$host <- state$host
    stop(error)
  }
  # The plan may not know the worker's host.
  host <- state$host %||% worker_node(one$future)$host %||% "an unknown host"
  reason <- state$failed %||% first_message_line(state$error)
  last <- one$tries >= most_tries
  warn_of_workers(
    paste0("A worker on ", host, " was lost (", reason, "): its batch is played ",
           if (last) "here." else "by another one.")
  )
  one$future <- NULL
  if (last) {
    one$done(one$here())
  } else {
    crew$again <- c(crew$again, list(one))
  }
}

warn_of_workers <- function(text, hint = NULL) {
  rlang::warn(c(text, i = hint), class = "gym_warning_worker")
}

# Results may differ in the last bits with another library of linear algebra.
warn_of_blas <- function(state) {
  own <- extSoftVersion()[["BLAS"]]
  if (!identical(basename(state$BLAS), basename(own)) && is.null(the_session$warned_of_blas)) {
    the_session$warned_of_blas <- TRUE
    rlang::warn(
      c(paste0("A worker on ", state$host, " calculates with another library of linear algebra (",
               state$BLAS, ") than the session (", own, ")."),
        i = "Results may differ in their last bits from those of the session alone."),
      class = "gym_warning_blas"
    )
  }
}
