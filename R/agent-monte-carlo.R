#' Monte Carlo control
#'
#' Learns the value of each action in each state as the mean of the returns that followed on it, in
#' whole episodes, and acts by these values, exploring (Sutton and Barto 2018, section 5.4). Nothing
#' is learned from an episode before it has ended, and no value rests on another one.
#'
#' With `exploring_starts = TRUE` the first action of each episode is drawn from all, each equally
#' likely (section 5.3); the environment draws the first state.
#'
#' An episode that was cut off is taken as if it had ended there: what would have come later is not
#' in its return.
#'
#' @inheritParams agent_q
#' @param visits Which visits of a state and action count: `"first"`, the default, only the first
#'   one of each episode, or `"every"` one.
#' @param exploring_starts Draw the first action of each episode? `FALSE`, the default, or `TRUE`.
#' @param learning_rate `NULL`, the default, for the mean of all returns, each of which counts the
#'   same; a number from 0 to 1, or a function of the steps so far, lets later ones count more.
#' @return `agent_monte_carlo()` an agent of class `gym_agent_monte_carlo`; `learn_monte_carlo()`
#'   makes that agent, trains it and returns what [train_agent()] does.
#' @inheritSection agent_q Errors
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @seealso [learn_q()], [learn_sarsa()]
#' @export
#' @examples
#' agent_monte_carlo(discount = 1)
#' @examplesIf gym:::can_start_server()
#' learn_monte_carlo("Blackjack-v1", iterations = 10, discount = 1, seed = 1, sab = TRUE)
agent_monte_carlo <- function(discount = 0.99, epsilon = 0.1, temperature = NULL, initial = 0,
                              visits = c("first", "every"), exploring_starts = FALSE,
                              learning_rate = NULL, mask = NULL) {
  visits <- check_choice(visits[1L], c("first", "every"), arg = "visits")
  check_flag(exploring_starts)
  settings <- list(
    discount = discount, learning_rate = learning_rate, epsilon = epsilon,
    temperature = temperature, initial = initial, features = NULL, visits = visits,
    exploring_starts = exploring_starts, mask = mask
  )
  check_learner(settings[!vapply(settings, is.null, NA)])
  new_learner("gym_agent_monte_carlo", settings)
}

#' @export
agent_start.gym_agent_monte_carlo <- function(agent, policy) {
  agent <- NextMethod()
  agent$visited <- array(0, dim(agent$weights))
  agent
}

#' @export
agent_act.gym_agent_monte_carlo <- function(agent, observation, sub_env) {
  values <- values_of(agent, seen_by(agent, observation, sub_env))
  column <- choose_actions(agent, values)
  if (agent$exploring_starts) {
    known <- lengths(agent$pending)
    starts <- is.na(known[sub_env]) | known[sub_env] == 0L
    column[starts] <- draw_table_actions(list(epsilon = 1), values)[starts]
  }
  column - 1L + agent$spaces$action_space$start
}

#' @export
agent_observe.gym_agent_monte_carlo <- function(agent, transitions) {
  column <- action_columns(agent$spaces, transitions$action)
  row <- seen_by(agent, transitions$observation, column)[, 1L]
  cell <- row + nrow(agent$weights) * (column - 1L)
  ended <- transitions$terminated | transitions$truncated
  for (i in seq_along(cell)) {
    place <- transitions$sub_env[[i]]
    episode <- if (!transitions$first[[i]]) agent$pending[[place]]
    episode <- c(episode, list(c(cell[[i]], transitions$reward[[i]])))
    if (ended[[i]]) {
      agent <- learn_episode(agent, do.call(rbind, episode))
      episode <- list()
    }
    agent$pending[place] <- list(episode)
  }
  agent$taken <- agent$taken + length(cell)
  agent
}

# `episode` has a row for each step: the cell of the table, and the reward.
learn_episode <- function(agent, episode) {
  cell <- as.integer(episode[, 1L])
  returns <- discounted_returns(episode[, 2L], agent$discount)
  counted <- if (agent$visits == "first") which(!duplicated(cell)) else rev(seq_along(cell))
  for (i in counted) {
    at <- cell[[i]]
    agent$visited[[at]] <- agent$visited[[at]] + 1
    rate <- if (is.null(agent$learning_rate)) {
      1 / agent$visited[[at]]
    } else {
      scheduled(agent$learning_rate, agent$taken, "learning_rate")
    }
    agent$weights[[at]] <- agent$weights[[at]] + rate * (returns[[i]] - agent$weights[[at]])
  }
  agent
}

# What followed on each step: its reward, and those after it, discounted.
discounted_returns <- function(rewards, discount) {
  rev(Reduce(function(later, reward) reward + discount * later, rev(rewards), accumulate = TRUE))
}

#' @export
format.gym_agent_monte_carlo <- function(x, ...) {
  name <- paste0("Monte Carlo (", x$visits, " visits",
                 if (x$exploring_starts) ", exploring starts", ")")
  learner_text(name, x)
}

#' @rdname agent_monte_carlo
#' @export
learn_monte_carlo <- function(env, iterations = NULL, total_steps = NULL, target = NULL,
                              episodes = 10, discount = 0.99, epsilon = 0.1, temperature = NULL,
                              initial = 0, visits = c("first", "every"), exploring_starts = FALSE,
                              learning_rate = NULL, mask = NULL, ...) {
  make_and_train("agent_monte_carlo", rlang::current_env(), ...)
}
