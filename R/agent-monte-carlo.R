#' Monte Carlo control
#'
#' Learns the value of each action in each state as the mean of the returns that followed on it, in
#' whole episodes, and acts by these values, exploring (Sutton and Barto 2018, section 5.4). Nothing
#' is learned from an episode before it has ended, and no value rests on another one.
#'
#' In an environment of the server that is named by its id, the server's processes play all episodes
#' of an iteration with the table as it is, and the learner learns from them when they have ended;
#' so give `episodes` in the hundreds. With exploring starts or a `mask` R plays them, in several
#' sub-environments. In a model, or an environment in R, it learns after each episode.
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
    },
    whole = list(
      policy = function() iteration_policy(agent, learning$store$get(), taken),
      learn = function(x, column, reward, episode) {
        taken <<- taken + length(reward)
        returns$learn_many(x, column, reward, episode, taken)
      }
    )
  )
}

# The policy that plays an iteration. Of actions with equal values one is drawn for it.
iteration_policy <- function(agent, weights, taken) {
  heat <- agent$temperature
  if (is.null(heat)) {
    best <- best_column(ifelse(weights == row_max(weights), stats::runif(length(weights)), -1))
    weights[] <- ifelse(weights == -Inf, -Inf, 0)
    weights[cbind(seq_along(best), best)] <- 1
  } else {
    heat <- scheduled(heat, taken, "temperature", lowest_temperature, Inf)
  }
  # A state without an action is an end, where none is taken.
  weights[row_max(weights) == -Inf, ] <- 0
  policy <- policy_table(weights, rate_of(agent$epsilon, "epsilon")(taken), heat)
  policy[c("observation_space", "action_space")] <- agent$spaces
  policy
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
#' @return A list of functions: `learn(episode, taken)`, of the steps of a whole episode;
#'   `learn_many()`, of the steps of several, `episode` being the number of each step's; and
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
    learn_many = function(x, column, reward, episode, taken) {
      cell <- store$cells(x, column)
      returns <- discounted_returns(reward, discount, episode)
      if (first_only) {
        counted <- !duplicated(cell + length(visited) * (episode - 1))
        cell <- cell[counted]
        returns <- returns[counted]
      }
      if (is.null(rate)) {
        sums <- rowsum(cbind(returns, 1), cell)
        own <- as.double(rownames(sums))
        visited[own] <<- visited[own] + sums[, 2L]
        before <- store$get()[own]
        store$add(own, (sums[, 1L] - sums[, 2L] * before) / visited[own])
      } else {
        share <- rate(taken)
        for (i in seq_along(cell)) {
          store$add(cell[[i]], share * (returns[[i]] - store$get()[[cell[[i]]]]))
        }
        visited[] <<- visited + tabulate(cell, length(visited))
      }
    },
    visited = function() visited
  )
}

# What followed on each step: its reward, and those after it, discounted.
discounted_returns <- function(rewards, discount, episode = rep(1L, length(rewards))) {
  later <- 0
  own <- 0L
  for (i in rev(seq_along(rewards))) {
    if (episode[[i]] != own) {
      own <- episode[[i]]
      later <- 0
    }
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
