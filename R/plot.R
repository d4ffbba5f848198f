# plot() of a result prints the picture made by autoplot(). Printing needs ggplot2's namespace,
# which is loaded by the first picture and not with this package.

show_picture <- function(x, ..., main = NULL, xlab = NULL, ylab = NULL, xlim = NULL, ylim = NULL,
                         guide = NULL) {
  arguments <- arguments_as_written(quote(x))
  # Results are passed as variables that know their names: an argument with a name such as `episode`
  # would be taken for one of autoplot().
  named <- which(vapply(arguments, is_comparable, NA))
  names(arguments) <- rlang::names2(arguments)
  labelled <- Map(structure, arguments[named], label = names(arguments)[named])
  names <- paste0("result", named, recycle0 = TRUE)
  results <- list2env(stats::setNames(labelled, names), parent = asNamespace("ggplot2"))
  arguments[named] <- lapply(names, as.name)
  names(arguments)[named] <- ""
  picture <- naming_own_call(eval(as.call(c(quote(autoplot), arguments)), results), "autoplot")
  labels <- Filter(Negate(is.null), list(x = xlab, y = ylab))
  picture <- picture + ggplot2::labs(!!!do.call(axis_labels, labels))
  if (!is.null(main)) picture <- picture + ggplot2::labs(title = broken_text(main, 38))
  if (!is.null(guide)) {
    must <- "\"none\" or NULL"
    if (!identical(guide, "none")) abort_argument(guide, must, "guide", rlang::current_env())
    picture <- picture + ggplot2::theme(legend.position = "none")
  }
  if (!is.null(xlim) || !is.null(ylim)) {
    picture <- picture + ggplot2::coord_cartesian(xlim = xlim, ylim = ylim)
  }
  print(picture)
  invisible(picture)
}

#' @rdname plot.gym_bandit_learning
#' @export
plot.gym_bandit_learning <- show_picture

#' @rdname plot.gym_comparison
#' @export
plot.gym_comparison <- show_picture

#' @rdname plot.gym_decision_map
#' @export
plot.gym_decision_map <- show_picture

#' @rdname plot.gym_evaluation
#' @export
plot.gym_evaluation <- show_picture

#' @rdname plot.gym_frame
#' @export
plot.gym_frame <- show_picture

#' @rdname plot.gym_policy_network
#' @export
plot.gym_policy <- show_picture

#' @rdname plot.gym_rollout
#' @export
plot.gym_rollout <- show_picture

#' @rdname plot.gym_search
#' @export
plot.gym_search <- show_picture

#' @rdname plot.gym_solution
#' @export
plot.gym_solution <- show_picture

#' @rdname plot.gym_state_map
#' @export
plot.gym_state_map <- show_picture

#' @rdname sweep_agent
#' @export
plot.gym_sweep <- show_picture

#' @rdname plot.gym_training
#' @export
plot.gym_training <- show_picture

#' @rdname plot.gym_trainings
#' @export
plot.gym_trainings <- show_picture
