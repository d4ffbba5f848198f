# The weights of a network: a matrix for each layer after the inputs, with a row for each neuron and
# a column for each of its inputs. The bias is an additional last column.

# The shapes of the matrices.
weight_shapes <- function(sizes, bias) {
  Map(c, sizes[-1L], sizes[-length(sizes)] + isTRUE(bias))
}

# Draws the weights in the order of the tutorial: first the matrix of the hidden layer, then the
# weights of the output.
draw_weights <- function(sizes, bias = FALSE, init = "uniform", last_gain = 1) {
  shapes <- weight_shapes(sizes, bias)
  if (init == "orthogonal") {
    gain <- c(rep(sqrt(2), length(shapes) - 1L), last_gain)
    return(Map(function(shape, gain) draw_orthogonal(shape, gain, bias), shapes, gain))
  }
  lapply(shapes, function(shape) {
    matrix(stats::runif(prod(shape), -1, 1), shape[[1L]], shape[[2L]])
  })
}

# Saxe, McClelland and Ganguli (2014): orthogonal rows, or columns if these are fewer, of length
# `gain`; biases are 0.
draw_orthogonal <- function(shape, gain, bias) {
  neurons <- shape[[1L]]
  inputs <- shape[[2L]] - isTRUE(bias)
  normal <- matrix(stats::rnorm(neurons * inputs), max(neurons, inputs))
  parts <- qr(normal, LAPACK = FALSE)
  signs <- sign(diag(as.matrix(qr.R(parts))))
  basis <- qr.Q(parts) * rep(signs, each = nrow(normal))
  cbind(gain * if (neurons >= inputs) basis else t(basis), if (isTRUE(bias)) numeric(neurons))
}

# If actions are drawn, all of them are nearly equally likely at first.
draw_first_weights <- function(policy) {
  # An output that the environment chooses will draw.
  draws <- is.na(policy$output) || has_log_prob(policy)
  last_gain <- if (draws) 0.01 else 1
  draw_weights(policy$sizes, policy$bias, policy$init, last_gain)
}

# The user may have changed the weights. A network whose sizes depend on the environment has no
# weights before it is bound.
check_network <- function(policy, call = rlang::caller_env()) {
  if (is.null(policy$weights)) {
    gym_abort(
      c(paste0("The network does not know its sizes: ", sizes_text(policy$sizes), "."),
        i = "`policy_bind(policy, env)` takes them from the environment."),
      class = "gym_error_argument", argument = "policy", value = policy, call = call
    )
  }
  check_weights(policy$weights, policy$sizes, policy$bias, "policy$weights", call)
}

check_weights <- function(weights, sizes, bias = FALSE, name = "weights",
                          call = rlang::caller_env()) {
  wanted <- weight_shapes(sizes, bias)
  if (!is.list(weights) || length(weights) != length(wanted)) {
    shapes <- vapply(wanted, paste, "", collapse = " x ")
    must <- paste0("a list of ", length(wanted), " matrices (", paste(shapes, collapse = ", "), ")")
    abort_argument(weights, must, name, call)
  }
  for (i in seq_along(wanted)) {
    check_layer(weights[[i]], wanted[[i]], bias, paste0(name, "[[", i, "]]"), call)
  }
}

check_layer <- function(layer, wanted, bias, arg, call) {
  if (!is.matrix(layer) || !is.numeric(layer)) {
    abort_argument(layer, "a numeric matrix", arg, call)
  }
  if (!identical(dim(layer), as.integer(wanted))) {
    turned <- identical(rev(dim(layer)), as.integer(wanted))
    gym_abort(
      c(
        paste0("`", arg, "` must be a matrix of ", paste(wanted, collapse = " x "),
               " for these sizes", if (isTRUE(bias)) " and a bias", ", not of ",
               paste(dim(layer), collapse = " x "), "."),
        i = if (turned) "`t()` transposes it: a row is a neuron, a column one of its inputs."
      ),
      class = "gym_error_argument", argument = arg, value = layer, call = call
    )
  }
  if (anyNA(layer)) {
    abort_argument(layer, "without missing values", arg, call)
  }
}

# The weights as one vector, layer after layer, each matrix column after column, and then the
# logarithms of standard deviations, if the policy has any.
weight_vector <- function(policy) {
  c(unlist(lapply(policy$weights, as.vector)), if (is_gaussian(policy)) policy$log_std)
}

with_weights <- function(policy, weights) {
  of_layers <- sum(lengths(policy$weights))
  policy$weights <- utils::relist(weights[seq_len(of_layers)], policy$weights)
  if (is_gaussian(policy)) policy$log_std <- weights[-seq_len(of_layers)]
  policy
}

count_weights <- function(policy) {
  sum(lengths(policy$weights)) + if (is_gaussian(policy)) length(policy$log_std) else 0L
}

# "4-2-1", with "*" for a size that depends on the environment.
sizes_text <- function(sizes) paste(ifelse(is.na(sizes), "*", sizes), collapse = "-")
