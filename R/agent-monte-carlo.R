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

#' @exportS3Method
learner_of.gym_agent_monte_carlo <- function(agent) {
  learning <- learning_of(agent)
  row <- learning$store$row
  choose <- learning$choose
  draw <- learning$uniform$draw
  taken <- agent$taken
  returns <- new_returns(agent, learning$store)
  episode_of <- for_each_sub_env(new_episode)
  starts <- agent$exploring_starts
  new_steps(
    agent, learning,
    begin = function(x, sub_env, observation) {
      values <- row(x)
      if (starts) draw_place(values > -Inf, draw()) else choose(values, taken)
    },
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      episode <- episode_of(sub_env)
      episode$add(x, column, reward)
      taken <<- taken + 1
      if (ended) {
        returns$learn(episode$take(), taken)
        NA_integer_
      } else {
        choose(row(after), taken)
      }
    },
    export = function(agent) {
      agent$taken <- taken
      agent$visited <- returns$visited()
      agent
    }
  )
}

# Keeps the steps of an episode until it has ended.
new_episode <- function() {
  x <- integer()
  column <- integer()
  reward <- numeric()
  count <- 0L
  list(
    add = function(state, action, won) {
      count <<- count + 1L
      x[[count]] <<- state
      column[[count]] <<- action
      reward[[count]] <<- won
    },
    take = function() {
      all <- seq_len(count)
      count <<- 0L
      list(x = x[all], column = column[all], reward = reward[all])
    }
  )
}

#' Keep the means of returns
#' @return A list of functions: `learn(episode, taken)`, of the steps of a whole episode, and
#'   `visited()`, how often each state and action has counted.
#' @noRd
new_returns <- function(agent, store) {
  visited <- agent$visited
  rate <- if (!is.null(agent$learning_rate)) rate_of(agent$learning_rate)
  discount <- agent$discount
  first_only <- agent$visits == "first"
  list(
    learn = function(episode, taken) {
      cell <- store$cells(episode$x, episode$column)
      returns <- discounted_returns(episode$reward, discount)
      counted <- if (first_only) which(!duplicated(cell)) else rev(seq_along(cell))
      for (i in counted) {
        at <- cell[[i]]
        visited[[at]] <<- visited[[at]] + 1
        share <- if (is.null(rate)) 1 / visited[[at]] else rate(taken)
        store$toward(episode$x[[i]], episode$column[[i]], returns[[i]], share)
      }
    },
    visited = function() visited
  )
}

# What followed on each step: its reward, and those after it, discounted.
discounted_returns <- function(rewards, discount) {
  later <- 0
  for (i in rev(seq_along(rewards))) {
    rewards[[i]] <- later <- rewards[[i]] + discount * later
  }
  rewards
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
