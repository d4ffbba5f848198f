# The activation functions of a network's layers.

activations <- c("tanh", "logistic", "identity", "Gompertz", "ReLU", "leakyReLU")

layer_activations <- function(activation, sizes, call = rlang::caller_env()) {
  for (i in seq_along(activation)) {
    check_choice(
      activation[[i]], activations, arg = paste0("activation[", i, "]"), call = call
    )
  }
  layers <- length(sizes) - 1L
  if (length(activation) != layers && length(activation) != 2L) {
    gym_abort(
      paste0(
        "`activation` must have 2 names (hidden layers, outputs) or one for each of the ",
        layers, " layers after the inputs, not ", length(activation), "."
      ),
      class = "gym_error_argument", argument = "activation", value = activation, call = call
    )
  }
  if (length(activation) != layers) {
    activation <- c(rep(activation[[1L]], layers - 1L), activation[[2L]])
  }
  activation
}

# The formulas are those of the package sigmoid.
activate <- function(x, activation) {
  switch(activation,
    tanh = tanh(x),
    logistic = stats::plogis(x),
    identity = x,
    Gompertz = exp(-exp(-x)),
    ReLU = {
      x[x < 0] <- 0
      x
    },
    leakyReLU = pmax(x, 0.01 * x)
  )
}

# The derivative of an activation as a function of its output.
activation_slope <- function(y, activation) {
  switch(activation,
    tanh = 1 - y * y,
    logistic = y * (1 - y),
    identity = 1,
    # Far below the middle the output is 0, which has no logarithm.
    Gompertz = -y * log(pmax(y, .Machine$double.xmin)),
    ReLU = y > 0,
    leakyReLU = ifelse(y > 0, 1, 0.01)
  )
}

# Scales bounded outputs to the range from 0 to 1.
unit_outputs <- function(outputs, activation) {
  if (activation == "tanh") (outputs + 1) / 2 else outputs
}

# Does a single output select the second of two actions? It does above the middle of its range, or
# above 0 if it is unbounded. Exactly the middle selects the first, as round(0.5) is 0.
above_half <- function(output, activation) {
  switch(activation,
    logistic = , Gompertz = output > 0.5,
    output > 0
  )
}
