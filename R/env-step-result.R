# Checks what a step returns of an environment that a user has written in R. It must keep to the
# same rules as the server's environments, which the server checks.

flags <- c("terminated", "truncated")

#' Take a step, and check what it returns where a user has written the environment
#' @param n How many sub-environments step.
#' @param ... The arguments of `env$step()`.
#' @noRd
take_step <- function(env, n, ...) {
  out <- env$step(...)
  if (!inherits(env, "gym_server_env")) {
    check_step_result(out, n)
  }
  out
}

check_step_result <- function(out, n, call = NULL) {
  if (!is.list(out)) {
    problem <- paste("`step()` of this environment must return a list, not", describe_argument(out))
    abort_step_result(problem, out, call)
  }
  absent <- setdiff(c("observation", "reward", flags), names(out))
  if (length(absent)) {
    has <- if (length(names(out))) paste0("; it has `", paste(names(out), collapse = "`, `"), "`")
    problem <- paste0("What `step()` of this environment returns lacks `", absent[[1L]], "`", has)
    abort_step_result(problem, out, call)
  }
  check_reward(out, n, call)
  for (flag in flags) {
    check_step_flag(out, flag, n, call)
  }
}

check_reward <- function(out, n, call) {
  if (length(out$reward) != n || !(is.numeric(out$reward) || is.logical(out$reward))) {
    abort_step_element("reward", if (n == 1L) "a number" else paste(n, "numbers"), out, call)
  }
}

check_step_flag <- function(out, flag, n, call) {
  if (!is.logical(out[[flag]]) || length(out[[flag]]) != n || anyNA(out[[flag]])) {
    must <- paste0("TRUE or FALSE", if (n != 1L) paste(" for each of", n, "sub-environments"))
    abort_step_element(flag, must, out, call)
  }
}

abort_step_element <- function(name, must, out, call) {
  problem <- paste0("The element `", name, "` of what `step()` of this environment returns must ",
                    "be ", must, ", not ", describe_argument(out[[name]]))
  abort_step_result(problem, out, call)
}

abort_step_result <- function(problem, out, call) {
  gym_abort(
    c(
      paste0(problem, "."),
      i = paste("It must be a list of `observation`, `reward`, `terminated` (the episode ended by",
                "the environment's own rules) and `truncated` (it was cut off, such as by a limit",
                "of steps).")
    ),
    class = "gym_error_argument", argument = "env", value = out, call = call
  )
}
