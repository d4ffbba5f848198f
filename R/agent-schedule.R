# Settings of an agent that change with the number of steps that it has taken.

#' Change a number while an agent learns
#'
#' Make a schedule for an agent's `epsilon`, `learning_rate` or `temperature`: a function of the
#' number of steps so far. You can also write such a function yourself.
#'
#' @param from,to The value in the first step, and the value after `duration` steps, where it stays.
#' @param duration The number of steps from `from` to `to`, a number of at least 1.
#' @return A function of a number of steps. `schedule_linear()` changes in equal amounts,
#'   `schedule_exponential()` by equal factors (both values must be above 0).
#' @section Errors: `gym_error_argument`.
#' @export
#' @examples
#' epsilon <- schedule_linear(1, 0.05, duration = 1000)
#' epsilon(c(0, 500, 2000))
schedule_linear <- function(from, to, duration) {
  check_number(from)
  check_number(to)
  check_number(duration, min = 1)
  new_schedule(from, to, duration, function(taken) {
    from + (to - from) * share_passed(taken, duration)
  })
}

#' @rdname schedule_linear
#' @export
schedule_exponential <- function(from, to, duration) {
  check_above_zero(from)
  check_above_zero(to)
  check_number(duration, min = 1)
  new_schedule(from, to, duration, function(taken) {
    from * (to / from)^share_passed(taken, duration)
  })
}

# Learners call this in each step. pmin() would take as long as the rest of the step.
share_passed <- function(taken, duration) {
  share <- taken / duration
  share[share > 1] <- 1
  share
}

# A checkpoint compares schedules by these numbers, not by the function's environment.
new_schedule <- function(from, to, duration, f) {
  structure(f, from = from, to = to, duration = duration, class = c("gym_schedule", "function"))
}

#' @export
print.gym_schedule <- function(x, ...) {
  print_lines(x, paste0("<schedule: from ", number_text(attr(x, "from")), " to ",
                        number_text(attr(x, "to")), " in ", count_of(attr(x, "duration"), "step"),
                        ">"))
}

# Use in agents -----------------------------------------------------------------------------

# At this temperature a softmax takes the best action. Lower ones are refused.
lowest_temperature <- 1e-12

check_schedules <- function(settings, names, min = 0, max = Inf, call = rlang::caller_env()) {
  for (name in names) {
    x <- settings[[name]]
    # An agent with a learning rate of 0 would learn nothing.
    is_rate <- endsWith(name, "learning_rate")
    fits <- is_number(x) && x >= min && x <= max && !(is_rate && x %in% c(0, Inf))
    if (!is.function(x) && !fits) {
      range <- range_text(min, max)
      if (is_rate) range <- paste0(" above 0", if (max == 1) " and at most 1")
      must <- paste0("a number", range, ", or a function of the steps so far")
      abort_argument(x, must, name, call)
    }
  }
}

# A user may choose the number 0. But a schedule that is always 0 is a mistake.
check_explores <- function(epsilon, call) {
  is_zero <- function(taken) isTRUE(tryCatch(epsilon(taken) == 0, error = function(cnd) FALSE))
  if (is.function(epsilon) && all(vapply(c(0, 10^(0:8)), is_zero, NA))) {
    abort_wrong(
      "epsilon", epsilon, call,
      "`epsilon` is a schedule that is 0 from the first step, so the agent never explores.",
      i = "Start above 0, as in `schedule_linear(1, 0.1, duration = 10000)`, or give 0."
    )
  }
}

scheduled <- function(x, taken, arg, min = 0, max = 1) {
  if (!is.function(x)) {
    return(x)
  }
  value <- x(taken)
  if (!is_number(value) || value < min || value > max) {
    abort_wrong(
      arg, value, NULL,
      "The function `{arg}` must return a number{range_text(min, max)}, and after
       {number_text(taken)} steps it returned {describe_argument(value)}."
    )
  }
  value
}

schedule_text <- function(x) if (is.function(x)) "scheduled" else number_text(x)
