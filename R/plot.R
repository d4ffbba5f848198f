# plot() of a result prints the picture that autoplot() makes. Printing needs ggplot2's namespace,
# which is loaded by the first picture and not with this package.

show_picture <- function(x, ..., main = NULL, xlab = NULL, ylab = NULL, xlim = NULL, ylim = NULL) {
  arguments <- arguments_as_written(quote(x))
  # Results go as variables: a name such as `episode` would be taken for autoplot()'s argument.
  named <- vapply(arguments, is_comparable, NA)
  names(arguments) <- rlang::names2(arguments)
  names <- make.unique(names(arguments)[named], " ")
  results <- list2env(stats::setNames(arguments[named], names), parent = asNamespace("ggplot2"))
  arguments[named] <- lapply(names, as.name)
  names(arguments)[named] <- ""
  picture <- eval(as.call(c(quote(autoplot), arguments)), results)
  labels <- list(title = if (!is.null(main)) broken_text(main, 38), x = xlab, y = ylab)
  given <- c(!is.null(main), !is.null(xlab), !is.null(ylab))
  picture <- picture + rlang::exec(ggplot2::labs, !!!labels[given])
  if (!is.null(xlim) || !is.null(ylim)) {
    picture <- picture + ggplot2::coord_cartesian(xlim = xlim, ylim = ylim)
  }
  print(picture)
  invisible(picture)
}

#' Take the arguments of the function that calls this, each result with a name
#'
#' Results of which several can be compared have a name in the picture: that of the argument, of the
#' variable, or else a label of their own. What is given beside them needs a name.
#' @param first The function's first argument, a symbol. Like the others it may have another name,
#'   that of its row or line: then it is missing.
#' @noRd
arguments_as_written <- function(first, frame = rlang::caller_env(), call = frame) {
  listed <- as.call(c(quote(list), if (!eval(call("missing", first), frame)) first, quote(...)))
  values <- eval(listed, frame)
  if (!any(vapply(values, is_comparable, NA))) {
    return(values)
  }
  written <- as.list(eval(call("substitute", listed), frame))[-1L]
  names <- rlang::names2(values)
  for (i in which(!nzchar(names))) {
    if (!inherits(values[[i]], c("gym_rollout", "gym_training", "gym_trainings", "gym_searches"))) {
      must <- "a result as the others, or have a name, such as `type = `"
      abort_argument(values[[i]], must, "...", call)
    }
    variable <- is.name(written[[i]])
    names[[i]] <- if (variable) as.character(written[[i]]) else result_label(values[[i]])
  }
  stats::setNames(values, names)
}

is_comparable <- function(x) {
  inherits(x, c("gym_rollout", "gym_training", "gym_trainings")) && !inherits(x, "gym_search")
}

result_label <- function(x) {
  if (inherits(x, "gym_rollout")) policy_label(x$policy) else training_label(x)
}

training_label <- function(x) sub(":.*", "", format(x$agent))

#' Tell the results among the arguments of a picture from the others, of which there must be none
#' @return The results, a list with names.
#' @noRd
only_results <- function(values, class, call = rlang::caller_env()) {
  are <- vapply(values, inherits, NA, class)
  rlang::exec(check_dots_empty, !!!values[!are], call = call)
  stats::setNames(values[are], make.unique(rlang::names2(values)[are], " "))
}

#' @rdname plot.gym_bandit_learning
#' @export
plot.gym_bandit_learning <- show_picture

#' @rdname plot.gym_decision_map
#' @export
plot.gym_decision_map <- show_picture

#' @rdname plot.gym_frame
#' @export
plot.gym_frame <- show_picture

#' @rdname plot.gym_landscape
#' @export
plot.gym_landscape <- show_picture

#' @rdname plot.gym_policy_network
#' @export
plot.gym_policy <- show_picture

#' @rdname plot.gym_rollout
#' @export
plot.gym_rollout <- show_picture

#' @rdname plot.gym_search
#' @export
plot.gym_search <- show_picture

#' @rdname plot.gym_searches
#' @export
plot.gym_searches <- show_picture

#' @rdname plot.gym_solution
#' @export
plot.gym_solution <- show_picture

#' @rdname plot.gym_state_map
#' @export
plot.gym_state_map <- show_picture

#' @rdname plot.gym_training
#' @export
plot.gym_training <- show_picture

#' @rdname plot.gym_trainings
#' @export
plot.gym_trainings <- show_picture
