#' Describe observations by features
#'
#' Describe observations by features if there are too many different ones for a table of values, as
#' with continuous observations. A learner then learns a weight for each action and feature. The
#' value of an action is the sum of its weights times the features (Sutton and Barto 2018, chapter
#' 9). You can give a learner any function that computes the features of observations.
#' `tile_coding()` makes features that work well if an observation has few numbers.
#'
#' Tile coding covers the range of observations with several grids that are shifted against each
#' other (Sutton and Barto 2018, section 9.5.4). Each tile is a feature. It is 1 if the tile
#' contains the observation and 0 otherwise, so in each grid one tile is 1. Numbers outside the
#' range belong to the outermost tiles. With n grids, each grid is shifted against the one before by
#' 1/n of a tile in the first number of an observation, 3/n in the second, 5/n in the third, and so
#' on.
#'
#' @param tilings The number of grids, a whole number of at least 1. The default is 8.
#' @param bins The number of tiles of a grid along each number of an observation: a whole number of
#'   at least 1, or one for each number. The default is 8.
#' @param low,high The range of each number, numeric vectors. `NULL`, the default, uses the bounds
#'   of the observation space. The numbers of a Discrete space have the width 1: with `tilings = 1`
#'   the states form `bins` groups (state aggregation).
#' @return An object of class `gym_features`, for the argument `features` of [learn_q()] and other
#'   learners.
#' @section Errors: `gym_error_argument` for an invalid argument. Learning raises it for
#'   observations that are not numbers or have no bounds.
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @export
#' @examples
#' tile_coding(tilings = 8, bins = 8)
tile_coding <- function(tilings = 8, bins = 8, low = NULL, high = NULL) {
  check_count(tilings)
  low <- plain_numbers(low)
  high <- plain_numbers(high)
  if (!length(bins) || !are_whole(bins, 1, .Machine$integer.max)) {
    abort_argument(bins, "whole numbers of at least 1", "bins", rlang::current_env())
  }
  for (name in c("low", "high")) {
    bound <- get(name)
    if (!is.null(bound) && !(is.numeric(bound) && all(is.finite(bound)))) {
      abort_argument(bound, "finite numbers or NULL", name, rlang::current_env())
    }
  }
  structure(
    list(tilings = as.integer(tilings), bins = as.integer(bins), low = low, high = high),
    class = "gym_features"
  )
}

#' @export
format.gym_features <- function(x, ...) {
  paste0("tile coding, ", count_of(x$tilings, "tiling"), " of ", paste(x$bins, collapse = " x "))
}

#' @export
print.gym_features <- function(x, ...) print_lines(x, paste0("<features: ", format(x), ">"))

# What values are linear in -----------------------------------------------------------

#' Describe the features of an environment's observations
#'
#' With a table or tiles, only a few features of an observation are 1 and all others are 0. Then
#' `of()` returns a matrix with a row for each observation; the row has the numbers of the `each`
#' features that are 1. For a user's function, `of()` returns the features themselves, and `each` is
#' `NULL`.
#' @param features `NULL` for a table, the result of [tile_coding()], or a function.
#' @return A list: `count`, the number of features, `each`, `of`, a function of a batch of
#'   observations and their number, `one`, a function of a batch of one observation that returns its
#'   row as a vector, and `features`, as given. `count` is `NA` until a user's function has been
#'   called.
#' @noRd
basis_of <- function(features, space, call) {
  if (is.null(features)) {
    index <- table_index(space, "observations", call)
    row <- function(observation, n = 1L) rows_of_table(index, space, observation, n, call)
    of <- function(observation, n) matrix(row(observation, n), n, 1L)
    return(list(count = index$count, each = 1L, of = of, one = row, features = NULL))
  }
  if (is.function(features)) {
    of <- function(observation, n) {
      values <- plain_numbers(features(observation), "features", call)
      abort_if(
        !is.matrix(values) || !(is.numeric(values) || is.logical(values)) || nrow(values) != n ||
          !all(is.finite(values)), "features", values, call,
        '`features` must return a numeric matrix with a row for each of
         {count_of(n, "observation")}, not {describe_argument(values)}.',
        i = "It gets many observations at once, as a policy does; see `act()`."
      )
      values
    }
    one <- function(observation) of(observation, 1L)[1L, ]
    return(list(count = NA, each = NULL, of = of, one = one, features = features))
  }
  tiles_of(features, space, call)
}

tiles_of <- function(features, space, call) {
  range <- tiled_range(space, features, call)
  numbers <- length(range$low)
  for (name in c("bins", "low", "high")) {
    if (!length(features[[name]]) %in% c(0L, 1L, numbers)) {
      must <- paste("one number, or one for each of the", numbers, "of an observation")
      abort_argument(features[[name]], must, paste0("tile_coding(", name, " = )"), call)
    }
  }
  low <- rep_len(features$low %||% range$low, numbers)
  high <- rep_len(features$high %||% range$high, numbers)
  unbounded <- !is.finite(low) | !is.finite(high) | low >= high
  abort_if(
    any(unbounded), "features", features, call,
    "Number {which(unbounded)[[1L]]} of an observation has no range: its bounds are
     {low[unbounded][[1L]]} and {high[unbounded][[1L]]}.",
    i = "Give `tile_coding(low = , high = )`, one number for each number of an observation."
  )
  bins <- rep_len(features$bins, numbers)
  tilings <- features$tilings
  # Each direction has one more tile than bins, because all grids but the first are shifted.
  weights <- c(1, cumprod(bins + 1))
  per_tiling <- weights[[numbers + 1L]]
  abort_if(
    per_tiling * tilings > most_values, "features", features, call,
    "The tilings would have {whole_number_text(per_tiling * tilings)} tiles; at most
     {whole_number_text(most_values)} are possible.",
    i = "Take fewer `bins`, or features of your own, of fewer numbers."
  )
  width <- (high - low) / bins
  last <- bins * (1 - 1e-12)
  # A column for each tiling.
  displaced <- t(outer(seq_len(tilings) - 1, 2 * seq_len(numbers) - 1) %% tilings / tilings)
  first <- per_tiling * (seq_len(tilings) - 1) + 1
  of <- function(observation, n) {
    if (length(observation) != n * numbers) {
      must <- paste0("of ", count_of(numbers, "number"), " each, as in ", format(space))
      abort_argument(observation, must, "observation", call)
    }
    # The distance from the lower bound in tiles, cut to the range. A column for each observation.
    place <- (t(matrix(observation, n)) - low) / width
    place <- pmin(pmax(place, 0), last)
    of_tiling <- rep(seq_len(tilings), each = n)
    at <- floor(place[, rep(seq_len(n), tilings)] + displaced[, of_tiling])
    number <- as.vector(weights[seq_len(numbers)] %*% at)
    matrix(as.integer(number + first[of_tiling]), n, tilings)
  }
  displaced_first <- t(displaced)
  own <- rep(weights[seq_len(numbers)], each = tilings)
  one <- function(observation) {
    if (length(observation) != numbers) {
      return(of(observation, 1L)[1L, ])
    }
    place <- (as.vector(observation) - low) / width
    beyond <- place > last
    if (any(beyond)) place[beyond] <- last[beyond]
    place[place < 0] <- 0
    at <- own * floor(rep(place, each = tilings) + displaced_first)
    .rowSums(at, tilings, numbers) + first
  }
  list(count = per_tiling * tilings, each = tilings, of = of, one = one, features = features)
}

# The range of each number of an observation. The numbers of a Discrete space have the width 1.
tiled_range <- function(space, features, call) {
  if (inherits(space, "gym_space_discrete")) {
    return(list(low = as.double(space$start), high = as.double(space$start) + as.double(space$n)))
  }
  abort_if(
    !inherits(space, "gym_space_box") || length(space$shape) != 1L, "features", features, call,
    "Tiles are for observations that are Discrete or a Box of one dimension, not
     {format(space)}."
  )
  list(low = as.numeric(space$low), high = as.numeric(space$high))
}

#' Compute the value of each action for some observations
#' @param weights A matrix with a row for each feature and a column for each action.
#' @param present The features of the observations, as returned by `of()` of the basis.
#' @noRd
linear_values <- function(basis, weights, present) {
  if (is.null(basis$each)) {
    return(present %*% weights)
  }
  values <- weights[present[, 1L], , drop = FALSE]
  for (column in seq_len(basis$each)[-1L]) {
    values <- values + weights[present[, column], , drop = FALSE]
  }
  values
}

# A policy that is linear in features -------------------------------------------------

new_feature_policy <- function(basis, weights, env) {
  structure(
    list(
      basis = basis, weights = weights, epsilon = 0, temperature = NULL,
      observation_space = env$observation_space, action_space = env$action_space
    ),
    class = c("gym_policy_features", "gym_policy")
  )
}

#' @exportS3Method
act_batch.gym_policy_features <- function(policy, observation, n, vector_env) {
  values <- feature_values(policy, observation, n)
  space_index(policy$action_space)$value(draw_table_actions(policy, values))
}

#' @export
act.gym_policy_features <- function(policy, observation, ...) {
  observed_actions(policy, observed_batch(observation, policy$observation_space))
}

#' @exportS3Method
predict_policy.gym_policy_features <- function(policy, newdata, type, call = rlang::caller_env()) {
  if (type == "probability") abort_no_probabilities(policy, call)
  observed <- observed_batch(newdata, policy$observation_space, "newdata", call)
  if (type == "action") {
    return(observed_actions(policy, observed))
  }
  feature_values(policy, observed$batch, observed$n)
}

# The values of all actions, a row for each observation. A user's function is not called for zero
# observations. Before the first step of training there are no weights, because the number of its
# features is not known.
feature_values <- function(policy, observation, n) {
  if (n == 0L || !nrow(policy$weights)) {
    return(matrix(0, n, ncol(policy$weights)))
  }
  linear_values(policy$basis, policy$weights, policy$basis$of(observation, n))
}

#' @export
format.gym_policy_features <- function(x, ...) {
  features <- x$basis$features
  paste0("linear in ", count_of(nrow(x$weights), "feature"),
         if (inherits(features, "gym_features")) paste0(" (", format(features), ")"))
}
