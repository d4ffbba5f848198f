# Errors about what the functions of wrappers return.

# Columns in another order would get each other's names.
check_names_order <- function(transform, space, observation) {
  given <- colnames(observation) %||% names(observation)
  if (!is.null(given) && setequal(given, space$names) && !identical(given, space$names)) {
    abort_transform(
      transform, paste0("returned ", few_names(given), " for observations with the numbers ",
                        few_names(space$names)),
      observation, fix = "If their order is to change, give the new `observation_space`."
    )
  }
}

refuse_misfit <- function(transform, space, value, n, arg, given) {
  tryCatch(
    check_batch(space, batch_space(space, n), value, n, NULL, bounds = TRUE),
    gym_error_space = function(cnd) {
      abort_transform(
        transform,
        paste0("must return ", count_of(n, sub("_space", "", arg)), " of ", format(space), ", not ",
               describe_argument(value), ": ", sub("[.]$", "", first_line(cnd))),
        value, parent = cnd, class = "gym_error_space",
        fix = if (arg == "observation_space" && is.null(given)) {
          "If it changes the space of observations, give the new one as `observation_space`."
        }
      )
    }
  )
}

abort_transform <- function(transform, problem, value = NULL, class = "gym_error_argument",
                            fix = NULL, ...) {
  gym_abort(
    c(paste0("`func` of ", transform$wrapper, " ", problem, "."), i = fix, i = transform$hint),
    class = c("gym_error_wrapper", class), wrapper = transform$wrapper, argument = "func",
    value = value, ..., call = NULL
  )
}

transform_hint <- function(asked, space) {
  rows <- if ("observation" %in% asked && length(space$shape) == 1L) {
    name <- if (is.null(space$names)) 1L else paste0("\"", space$names[[1L]], "\"")
    paste0(": `observation[, ", name, "]` has a number for each, `observation[1]` only one")
  }
  paste0("It gets a batch, with a row for each sub-environment", rows,
         "; `ifelse()` chooses for each, `if` cannot.")
}
