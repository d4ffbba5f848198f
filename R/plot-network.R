#' Plot a network
#'
#' Draw the diagram of a network: its layers from left to right, neurons as circles, weights as
#' lines. A line is wider the further its weight is from 0. Positive weights are blue; negative ones
#' are gold and dashed. The last circle of a layer may have a 1 in it: the weights from there are
#' the biases. If there are few weights, their numbers are written on the lines. Dots stand for
#' neurons that are left out of a large layer.
#'
#' If the policy was played in an environment, or if you give `env`, inputs have the names of the
#' observation's parts, and outputs have the names of the actions.
#'
#' `autoplot()` returns a ggplot, to which you can add scales, themes and layers. `plot()` also
#' prints it.
#'
#' @inheritParams plot.gym_rollout
#' @param x,object A network, made by [policy_network()].
#' @param env The environment: an id, such as `"CartPole-v1"`, the result of [gym_wrap()], or an
#'   environment made by [gym_make()]. `NULL`, the default, is the environment in which the policy
#'   was played.
#' @param neurons The largest number of neurons to draw in a layer, a whole number of at least 3.
#'   The default is 12.
#' @param digits The number of digits of the weights on the lines, a whole number. 0 writes no
#'   numbers. `NULL`, the default, means 2 for up to 24 lines and 0 for more.
#' @param main The title. `NULL`, the default, names the environment and the sizes of the layers.
#' @param client The client of the server that is asked about an environment given by its id. The
#'   default is the session's client, [gym_client()].
#' @param ... `plot()` passes its arguments to `autoplot()`, which accepts no others.
#' @return A ggplot. `plot()` returns it invisibly.
#' @section Errors: `gym_error_argument` if the network does not fit the environment, or for a
#'   policy without weights to draw, such as [policy_random()].
#' @seealso [decision_map()] shows what a network does.
#' @rdname plot.gym_policy_network
#' @aliases plot.gym_policy_network
#' @exportS3Method ggplot2::autoplot
#' @examples
#' set.seed(1)
#' plot(policy_network(c(4, 2, 1)))
#'
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search$policy)
autoplot.gym_policy_network <- function(object, env = NULL, ..., neurons = 12, digits = NULL,
                                        client = gym_client()) {
  check_dots_empty(...)
  # Without `env`, use the spaces of the environment in which the policy was played.
  policy <- if (is.null(env)) object else policy_bind(object, known_spaces(env, client))
  data <- network_plot_data(policy, neurons, digits)
  units <- data$neurons
  weights <- data$weights[order(data$weights$width), ]
  weights <- weights[weights$width > 0, ]
  crowded <- max(table(units$x)) > 8L
  name <- c(positive = "positive weight", negative = "negative weight")
  numbers <- weights[nzchar(weights$label), ]
  place <- ggplot2::aes(.data$label_x, .data$label_y, label = .data$label)
  # Three dots in place of left-out neurons.
  dots <- data.frame(x = rep(data$dots$x, each = 3L),
                     y = rep(data$dots$y, each = 3L) + c(-0.02, 0, 0.02))
  inputs <- units[units$x == 0, ]
  outputs <- units[units$x == max(units$x), ]
  ggplot2::ggplot(units, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_segment(
      ggplot2::aes(
        xend = .data$xend, yend = .data$yend, colour = name[.data$sign], linetype = name[.data$sign]
      ),
      weights, linewidth = weights$width * if (nrow(weights) > 60L) 1.2 else 2.5
    ) +
    ggplot2::geom_point(shape = 21, size = if (crowded) 3.5 else 6, fill = "white") +
    ggplot2::geom_text(ggplot2::aes(label = "1"), units[units$bias, ], size = 3) +
    ggplot2::geom_point(data = dots, size = 0.4) +
    # Put white behind a number, so that no line crosses it. Write it to the right of its place,
    # where it does not cover the neuron.
    ggplot2::geom_label(place, numbers, size = 2.8, hjust = 0, colour = "white", fill = "white",
                        label.padding = ggplot2::unit(0.1, "lines")) +
    ggplot2::geom_text(place, numbers, size = 2.8, hjust = -0.06) +
    ggplot2::scale_colour_manual(
      name = NULL, limits = unname(name),
      values = stats::setNames(gym_colours[c("blue", "gold")], name),
      guide = rows_of_key(name, override.aes = list(linewidth = 1))
    ) +
    ggplot2::scale_linetype_manual(
      name = NULL, limits = unname(name), values = stats::setNames(c("solid", "31"), name),
      guide = rows_of_key(name)
    ) +
    # Axis labels have room, so write the names of inputs and outputs there.
    ggplot2::scale_x_continuous(
      breaks = data$layers$x, labels = data$layers$label, expand = ggplot2::expansion(mult = 0.07)
    ) +
    ggplot2::scale_y_continuous(
      breaks = inputs$y, labels = inputs$label, limits = c(0, 1),
      sec.axis = ggplot2::sec_axis(~., breaks = outputs$y, labels = outputs$label)
    ) +
    ggplot2::coord_cartesian(clip = "off") +
    picture_labels(
      env_text(policy) %||% "Policy",
      c(paste("network", paste(policy$sizes, collapse = "-")), "wider lines are further from 0")
    ) +
    theme_gym_bare() +
    ggplot2::theme(
      axis.text.x = ggplot2::element_text(face = "italic", size = ggplot2::rel(0.8)),
      axis.text.y = ggplot2::element_text(size = ggplot2::rel(0.75), hjust = 1),
      axis.text.y.right = ggplot2::element_text(size = ggplot2::rel(1), hjust = 0)
    )
}

#' @exportS3Method ggplot2::autoplot
autoplot.gym_policy <- function(object, ...) {
  is_table <- inherits(object, "gym_policy_table")
  abort_wrong("x", object, rlang::current_env(),
              "Only a network can be drawn, not a policy that is {format(object)}.",
              i = if (is_table) table_hint else "`policy_network()` makes one.")
}

# Where neurons and weights stand, and what they are called -------------------------------

#' Compute the data of a network diagram
#'
#' The layers are at x = 0, 1, ..., the neurons between y = 0 and 1.
#' @return A list: `neurons` (data frame: `layer`, `neuron`, its number in the layer, `x`, `y`,
#'   `bias`, whether it is the constant 1 whose weights are the biases, the last neuron of its
#'   layer, `label`, empty in hidden layers), `dots` (data frame `x`, `y`, the places of left-out
#'   neurons), `weights` (data frame: `layer`, `from`, `to`, `weight`, `sign`, `width` from 0 to 1,
#'   the places `x`, `y`, `xend`, `yend`, and `label` with its place `label_x`, `label_y`), `layers`
#'   (data frame `x`, `label`).
#' @noRd
network_plot_data <- function(policy, most = 12, digits = NULL, call = rlang::caller_env()) {
  check_network(policy, call)
  check_count(most, min = 3, arg = "neurons", call = call)
  check_count(digits, min = 0, allow_null = TRUE, arg = "digits", call = call)
  layers <- length(policy$sizes)
  sizes <- policy$sizes + c(rep(as.integer(isTRUE(policy$bias)), layers - 1L), 0L)
  units <- do.call(rbind, lapply(seq_len(layers), function(layer) {
    size <- sizes[[layer]]
    # If there are too many neurons, draw the first ones and the last one, with a gap for dots.
    shown <- if (size > most) c(seq_len(most - 2L), NA, size) else seq_len(size)
    y <- 1 - (seq_along(shown) - 0.5) / length(shown)
    data.frame(layer = layer, neuron = shown, x = layer - 1, y = y)
  }))
  neurons <- units[!is.na(units$neuron), ]
  neurons$bias <- neurons$neuron > policy$sizes[neurons$layer]
  neurons$label <- ""
  first <- neurons$layer == 1L
  last <- neurons$layer == layers
  neurons$label[first] <- c(input_labels(policy), "bias")[neurons$neuron[first]]
  neurons$label[last] <- output_labels(policy)[neurons$neuron[last]]
  list(
    neurons = neurons, dots = units[is.na(units$neuron), c("x", "y")],
    weights = place_weights(policy, neurons, digits),
    layers = data.frame(x = seq_len(layers) - 1, label = c("observation", policy$activation))
  )
}

place_weights <- function(policy, neurons, digits) {
  each <- lapply(seq_along(policy$weights), function(layer) {
    from <- neurons[neurons$layer == layer, ]
    to <- neurons[neurons$layer == layer + 1L & !neurons$bias, ]
    pairs <- expand.grid(to = seq_len(nrow(to)), from = seq_len(nrow(from)))
    number <- cbind(to$neuron[pairs$to], from$neuron[pairs$from])
    data.frame(
      layer = layer, from = number[, 2L], to = number[, 1L],
      weight = policy$weights[[layer]][number],
      x = from$x[pairs$from], y = from$y[pairs$from], xend = to$x[pairs$to], yend = to$y[pairs$to]
    )
  })
  weights <- do.call(rbind, each)
  largest <- max(abs(unlist(policy$weights)))
  # Put numbers near the beginning of the lines, where the lines are apart.
  along <- 0.26
  weights$label_x <- weights$x + along * (weights$xend - weights$x)
  weights$label_y <- weights$y + along * (weights$yend - weights$y)
  weights$sign <- ifelse(weights$weight < 0, "negative", "positive")
  weights$width <- if (largest > 0) abs(weights$weight) / largest else 0
  digits <- digits %||% if (nrow(weights) <= 24L) 2 else 0
  weights$label <- if (digits > 0) {
    fixed_texts(weights$weight, digits)
  } else {
    ""
  }
  weights
}

input_labels <- function(policy) {
  space <- policy$observation_space
  size <- policy$sizes[[1L]]
  if (inherits(space, "gym_space_discrete")) {
    return(paste(space$names %||% "observed", space$start + seq_len(size) - 1L))
  }
  if (size == 1L && is.null(space$names)) "obs" else number_names(space, size)
}

output_labels <- function(policy) {
  space <- policy$action_space
  outputs <- policy$sizes[[length(policy$sizes)]]
  if (inherits(space, "gym_space_box")) {
    bounds <- paste(number_text_each(space$low), "to", number_text_each(space$high))
    return(paste0(action_parts(policy$env_id, outputs), "\n", bounds))
  }
  actions <- action_names(policy$env_id, space$n %||% max(outputs, 2L), space$start %||% 0L)
  if (outputs == 1L && length(actions) == 2L) {
    half <- if (output_activation(policy) %in% c("logistic", "Gompertz")) "0.5" else "0"
    return(paste0("above ", half, ":\n", actions[[2L]], "\n\notherwise:\n", actions[[1L]]))
  }
  actions
}
