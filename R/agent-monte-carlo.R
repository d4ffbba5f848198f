#' Monte Carlo control
#'
#' Learn the value of each action in each state as the mean of the returns that followed it, and act
#' by these values with exploration (Sutton and Barto 2018, section 5.4). The agent learns from an
#' episode only after its end, from rewards alone: no value depends on another value.
#'
#' If you give `env` by its id, the server's processes play all episodes of an iteration with the
#' same table, and the agent learns from them afterwards. With exploring starts or a `mask`, R plays
#' the episodes in several sub-environments. In a model or an environment in R, the agent learns
#' after each episode.
#'
#' With `exploring_starts = TRUE` the first action of each episode is drawn uniformly from all
#' actions (section 5.3). The environment draws the first state.
#'
#' An episode that a step limit cuts off counts as one that ends there: the rewards that it would
#' still have earned count as 0.
#'
#' @inheritParams agent_q
#' @param initial The first value of all actions, a number. The default is 0. A number above all
#'   returns makes the agent try everything ("optimistic").
#' @param ... As for [learn_q()]. The default of `episodes` is 1,000 if the server's processes play
#'   them, and 10 otherwise.
#' @param visits Which visits of a state and action count: `"first"`, the default, for the first one
#'   in each episode, or `"every"`.
#' @param exploring_starts Draw the first action of each episode? `FALSE`, the default, or `TRUE`.
#' @param learning_rate `NULL`, the default, for the plain mean of all returns. A number above 0
#'   and at most 1, or a function of the steps so far, gives later returns more weight.
#' @param importance `"none"`, the default, learns the values of the policy that plays, exploration
#'   included. `"weighted"` and `"ordinary"` learn the values of a policy that does not explore,
#'   from episodes of a policy that does, by importance sampling (off-policy learning; sections 5.5
#'   to 5.7). `"weighted"` divides by the sum of the weights and `"ordinary"` by the number of
#'   returns. Every visit counts.
#' @param target_policy The policy whose values `importance` learns, a [policy_table()]. The same
#'   policy plays, but explores with `epsilon`; with `epsilon = 1` it is a random policy. `NULL`,
#'   the default, uses the best policy so far.
#' @return `agent_monte_carlo()` returns an agent of class `gym_agent_monte_carlo`.
#'   `learn_monte_carlo()` makes this agent, trains it and returns the result of [train_agent()].
#' @inheritSection agent_q Errors
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @seealso [learn_q()], [learn_sarsa()]
#' @export
#' @examples
#' agent_monte_carlo(discount = 1)
#' @examplesIf gym:::can_start_server()
#' learn_monte_carlo("Blackjack-v1", iterations = 2, discount = 1, seed = 1, sab = TRUE)
agent_monte_carlo <- function(discount = 0.99, epsilon = 0.1, temperature = NULL, initial = 0,
                              visits = c("first", "every"), exploring_starts = FALSE,
                              learning_rate = NULL, mask = NULL,
                              importance = c("none", "weighted", "ordinary"),
                              target_policy = NULL) {
  call <- rlang::current_env()
  importance <- check_choice(importance[1L], c("none", "weighted", "ordinary"), "importance", call)
  abort_if(
    importance == "none" && !is.null(target_policy), "target_policy", target_policy, call,
    "`target_policy` needs `importance`, because another policy plays the episodes."
  )
  if (!is.null(target_policy) && !inherits(target_policy, "gym_policy_table")) {
    must <- "a table, whose probabilities are known, or NULL"
    abort_argument(target_policy, must, "target_policy", call)
  }
  explores_else <- !is.null(temperature) || isTRUE(exploring_starts) || !is.null(learning_rate)
  abort_if(
    importance != "none" && explores_else, "importance", importance, call,
    "`importance` works with `epsilon` only: leave out `temperature`, `exploring_starts` and
     `learning_rate`."
  )
  visits <- check_choice(visits[1L], c("first", "every"), arg = "visits")
  check_flag(exploring_starts)
  settings <- list(
    discount = discount, learning_rate = learning_rate, epsilon = epsilon,
    temperature = temperature, initial = initial, features = NULL, visits = visits,
    exploring_starts = exploring_starts, mask = mask, importance = importance,
    learns = target_policy
  )
  check_learner(settings[!vapply(settings, is.null, NA)])
  new_learner("monte_carlo", settings)
}

#' @export
agent_start.gym_agent_monte_carlo <- function(agent, policy) {
  agent <- NextMethod()
  if (!is.null(agent$learns)) agent$learns <- policy_bind(agent$learns, policy)
  agent$visited <- array(0, dim(agent$weights))
  agent
}

#' @exportS3Method
learner_of.gym_agent_monte_carlo <- function(agent, draw) {
  learning <- learning_of(agent, draw)
  row <- learning$store$row
  taken <- agent$taken
  episode_of <- for_each_sub_env(new_episode)
  own <- if (agent$importance == "none") {
    on_policy(agent, learning)
  } else {
    off_policy(agent, learning, draw)
  }
  choose <- own$choose
  starts <- agent$exploring_starts
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) {
      if (starts) draw_place(row(x) > -Inf, draw()) else choose(x, sub_env, taken)
    },
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      episode <- episode_of(sub_env)
      episode$add(x, column, reward)
      taken <<- taken + 1
      if (ended) {
        own$learn(episode$take(), sub_env, taken)
        NA_integer_
      } else {
        choose(after, sub_env, taken)
      }
    },
    keeps = function() list(taken = taken, visited = own$visited())
  )
}

#' Learn the means of returns
#' @return A list of functions: `choose(x, sub_env, taken)` chooses an action;
#'   `learn(episode, sub_env, taken)` learns from the steps of a whole episode; `visited()` returns
#'   how often each state and action has counted.
#' @noRd
on_policy <- function(agent, learning) {
  store <- learning$store
  visited <- agent$visited
  rate <- if (!is.null(agent$learning_rate)) rate_of(agent$learning_rate)
  list(
    choose = function(x, sub_env, taken) learning$choose(store$row(x), taken),
    learn = function(episode, sub_env, taken) {
      cell <- store$cells(episode$x, episode$column)
      returns <- sum_backwards(episode$reward, agent$discount)
      first <- agent$visits == "first"
      for (i in if (first) which(!duplicated(cell)) else rev(seq_along(cell))) {
        at <- cell[[i]]
        visited[[at]] <<- visited[[at]] + 1
        share <- if (is.null(rate)) 1 / visited[[at]] else rate(taken)
        store$toward(episode$x[[i]], episode$column[[i]], returns[[i]], share)
      }
    },
    visited = function() visited
  )
}

#' Learn the values of a policy that does not explore, from episodes of one that does
#'
#' The weight of a return is the ratio of two probabilities of the actions that followed: by the
#' policy that is learned, and by the policy that played (Sutton and Barto 2018, section 5.7). The
#' probabilities are those at the time of the action.
#' @return As [on_policy()]; `visited()` returns the sums of weights.
#' @noRd
off_policy <- function(agent, learning, draw) {
  store <- learning$store
  visited <- agent$visited
  weighted <- agent$importance == "weighted"
  epsilon <- rate_of(agent$epsilon, "epsilon")
  probabilities <- if (!is.null(agent$learns)) table_probabilities(agent$learns)
  ratios <- for_each_sub_env(new_episode)
  list(
    choose = function(x, sub_env, taken) {
      values <- store$row(x)
      wanted <- if (is.null(probabilities)) {
        replace(numeric(length(values)), which.max(values), 1)
      } else {
        probabilities[x, ]
      }
      possible <- values > -Inf
      explores <- epsilon(taken)
      plays <- (1 - explores) * wanted + explores * possible / sum(possible)
      column <- draw_place(plays, draw())
      ratios(sub_env)$add(0L, 0L, wanted[[column]] / plays[[column]])
      column
    },
    learn = function(episode, sub_env, taken) {
      ratio <- ratios(sub_env)$take()$reward
      cell <- store$cells(episode$x, episode$column)
      returns <- sum_backwards(episode$reward, agent$discount)
      weight <- 1
      for (i in rev(seq_along(cell))) {
        at <- cell[[i]]
        counts <- if (weighted) weight else 1
        if (counts > 0) {
          visited[[at]] <<- visited[[at]] + counts
          goal <- if (weighted) returns[[i]] else weight * returns[[i]]
          store$toward(episode$x[[i]], episode$column[[i]], goal, counts / visited[[at]])
        }
        weight <- weight * ratio[[i]]
      }
    },
    visited = function() visited
  )
}

#' @export
agent_policy.gym_agent_monte_carlo <- function(agent) {
  if (is.null(agent$learns)) NextMethod() else agent$learns
}

# Learning from the episodes of an iteration ----------------------------------------------

#' @export
agent_needs.gym_agent_monte_carlo <- function(agent) c("returns", "trajectories")

# If actions have equal values, draws one of them.
#' @export
agent_behavior.gym_agent_monte_carlo <- function(agent) {
  if (!plays_whole(agent)) {
    return(NextMethod())
  }
  weights <- agent$weights
  heat <- agent$temperature
  if (is.null(heat)) {
    best <- any_best_column(weights)
    weights[] <- ifelse(weights == -Inf, -Inf, 0)
    weights[cbind(seq_along(best), best)] <- 1
  } else {
    heat <- scheduled(heat, agent$taken, "temperature", lowest_temperature, Inf)
  }
  # A state without actions is an end, where no action is taken.
  weights[row_max(weights) == -Inf, ] <- 0
  policy <- policy_table(weights, rate_of(agent$epsilon, "epsilon")(agent$taken), heat)
  policy[c("observation_space", "action_space")] <- agent$spaces
  policy
}

#' @export
agent_tell.gym_agent_monte_carlo <- function(agent, results) {
  steps <- results$trajectories
  n <- length(steps$reward)
  agent$taken <- agent$taken + n
  cell <- agent$basis$of(steps$observation, n)[, 1L] +
    nrow(agent$weights) * (space_index(agent$spaces$action_space)$index(steps$action, n) - 1)
  returns <- sum_backwards(steps$reward, agent$discount, ends_of(steps$episode))
  if (agent$visits == "first") {
    counted <- !duplicated(cell + length(agent$weights) * (steps$episode - 1))
    cell <- cell[counted]
    returns <- returns[counted]
  }
  if (is.null(agent$learning_rate)) {
    # Add all returns at once: the last bit of a sum must not depend on how episodes were divided
    # into requests.
    sums <- rowsum(cbind(returns, 1), cell)
    own <- as.double(rownames(sums))
    agent$visited[own] <- agent$visited[own] + sums[, 2L]
    missed <- sums[, 1L] - sums[, 2L] * agent$weights[own]
    agent$weights[own] <- agent$weights[own] + missed / agent$visited[own]
  } else {
    share <- rate_of(agent$learning_rate)(agent$taken)
    weights <- agent$weights
    for (i in seq_along(cell)) {
      at <- cell[[i]]
      weights[[at]] <- weights[[at]] + share * (returns[[i]] - weights[[at]])
    }
    agent$weights <- weights
    agent$visited[] <- agent$visited + tabulate(cell, length(weights))
  }
  agent
}

# Learning after each episode ---------------------------------------------------------------

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

#' @export
format.gym_agent_monte_carlo <- function(x, ...) {
  how <- if (x$importance == "none") {
    paste0(x$visits, " visits", if (x$exploring_starts) ", exploring starts")
  } else {
    paste(x$importance, "importance sampling")
  }
  learner_text(paste0("Monte Carlo (", how, ")"), x)
}

#' @rdname agent_monte_carlo
#' @export
learn_monte_carlo <- function(env, ...) {
  make_and_train(
    "agent_monte_carlo", env, ..., defaults = list(episodes = default_episodes(env, list(...)))
  )
}

# If the server's processes play the episodes, each iteration needs a request, so it has more
# episodes.
default_episodes <- function(env, given) {
  on_server <- rlang::is_string(env) && !is_registered(env) && !grepl(modelled_ids, env)
  whole <- learns_whole(given[["mask"]], given[["exploring_starts"]], given[["importance"]])
  if (on_server && whole) 1000 else 10
}
