#' Temporal-difference prediction
#'
#' Learn the value of each state under a given policy. After each step, the value of a state moves
#' towards the reward plus the discounted value of the next state (Sutton and Barto 2018, section
#' 6.1). `n` looks n steps ahead (section 7.1). `lambda` combines all numbers of steps by
#' eligibility traces (section 12.2).
#'
#' @inheritParams agent_sarsa
#' @param policy The policy to evaluate, which also plays: any policy that [rollout()] accepts.
#' @param initial The first value of all states, a number. The default is 0. With a function as
#'   `features` it is the first weight of all features, or a number for each.
#' @param behavior Another policy, which plays instead of `policy`. Each step is then weighted by
#'   the probability of its action under `policy`, divided by that under `behavior` (off-policy
#'   learning by importance sampling; sections 5.5 and 11.1). The probabilities of both must be
#'   known: use a [policy_table()] or a [policy_random()]. `NULL`, the default, for none.
#' @param ... Arguments of the agent, as above; of [train_agent()], such as `iterations` or
#'   `total_steps`, of which one is needed, `episodes` (in an iteration, 10 by default) or `seed`;
#'   and of the environment. By default there is no `target`, because learning values does not
#'   change the return.
#' @return `agent_td()` returns an agent of class `gym_agent_td`. `learn_td()` makes this agent,
#'   trains it and returns the result of [train_agent()]. [state_values()] returns the values.
#' @inheritSection agent_q Errors
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @seealso [solve_mdp()], which calculates the values if the model is known
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' learned <- learn_td(walk, policy_random(), iterations = 50, discount = 1, seed = 1)
#' rbind(learned = state_values(learned), exact = solve_mdp(walk, policy_random())$values)
agent_td <- function(policy, discount = 0.99, learning_rate = 0.1, initial = 0, features = NULL,
                     n = 1, lambda = 0, behavior = NULL) {
  check_policy(policy)
  call <- rlang::current_env()
  check_one_policy(policy, "policy", call)
  check_count(n)
  check_number(lambda, min = 0, max = 1)
  # Importance sampling needs the probabilities of both policies, and weights a single step.
  for (arg in if (!is.null(behavior)) c("policy", "behavior")) {
    if (!inherits(get(arg), c("gym_policy_table", "gym_policy_random"))) {
      must <- "a table or a random policy, whose probabilities are known"
      abort_argument(get(arg), must, arg, call)
    }
  }
  abort_if(
    !is.null(behavior) && (n > 1 || lambda > 0),
    "behavior", behavior, call, "`behavior` works with one step only: leave out `n` and `lambda`."
  )
  settings <- list(
    plays = behavior %||% policy, learns = if (!is.null(behavior)) policy, discount = discount,
    learning_rate = learning_rate, initial = initial,
    features = features, n = as.integer(n), lambda = lambda
  )
  check_learner(settings)
  check_one_horizon(n, lambda)
  new_learner("td", settings)
}

#' @export
agent_start.gym_agent_td <- function(agent, policy) {
  agent <- NextMethod()
  agent$plays <- policy_bind(agent$plays, policy)
  if (!is.null(agent$learns)) agent$learns <- policy_bind(agent$learns, policy)
  agent
}

#' @exportS3Method
learner_of.gym_agent_td <- function(agent, draw) {
  learning <- learning_of(agent, draw)
  value <- learning$store$row
  probabilities <- chooser_probabilities(
    agent$plays, agent$spaces$action_space, is.null(agent$features)
  )
  act <- policy_chooser(agent, probabilities, draw)
  ratio <- if (!is.null(agent$learns)) importance_ratio(agent)
  rate <- rate_of(agent$learning_rate)
  taken <- agent$taken
  from <- list()
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) {
      if (!is.null(ratio)) from[[sub_env]] <<- observation
      act(x, sub_env, observation)
    },
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      ahead <- if (terminated) 0 else value(after)
      if (is.null(ratio)) {
        learning$learn(x, 1L, reward, ahead, ended, sub_env, taken)
      } else {
        share <- ratio(from[[sub_env]], column) * rate(taken)
        learning$store$toward(x, 1L, reward + agent$discount * ahead, share)
        from[[sub_env]] <<- observation
      }
      taken <<- taken + 1
      if (ended) NA_integer_ else act(after, sub_env, observation)
    },
    keeps = function() list(taken = taken), sees = !is.null(ratio) || is.null(probabilities)
  )
}

# Makes a function of an observation (a batch of one) and the number of an action. It returns the
# probability of the action under `policy`, divided by that under the policy that plays.
importance_ratio <- function(agent) {
  index <- table_index(agent$spaces$observation_space, "observations", NULL)$index
  target <- chooser_probabilities(agent$learns, agent$spaces$action_space, by_state = TRUE)
  plays <- chooser_probabilities(agent$plays, agent$spaces$action_space, by_state = TRUE)
  share <- function(p, row, column) {
    if (is.matrix(p)) p <- p[row, ]
    p[[column]] / sum(p)
  }
  function(observation, column) {
    row <- index(observation, 1L)
    share(target, row, column) / share(plays, row, column)
  }
}

#' Make the function by which a given policy acts, one observation at a time
#'
#' For a table or a random policy the probabilities of the actions are known in advance. Any other
#' policy is asked in each step.
#' @noRd
policy_chooser <- function(agent, probabilities, draw) {
  space <- agent$spaces$action_space
  index <- space_index(space)$index
  function(x, sub_env, observation) {
    if (is.null(probabilities)) {
      action <- act_batch(agent$plays, observation, 1L, agent$spaces)
      column <- index(action, 1L)
      if (is.na(column)) check_value(space, batch_value(space, action, 1L), "", NULL, TRUE)
      column
    } else {
      draw_place(if (is.matrix(probabilities)) probabilities[x, ] else probabilities, draw())
    }
  }
}

# Returns the probability of each action: a matrix with a row for each state, a vector if it does
# not depend on the state, or `NULL` if it is not known in advance.
chooser_probabilities <- function(policy, action_space, by_state) {
  if (inherits(policy, "gym_policy_table") && by_state) {
    table_probabilities(policy)
  } else if (inherits(policy, "gym_policy_random")) {
    if (is.null(policy$possible)) {
      index <- space_index(action_space)
      actions <- index$value(seq_len(index$count))
      as.double(!is.na(space_index(policy$action_space)$index(actions, index$count)))
    } else if (by_state) {
      policy$possible + 0
    }
  }
}

#' @export
agent_policy.gym_agent_td <- function(agent) agent$learns %||% agent$plays

#' @export
format.gym_agent_td <- function(x, ...) {
  name <- if (x$lambda > 0) "TD(lambda)" else if (x$n > 1L) paste0(x$n, "-step TD") else "TD"
  if (!is.null(x$learns)) name <- paste("Off-policy", name)
  learner_text(name, x, if (x$lambda > 0) list(lambda = x$lambda))
}

#' @rdname agent_td
#' @export
learn_td <- function(env, policy, ...) {
  make_and_train(
    "agent_td", env, policy = policy, ..., defaults = list(episodes = 10, target = Inf)
  )
}
