#' Temporal-difference prediction
#'
#' Learns what each state is worth to a given policy, by moving its value, after each step, towards
#' the reward and the value of the state that the step led to (Sutton and Barto 2018, section 6.1).
#' `n` looks n steps ahead (section 7.1), and `lambda` over all numbers of steps, by eligibility
#' traces (section 12.2).
#'
#' @inheritParams agent_sarsa
#' @param policy The policy whose values are learned, and which plays: any that [rollout()] plays.
#' @param initial The value that all states have at first, a number; the default is 0.
#' @param iterations,total_steps The budget, as for [train_agent()]. An iteration are `episodes`
#'   episodes.
#' @param target The mean return at which training ends; the default is none, as learning values has
#'   no return to reach.
#' @return `agent_td()` an agent of class `gym_agent_td`; `learn_td()` makes that agent, trains it
#'   and returns what [train_agent()] does. [state_values()] gives the values.
#' @inheritSection agent_q Errors
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @seealso [solve_mdp()], which calculates them where the model is known
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' learned <- learn_td(walk, policy_random(), iterations = 50, discount = 1, seed = 1)
#' rbind(learned = state_values(learned), exact = solve_mdp(walk, policy_random())$values)
agent_td <- function(policy, discount = 0.99, learning_rate = 0.1, initial = 0, features = NULL,
                     n = 1, lambda = 0) {
  check_policy(policy)
  check_one_policy(policy, "policy", rlang::current_env())
  check_count(n)
  check_number(lambda, min = 0, max = 1)
  settings <- list(
    plays = policy, discount = discount, learning_rate = learning_rate, initial = initial,
    features = features, n = as.integer(n), lambda = lambda
  )
  check_learner(settings)
  check_one_horizon(n, lambda)
  new_learner("gym_agent_td", settings)
}

#' @export
agent_start.gym_agent_td <- function(agent, policy) {
  agent <- NextMethod()
  agent$plays <- policy_bind(agent$plays, policy)
  agent
}

# A value for each state.
#' @exportS3Method
value_columns_of.gym_agent_td <- function(agent) 1L

#' @exportS3Method
learner_of.gym_agent_td <- function(agent) {
  learning <- learning_of(agent)
  value <- learning$store$row
  learn <- learning$learn
  act <- policy_chooser(agent, learning$uniform$draw)
  asked <- is.null(chooser_probabilities(agent))
  taken <- agent$taken
  new_steps(
    agent, learning, begin = act,
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      learn(x, 1L, reward, if (terminated) 0 else value(after), ended, sub_env, taken)
      taken <<- taken + 1
      if (ended) NA_integer_ else act(after, sub_env, observation)
    },
    export = function(agent) {
      agent$taken <- taken
      agent
    },
    act = if (asked) function(observation, n) act_batch(agent$plays, observation, n, agent$spaces)
  )
}

#' Make the function by which a given policy acts, one observation at a time
#'
#' Of a table, and of chance, the probabilities of the actions are known beforehand. Any other is
#' asked; where there are several sub-environments it was asked about all of them together.
#' @noRd
policy_chooser <- function(agent, draw) {
  probabilities <- chooser_probabilities(agent)
  if (is.null(probabilities)) {
    policy <- agent$plays
    first <- agent$spaces$action_space$start - 1L
    function(x, sub_env, observation) {
      if (is.null(observation)) {
        return(NA_integer_)
      }
      act_batch(policy, observation, 1L, agent$spaces) - first
    }
  } else if (is.matrix(probabilities)) {
    function(x, sub_env, observation) draw_place(probabilities[x, ], draw())
  } else {
    function(x, sub_env, observation) draw_place(probabilities, draw())
  }
}

# How likely a policy takes each action: a matrix with a row for each state, a vector where the
# state makes no difference, `NULL` where that is not known beforehand.
chooser_probabilities <- function(agent) {
  policy <- agent$plays
  if (inherits(policy, "gym_policy_table") && is.null(agent$features)) {
    q <- policy$q
    q[row_max(q) == -Inf, ] <- 0
    row_probabilities(policy, q)
  } else if (inherits(policy, "gym_policy_random")) {
    if (is.null(policy$possible)) {
      numbers <- state_numbers(agent$spaces$action_space)
      (numbers %in% state_numbers(policy$action_space)) + 0
    } else if (is.null(agent$features)) {
      policy$possible + 0
    }
  }
}

#' @export
agent_policy.gym_agent_td <- function(agent) agent$plays

#' @export
format.gym_agent_td <- function(x, ...) {
  name <- if (x$lambda > 0) "TD(lambda)" else if (x$n > 1L) paste0(x$n, "-step TD") else "TD"
  learner_text(name, x, if (x$lambda > 0) list(lambda = x$lambda))
}

#' @rdname agent_td
#' @export
learn_td <- function(env, policy, iterations = NULL, total_steps = NULL, episodes = 10,
                     discount = 0.99, learning_rate = 0.1, initial = 0, features = NULL, n = 1,
                     lambda = 0, target = Inf, ...) {
  make_and_train("agent_td", rlang::current_env(), ...)
}
