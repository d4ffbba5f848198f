#' Convert a model to arrays
#'
#' Convert a model to the arrays that other packages use: `P` and `R` are those of MDPtoolbox
#' (`MDPtoolbox::mdp_value_iteration(P, R, discount)`), and with `start` and their dimnames those of
#' markovDP.
#'
#' These packages do not have episodes. The arrays therefore have one more state, the last. Episodes
#' go there when they end, and nothing leaves it.
#'
#' @param model A model, see [gym_model()].
#' @return A list: `P`, an array of (S + 1) x (S + 1) x A for S states and A actions, whose element
#'   `[i, j, a]` is the probability that action a leads from state i to state j; `R`, a matrix of
#'   (S + 1) x A with the expected rewards; `start`, the probability that each state is the first
#'   one. The dimnames are the numbers of the states and actions, and `"end"`. An invalid action in
#'   a state leads to the end with a reward of `-Inf`.
#' @section Errors: `gym_error_argument` if `model` is not a model, or too large for an array.
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' model_arrays(walk)$P[, , "1"]
model_arrays <- function(model) {
  check_is_model(model)
  states <- length(model$start)
  actions <- as.integer(model$action_space$n)
  cells <- (states + 1)^2 * actions
  if (cells > .Machine$integer.max) {
    gym_abort(
      paste0("An array of ", whole_number_text(cells), " numbers is too large."),
      class = "gym_error_argument", argument = "model", value = model
    )
  }
  table <- model$transitions
  from <- state_rows(model, table$state)
  to <- ifelse(table$terminated, states + 1L, state_rows(model, table$next_state))
  action <- action_columns(model, table$action)
  name <- list(c(names(model$start), "end"), as.character(state_numbers(model$action_space)))
  p <- array(0, c(states + 1L, states + 1L, actions), name[c(1L, 1L, 2L)])
  sums <- rowsum(table$probability, from + (states + 1) * (to - 1 + (states + 1) * (action - 1)))
  p[as.double(rownames(sums))] <- sums
  r <- array(0, c(states + 1L, actions), name)
  expected <- rowsum(table$probability * table$reward, from + (states + 1) * (action - 1))
  r[as.double(rownames(expected))] <- expected
  # To the end, and there forever.
  barred <- rbind(!possible_actions(model), TRUE)
  at <- which(barred, arr.ind = TRUE)
  p[cbind(at[, 1L], states + 1L, at[, 2L])] <- 1
  r[barred & rowSums(!barred) > 0] <- -Inf
  list(P = p, R = r, start = c(model$start, end = 0))
}
