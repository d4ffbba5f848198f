#' Plot a network
#'
#' Draws the diagram of a network: its layers from left to right, neurons as circles, weights as
#' lines that are the wider the further from 0, blue where they are positive, vermillion and dashed
#' where they are negative. Biases are the weights of a circle with a 1, the last of its layer. Few
#' weights are written on the lines as numbers; of a layer with many neurons some are left out,
#' which dots show.
#'
#' Inputs are named as the observation's parts and outputs as what they decide, where the
#' policy knows its environment: because it was played there, or because it is given as `env`.
#'
#' `autoplot()` draws the same with ggplot2, where that is installed.
#'
#' @param x,object A network, as [policy_network()] makes it.
#' @param env The environment: an id, such as `"CartPole-v1"` or what [gym_wrap()] returns, or
#'   an environment made by [gym_make()]. `NULL`, the default, is that in which the policy
#'   was played.
#' @param neurons How many neurons of a layer to draw at most, a whole number of at least 3;
#'   the default is 12.
#' @param digits With how many digits to write weights on their lines. `NULL`, the
#'   default, is 2 for up to 24 lines and none for more; 0 writes none.
#' @param main The title; `NULL`, the default, gives the sizes.
#' @param client The client of the server that is asked about an environment named by its id;
#'   the default is the session's own, [gym_client()].
#' @param ... Not used.
#' @return `x`, invisibly; `autoplot()` a ggplot.
#' @section Errors: `gym_error_argument` when the network does not fit the environment, and
#'   for a policy that has no weights to draw, such as [policy_random()].
#' @seealso [decision_map()] shows what a network does.
#' @export
#' @examples
#' set.seed(1)
#' plot(policy_network(c(4, 2, 1)))
#'
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' plot(search$policy)
plot.gym_policy_network <- function(x, env = NULL, ..., neurons = 12, digits = NULL,
                                    main = NULL, client = gym_client()) {
  check_dots_empty(...)
  policy <- bind_to(x, env, client)
  data <- network_plot_data(policy, neurons, digits)
  old <- graphics::par(mar = c(2.5, 1, 4, 1))
  on.exit(graphics::par(old))
  room <- open_diagram(data)
  weight_lines(data$weights, room)
  draw_neurons(data, room)
  title_above(main %||% network_title(policy))
  legend_above(
    labels = c("positive weight", "negative (wider: further from 0)"),
    col = weight_colours(), pch = NA, lty = weight_types
  )
  invisible(x)
}

# The policy with the spaces of `env`, whose names the diagram shows; without `env` it keeps those
# of the environment in which it was played.
bind_to <- function(policy, env, client, call = rlang::caller_env()) {
  if (is.null(env)) policy else policy_bind(policy, known_spaces(env, client, call), call = call)
}

network_title <- function(x) {
  paste0(if (!is.null(x$env_id)) paste0(x$env_id, ": "), "network ", paste(x$sizes, collapse = "-"))
}

#' @export
plot.gym_policy <- function(x, ...) {
  gym_abort(
    c(paste0("Only a network can be drawn, not a policy that is ", format(x), "."),
      i = "`policy_network()` makes one."),
    class = "gym_error_argument", argument = "x", value = x
  )
}

weight_colours <- function() c(positive = okabe_ito$blue, negative = okabe_ito$vermillion)
weight_types <- c(positive = "solid", negative = "31")

# Drawing -------------------------------------------------------------------------

#' Open a plot as wide as the labels beside the first and the last layer leave room
#' @return A list: `cex` of the labels, smaller where they would take more than half of the
#'   width; `gap` between two layers, in inches.
#' @noRd
open_diagram <- function(data) {
  graphics::plot.new()
  across <- graphics::par("pin")[[1L]]
  layers <- max(data$layers$x)
  wide <- function(layer, cex) {
    labels <- unlist(strsplit(data$neurons$label[data$neurons$x == layer], "\n"))
    max(graphics::strwidth(labels, "inches", cex = cex), 0) + 1.2 * neuron_away()
  }
  cex <- if (nrow(data$neurons) > 40L) 0.7 else 0.9
  while (wide(0, cex) + wide(layers, cex) > 0.55 * across && cex > 0.4) cex <- 0.95 * cex
  gap <- max(across - wide(0, cex) - wide(layers, cex), 0.2 * across) / layers
  graphics::plot.window(c(-wide(0, cex) / gap, layers + wide(layers, cex) / gap), c(-0.02, 1.02),
                        xaxs = "i", yaxs = "i")
  list(cex = cex, gap = gap)
}

# How far from the middle of a neuron its label begins, in inches.
neuron_away <- function() 0.95 * graphics::par("csi")

weight_lines <- function(weights, room) {
  drawn <- weights[order(weights$width), ]
  drawn <- drawn[drawn$width > 0, ]
  widest <- if (nrow(drawn) > 60L) 3 else 6
  graphics::segments(
    drawn$x, drawn$y, drawn$xend, drawn$yend, lwd = widest * drawn$width,
    lty = weight_types[drawn$sign], lend = "butt", col = weight_colours()[drawn$sign]
  )
  labelled <- weights[nzchar(weights$label), ]
  if (nrow(labelled) && room$gap > 1) {
    boxed_text(labelled$label_x, labelled$label_y, labelled$label)
  }
}

boxed_text <- function(x, y, labels, cex = 0.75) {
  half_width <- 0.55 * graphics::strwidth(labels, cex = cex)
  half_height <- 0.7 * graphics::strheight(labels, cex = cex)
  graphics::rect(x - half_width, y - half_height, x + half_width, y + half_height,
                 col = "white", border = NA)
  graphics::text(x, y, labels, cex = cex)
}

draw_neurons <- function(data, room) {
  neurons <- data$neurons
  crowded <- max(table(neurons$x)) * 0.35 > graphics::par("pin")[[2L]]
  graphics::points(neurons$x, neurons$y, pch = 21L, cex = if (crowded) 1.8 else 3, bg = "white",
                   lwd = 1.5)
  constant <- neurons[neurons$bias, ]
  if (nrow(constant)) {
    graphics::text(constant$x, constant$y, "1", cex = if (crowded) 0.5 else 0.8)
  }
  draw_dots(data$dots)
  away <- neuron_away() / room$gap
  last <- max(neurons$x)
  side <- function(layer, x, adj) {
    there <- neurons[neurons$x == layer, ]
    graphics::text(x, there$y, there$label, adj = c(adj, 0.5), cex = room$cex, xpd = NA)
  }
  side(0, -away, 1)
  side(last, last + away, 0)
  draw_layer_names(data$layers, room)
}

# Three dots where neurons are left out.
draw_dots <- function(dots) {
  for (i in seq_len(nrow(dots))) {
    graphics::points(rep(dots$x[[i]], 3L), dots$y[[i]] + c(-0.5, 0, 0.5) * graphics::strheight("M"),
                     pch = 16L, cex = 0.5)
  }
}

# The layers' names below them, small enough not to overlap.
draw_layer_names <- function(layers, room) {
  cex <- min(room$cex, 0.95 * room$gap / max(graphics::strwidth(layers$label, "inches", font = 3L)))
  graphics::mtext(layers$label, 1L, line = 0.5, at = layers$x, cex = cex * graphics::par("cex"),
                  font = 3L)
}

# With ggplot2 -----------------------------------------------------------------------

#' @rdname plot.gym_policy_network
#' @exportS3Method ggplot2::autoplot
autoplot.gym_policy_network <- function(object, env = NULL, ..., neurons = 12, digits = NULL,
                                        client = gym_client()) {
  check_dots_empty(...)
  policy <- bind_to(object, env, client)
  data <- network_plot_data(policy, neurons, digits)
  weights <- data$weights[order(data$weights$width), ]
  widest <- if (nrow(weights) > 60L) 1.5 else 3
  labelled <- weights[nzchar(weights$label), ]
  neurons <- data$neurons
  neurons$side <- ifelse(neurons$x == 0, 1, 0)
  neurons$beside <- neurons$x + ifelse(neurons$x == 0, -0.05, 0.05) * max(data$layers$x, 1)
  ggplot2::ggplot(neurons, ggplot2::aes(.data$x, .data$y)) +
    ggplot2::geom_segment(
      ggplot2::aes(xend = .data$xend, yend = .data$yend, colour = .data$sign,
                   linetype = .data$sign),
      weights[weights$width > 0, ], linewidth = widest * weights$width[weights$width > 0]
    ) +
    # The line is seen through what is behind its number.
    ggplot2::geom_label(ggplot2::aes(.data$label_x, .data$label_y, label = .data$label), labelled,
                        size = 3, fill = grDevices::adjustcolor("white", 0.8),
                        label.padding = ggplot2::unit(0.12, "lines")) +
    ggplot2::geom_point(shape = 21, size = if (max(table(neurons$x)) > 8L) 5 else 9,
                        fill = "white") +
    ggplot2::geom_text(ggplot2::aes(label = "1"), neurons[neurons$bias, ], size = 3) +
    ggplot2::geom_text(ggplot2::aes(label = "..."), data$dots, angle = 90) +
    ggplot2::geom_text(ggplot2::aes(.data$beside, label = .data$label, hjust = .data$side),
                       size = 3.2) +
    ggplot2::scale_colour_manual(values = weight_colours()) +
    ggplot2::scale_linetype_manual(values = weight_types) +
    ggplot2::scale_x_continuous(breaks = data$layers$x, labels = data$layers$label,
                                expand = ggplot2::expansion(mult = 0.45)) +
    ggplot2::scale_y_continuous(expand = ggplot2::expansion(mult = 0.1)) +
    ggplot2::labs(title = network_title(policy), colour = "weight", linetype = "weight") +
    ggplot2::theme_void() +
    ggplot2::theme(axis.text.x = ggplot2::element_text(face = "italic"),
                   legend.position = "top")
}
