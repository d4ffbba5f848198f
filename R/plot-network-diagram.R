# Where a network's neurons and weights stand in its diagram, and what they are called.

#' Compute what a diagram of a network shows
#'
#' The layers stand at x = 0, 1, ..., the neurons between y = 0 and 1.
#' @return A list: `neurons` (data frame: `layer`, `neuron`, its number in the layer, `x`,
#'   `y`, `bias`, whether it is the constant 1 whose weights are the biases, and then the last of
#'   its layer, `label`, empty in hidden layers), `dots` (data frame `x`, `y`, where neurons are
#'   left out), `weights` (data frame: `layer`, `from`, `to`, `weight`, `sign`, `width` from
#'   0 to 1, the places `x`, `y`, `xend`, `yend`, and `label`, which stands at `label_x`,
#'   `label_y`), `layers` (data frame `x`, `label`).
#' @noRd
network_plot_data <- function(policy, most = 12, digits = NULL, call = rlang::caller_env()) {
  check_network(policy, call)
  check_count(most, min = 3, arg = "neurons", call = call)
  check_count(digits, min = 0, allow_null = TRUE, arg = "digits", call = call)
  layers <- length(policy$sizes)
  sizes <- policy$sizes + c(rep(as.integer(isTRUE(policy$bias)), layers - 1L), 0L)
  each <- lapply(seq_len(layers), function(layer) place_neurons(sizes[[layer]], layer, most))
  neurons <- do.call(rbind, lapply(each, function(placed) placed$neurons))
  neurons$bias <- neurons$neuron > policy$sizes[neurons$layer]
  neurons$label <- ""
  first <- neurons$layer == 1L
  last <- neurons$layer == layers
  neurons$label[first] <- c(input_labels(policy), "bias")[neurons$neuron[first]]
  neurons$label[last] <- output_labels(policy)[neurons$neuron[last]]
  list(
    neurons = neurons,
    dots = do.call(rbind, lapply(each, function(placed) placed$dots)),
    weights = place_weights(policy, neurons, digits),
    layers = data.frame(x = seq_len(layers) - 1, label = c("observation", policy$activation))
  )
}

# Where there are too many neurons to draw, the first ones and the last one are drawn, with a place
# for dots between them.
place_neurons <- function(size, layer, most) {
  shown <- if (size > most) c(seq_len(most - 2L), NA, size) else seq_len(size)
  y <- 1 - (seq_along(shown) - 0.5) / length(shown)
  gap <- is.na(shown)
  list(
    neurons = data.frame(layer = layer, neuron = shown[!gap], x = layer - 1, y = y[!gap]),
    dots = data.frame(x = rep(layer - 1, sum(gap)), y = y[gap])
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
  along <- label_places(weights)
  weights$label_x <- weights$x + along * (weights$xend - weights$x)
  weights$label_y <- weights$y + along * (weights$yend - weights$y)
  weights$sign <- ifelse(weights$weight < 0, "negative", "positive")
  weights$width <- if (largest > 0) abs(weights$weight) / largest else 0
  digits <- digits %||% if (nrow(weights) <= 24L) 2 else 0
  weights$label <- if (digits > 0) {
    sub("^-(0[.]0+)$", "\\1", sprintf("%.*f", as.integer(digits), weights$weight))
  } else {
    ""
  }
  weights
}

# How far along its line a weight's number stands, from 0 to 1. It is the same for all of a layer:
# as near to the middle as possible, where the lines are at least 85 % as far apart as anywhere.
label_places <- function(weights) {
  apart <- function(layer, along) {
    heights <- sort(layer$y + along * (layer$yend - layer$y))
    if (length(heights) > 1L) min(diff(heights)) else 1
  }
  candidates <- seq(0.5, 0.14, by = -0.04)
  best <- vapply(split(weights, weights$layer), function(layer) {
    distance <- vapply(candidates, apart, 0, layer = layer)
    candidates[[which(distance >= 0.85 * max(distance))[[1L]]]]
  }, 0)
  unname(best[as.character(weights$layer)])
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
