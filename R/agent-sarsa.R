#' Sarsa
#'
#' Learn the values of the exploring policy itself. A value moves towards the reward plus the
#' discounted value of the action that is taken next (Rummery and Niranjan 1994; Sutton and Barto
#' 2018, section 6.4). Beside a cliff, the agent therefore learns to keep away from the edge, where
#' exploring would make it fall.
#'
#' `expected = TRUE` uses the mean over the possible next actions instead (section 6.6). `n` looks n
#' steps ahead (section 7.2). `lambda` combines all numbers of steps, with decreasing weights, by
#' eligibility traces (section 12.7): replacing traces, and accumulating ones if `features` is a
#' function.
#'
#' @inheritParams agent_q
#' @param expected Expected Sarsa? `FALSE`, the default, or `TRUE`.
#' @param n The number of steps to look ahead, a whole number of at least 1, the default.
#' @param lambda How slowly traces fade, a number from 0, the default, to 1. A number above 0
#'   requires `n = 1`.
#' @return `agent_sarsa()` returns an agent of class `gym_agent_sarsa`. `learn_sarsa()` makes this
#'   agent, trains it and returns the result of [train_agent()].
#' @inheritSection agent_q Errors
#' @references G. A. Rummery and M. Niranjan (1994), On-line Q-learning using connectionist systems,
#'   CUED/F-INFENG/TR 166, Cambridge. R. S. Sutton and A. G. Barto (2018), Reinforcement Learning:
#'   An Introduction, second edition, MIT Press.
#' @seealso [learn_q()], [learn_monte_carlo()], [learn_td()]
#' @export
#' @examples
#' agent_sarsa(lambda = 0.9, features = tile_coding(8, 8))
#' @examplesIf gym:::can_start_server()
#' learn_sarsa("CliffWalking-v1", iterations = 5, max_steps = 1000, learning_rate = 0.5,
#'             discount = 1, seed = 1)
agent_sarsa <- function(discount = 0.99, learning_rate = 0.1, epsilon = 0.1, temperature = NULL,
                        initial = 0, features = NULL, expected = FALSE, n = 1, lambda = 0,
                        mask = NULL) {
  check_flag(expected)
  check_count(n)
  check_number(lambda, min = 0, max = 1)
  settings <- mget(names(formals()))
  settings$n <- as.integer(n)
  check_learner(settings)
  check_one_horizon(n, lambda)
  new_learner("sarsa", settings)
}

check_one_horizon <- function(n, lambda, call = rlang::caller_env()) {
  abort_if(
    n > 1 && lambda > 0, "lambda", lambda, call,
    "Either `n` is above 1 or `lambda` above 0, not both: each says how far to look ahead."
  )
}

#' @exportS3Method
learner_of.gym_agent_sarsa <- function(agent, draw) {
  learning <- learning_of(agent, draw)
  row <- learning$store$row
  choose <- learning$choose
  learn <- learning$learn
  taken <- agent$taken
  expects <- agent$expected
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) choose(row(x), taken),
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      ahead <- 0
      following <- NA_integer_
      if (!terminated) {
        values <- row(after)
        following <- choose(values, taken)
        ahead <- if (expects) expected_value(agent, values, taken) else values[[following]]
      }
      learn(x, column, reward, ahead, ended, sub_env, taken)
      taken <<- taken + 1
      # The chosen action is taken if the episode goes on.
      following
    },
    keeps = function() list(taken = taken)
  )
}

# Returns the mean value of the next actions, weighted by their probabilities.
expected_value <- function(agent, values, taken) {
  values <- matrix(values, 1L)
  exploring <- list(
    epsilon = rate_of(agent$epsilon, "epsilon")(taken),
    temperature = if (!is.null(agent$temperature)) {
      scheduled(agent$temperature, taken, "temperature", lowest_temperature, Inf)
    }
  )
  probabilities <- row_probabilities(exploring, values)
  sum(ifelse(values == -Inf, 0, values) * probabilities)
}

#' @export
format.gym_agent_sarsa <- function(x, ...) {
  name <- paste0(if (x$n > 1L) paste0(x$n, "-step "), "Sarsa", if (x$lambda > 0) "(lambda)")
  if (x$expected) name <- paste("Expected", name)
  learner_text(name, x, if (x$lambda > 0) list(lambda = x$lambda))
}

#' @rdname agent_sarsa
#' @export
learn_sarsa <- function(env, ...) {
  make_and_train("agent_sarsa", env, ..., defaults = list(episodes = 10))
}
