# The activation functions of a network's layers.

base_activations <- c("tanh", "logistic", "identity")
sigmoid_activations <- c("Gompertz", "ReLU", "leakyReLU")

layer_activations <- function(activation, sizes, call = rlang::caller_env()) {
  for (i in seq_along(activation)) {
    check_choice(
      activation[[i]], c(base_activations, sigmoid_activations),
      arg = paste0("activation[", i, "]"), call = call
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
  check_sigmoid_installed(activation, call)
  activation
}

check_sigmoid_installed <- function(activation, call,
                                    installed = requireNamespace("sigmoid", quietly = TRUE)) {
  wanted <- intersect(activation, sigmoid_activations)
  if (length(wanted) && !installed) {
    gym_abort(
      c(
        paste0("The activation \"", wanted[[1L]], "\" comes from the package sigmoid, ",
               "which is not installed."),
        i = "Install it with `install.packages(\"sigmoid\")`, or take \"tanh\" or \"logistic\"."
      ),
      class = "gym_error_argument", argument = "activation", value = activation, call = call
    )
  }
}

activate <- function(x, activation) {
  switch(activation,
    tanh = tanh(x),
    logistic = stats::plogis(x),
    identity = x,
    sigmoid::sigmoid(x, method = activation)
  )
}

# Scales outputs that have a range to the range from 0 to 1.
unit_outputs <- function(outputs, activation) {
  if (activation == "tanh") (outputs + 1) / 2 else outputs
}

# Of a single output: does it stand for the second of two actions? It is that above the middle of
# its range; without a range above 0. Exactly the middle is the first, as round() gives 0 for 0.5.
above_half <- function(output, activation) {
  switch(activation,
    logistic = , Gompertz = output > 0.5,
    output > 0
  )
}
