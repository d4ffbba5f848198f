# The state of this R session, which all layers share:
#
#   pid             the process that loaded the package; a forked child finds its parent's here
#   servers         the servers that this session started, by their addresses
#   client          the client of the session's own server; named_client that of GYM_SERVER_URL
#   instances       the instances that this session has created on servers, see http-instances.R
#   messages        how many messages streams have sent, see http-stream.R
#   keys            the idempotency keys of this process, see keys_of_place()
#   environments    the environments written in R that are registered, by their ids
#   hidden          tokens, which errors must not show
#   reference_blas  whether R multiplies matrices by its own library, see has_reference_blas()
#
# and, if needed, addresses for which the user declined a server, and the function by which an upper
# layer asks about a server, see prompted_server_starts().
#
# It is an environment, so it is never identical to a copy that was read from a file or sent to
# another process. In this way a client notices that it is such a copy.
the_session <- new.env(parent = emptyenv())
the_session$servers <- list()
the_session$messages <- 0
the_session$environments <- list()
the_session$client <- NULL
the_session$instances <- new.env(parent = emptyenv())
the_session$reference_blas <- NULL

# The library of linear algebra -----------------------------------------------------------

# R's own library, the reference, has no file name (on Windows) or is Rblas. Debian's reference is
# libblas. A fast library may also be called libblas.so.3, in a folder with its own name.
is_reference_blas <- function(file) {
  !nzchar(file) || grepl("Rblas|/libblas[.]", file) && !grepl("openblas|atlas|blis", file)
}

# The library does not change during a session, so look once.
has_reference_blas <- function() {
  the_session$reference_blas %||% {
    the_session$reference_blas <- is_reference_blas(extSoftVersion()[["BLAS"]])
  }
}

# Programs --------------------------------------------------------------------------------

#' Start a process with its own tree id
#'
#' processx finds the children of a process by a tree id, which it derives from R's generator and
#' the current second. If the generator is restored or the user sets a seed, several processes could
#' have the same id, and killing one would kill the others. The generator is restored afterwards.
#' @param code Starts a process.
#' @noRd
with_own_tree_id <- function(code) {
  load_processx()
  keep_random_state({
    set.seed(NULL)
    code
  })
}

# processx and the package parallel both handle SIGCHLD, the signal that a child has ended. When
# processx is loaded, this variable tells it to pass the signal on. Otherwise parallel would wait,
# at the end of the session, for forked children that ended long ago.
load_processx <- function() {
  variable <- "PROCESSX_NOTIFY_OLD_SIGCHLD"
  if (!isNamespaceLoaded("processx") && !nzchar(Sys.getenv(variable))) {
    do.call(Sys.setenv, stats::setNames(list("true"), variable))
    on.exit(Sys.unsetenv(variable))
    loadNamespace("processx")
  }
}

# The session's time in seconds.
now <- function() proc.time()[["elapsed"]]

#' Wait for a process to end
#'
#' This polls the process, because `wait()` of processx takes SIGCHLD from the package parallel, see
#' [load_processx()].
#' @param seconds The longest time to wait.
#' @noRd
await_end <- function(process, seconds) {
  deadline <- now() + seconds
  while (process$is_alive() && now() < deadline) {
    Sys.sleep(0.01)
  }
}

#' Run a program and return its output
#'
#' R's generator is left as it was.
#' @param arguments A character vector.
#' @param timeout The time after which it is killed, in seconds.
#' @return A list: `status`, and the strings `stdout` and `stderr`. If the program could not be run
#'   or did not end in time, `status` is `NA` and the strings are empty.
#' @noRd
run_quietly <- function(command, arguments, timeout = 30, env = NULL) {
  silent <- list(status = NA_integer_, stdout = "", stderr = "")
  run <- with_own_tree_id(tryCatch(
    processx::run(
      command, arguments, timeout = timeout, env = env, error_on_status = FALSE,
      cleanup_tree = TRUE, windows_hide_window = TRUE
    ),
    error = function(cnd) silent
  ))
  if (isTRUE(run$timeout)) silent else run[c("status", "stdout", "stderr")]
}
