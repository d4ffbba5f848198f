#' Q-learning
#'
#' Learn the value of each action in each state. After each step, a value moves towards the reward
#' plus the discounted value of the best action in the next state (Watkins 1989; Sutton and Barto
#' 2018, section 6.5).
#'
#' `double = TRUE` keeps two tables. One table chooses the best action and the other one gives its
#' value, which avoids overestimated values (van Hasselt 2010; section 6.7). With `planning`, the
#' agent remembers the last outcome of each state and action, and learns from some of these outcomes
#' after each step (Dyna-Q; section 8.2).
#'
#' For actions of several parts (MultiDiscrete, MultiBinary, and Tuple or Dict of these) the table
#' has a column for each combination, as in [policy_table()]. The actions that are played have all
#' parts.
#'
#' During learning, the agent draws among actions with equal values. The policy that it returns
#' takes the first of them. If the model is known, the agent never takes an action that a state does
#' not have.
#'
#' If the model of the environment is known (see [env_model()]), the policy is evaluated exactly,
#' without playing. The evaluations then have 0 episodes and a standard error of 0.
#'
#' @param discount The discount, a number above 0 and at most 1. The default is 0.99.
#' @param learning_rate How far a value moves towards its target, a number above 0 and at most 1, or
#'   a function of the steps so far, such as [schedule_linear()]. With tiles the value moves by this
#'   share for any number of tilings. With a function as `features` it moves by this share times the
#'   sum of the squared features.
#' @param epsilon The probability of exploring, a number from 0 to 1, or a function of the steps so
#'   far.
#' @param temperature The temperature of softmax exploration, which replaces `epsilon`, a number
#'   above 0 or a function of the steps so far. `NULL`, the default, for none. See [policy_table()].
#' @param initial The first value of all actions, a number. The default is 0. A large value makes
#'   the agent try everything ("optimistic"). With a function as `features`, `initial` is the first
#'   weight of all features, or a number for each.
#' @param features `NULL`, the default, for a table with a row for each state; the result of
#'   [tile_coding()]; or a function of a batch of observations that returns a numeric matrix with a
#'   row of features for each observation.
#' @param double Double Q-learning? `FALSE`, the default, or `TRUE`.
#' @param planning The number of remembered steps to learn from after each real one, a whole number.
#'   For tables only. The default is 0.
#' @param bonus A number such as 0.001. Planning adds it, times the square root of k, to the reward
#'   of an action that was last taken k steps ago (Dyna-Q+; section 8.3). Planning then includes
#'   actions that were never taken in a visited state, as if they led back to this state without a
#'   reward. The default is 0, for none.
#' @param mask The name of the element of the info that says at each step which actions are valid,
#'   such as `"action_mask"` of Taxi. It has a number for each action (for each combination of its
#'   parts), 0 for an invalid one. The agent never takes an action again at an observation where it
#'   was marked invalid, and its value is `-Inf`. For tables only. `NULL`, the default, for none.
#' @param env The environment, as for [train_agent()]. If it is an id with a row in
#'   [agent_presets()], that row supplies the settings that you do not give. A message says so.
#'   `learn_q()` also takes logged steps, as for [learn_fitted_q()]. It then sweeps over all pairs
#'   of a state and an action in the data until no value changes (batch Q-learning). Its only other
#'   arguments are then `discount`, `double` and `iterations`, the largest number of sweeps.
#' @param ... Arguments of the agent, as above; of [train_agent()], such as `iterations` or
#'   `total_steps`, of which one is needed without a preset, `episodes` (in an iteration, 10 by
#'   default), `target` or `seed`; and of the environment, such as `is_slippery = FALSE`.
#' @return `agent_q()` returns an agent of class `gym_agent_q`. `learn_q()` makes this agent, trains
#'   it and returns the result of [train_agent()]. Its `$policy` takes the action with the largest
#'   value, and [state_values()] returns the values. From data it returns a policy, as
#'   [learn_fitted_q()] does.
#' @section Errors: `gym_error_argument` for an invalid argument, or actions or observations that do
#'   not fit a table.
#' @references C. Watkins (1989), Learning from Delayed Rewards, PhD thesis, Cambridge. H. van
#'   Hasselt (2010), Double Q-learning, NeurIPS 23. R. S. Sutton and A. G. Barto (2018),
#'   Reinforcement Learning: An Introduction, second edition, MIT Press.
#' @seealso [learn_sarsa()], [learn_monte_carlo()], [learn_td()]; [agent_observe()] explains what a
#'   learner is.
#' @export
#' @examples
#' agent_q(epsilon = schedule_linear(1, 0.05, duration = 5000))
#' @examplesIf gym:::can_start_server()
#' learned <- learn_q("FrozenLake-v1", iterations = 20, seed = 1, is_slippery = FALSE, initial = 1)
#' learned
agent_q <- function(discount = 0.99, learning_rate = 0.1, epsilon = 0.1, temperature = NULL,
                    initial = 0, features = NULL, double = FALSE, planning = 0, bonus = 0,
                    mask = NULL) {
  check_flag(double)
  check_count(planning, min = 0)
  check_number(bonus, min = 0)
  settings <- mget(names(formals()))
  settings$planning <- as.integer(planning)
  check_learner(settings)
  abort_if(
    bonus > 0 && planning == 0, "bonus", bonus, rlang::current_env(),
    "`bonus` is added to the rewards of planning: give `planning`, too."
  )
  abort_if(
    planning > 0 && (double || !is.null(features)), "planning", planning, rlang::current_env(),
    "`planning` is for a single table, not for features or double Q-learning."
  )
  new_learner("q", settings)
}

#' @export
agent_start.gym_agent_q <- function(agent, policy) {
  agent <- NextMethod()
  agent$second <- if (agent$double) agent$weights
  agent$memory <- list(pair = integer(), outcome = NULL)
  agent
}

#' @exportS3Method
learner_of.gym_agent_q <- function(agent, draw) {
  if (agent$double) {
    return(double_steps(agent, draw))
  }
  learning <- learning_of(agent, draw)
  row <- learning$store$row
  choose <- learning$choose
  toward <- learning$store$toward
  discount <- agent$discount
  rate <- agent$learning_rate
  # Read a constant rate only once: a call would take a tenth of a step's time.
  changes <- is.function(rate)
  share <- if (changes) 0 else rate
  taken <- agent$taken
  memory <- if (agent$planning > 0L) new_planning_memory(agent, learning$store)
  # If this is TRUE, a step changes only values of its own state.
  own_row <- identical(agent$basis$each, 1L) && is.null(memory)
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) choose(row(x), taken),
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      values <- row(after)
      ahead <- if (terminated) 0 else max(values)
      if (changes) share <<- scheduled(rate, taken, "learning_rate")
      toward(x, column, reward + discount * ahead, share)
      taken <<- taken + 1
      if (!is.null(memory)) {
        memory$remember(x, column, reward, after, terminated, taken)
        # Planned steps are not steps of the environment: schedules do not advance.
        memory$plan(taken)
      }
      if (ended) return(NA_integer_)
      if (!own_row || x == after) values <- row(after)
      choose(values, taken)
    },
    keeps = function() c(list(taken = taken), if (!is.null(memory)) list(memory = memory$get()))
  )
}

# A coin decides for each step which of the two tables learns from it. That table chooses the best
# next action; the other one values it.
double_steps <- function(agent, draw) {
  learning <- learning_of(agent, draw)
  first <- learning$store
  second <- value_store(agent$basis, agent$second, agent$initial, value_columns_of(agent))
  choose <- learning$choose
  rate <- rate_of(agent$learning_rate)
  discount <- agent$discount
  taken <- agent$taken
  both <- function(x) (first$row(x) + second$row(x)) / 2
  learn <- function(own, other, x, column, reward, after, terminated) {
    ahead <- if (terminated) 0 else other$value(after, which.max(own$row(after)))
    own$toward(x, column, reward + discount * ahead, rate(taken))
  }
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) choose(both(x), taken),
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      if (draw() < 0.5) {
        learn(first, second, x, column, reward, after, terminated)
      } else {
        learn(second, first, x, column, reward, after, terminated)
      }
      taken <<- taken + 1
      if (ended) NA_integer_ else choose(both(after), taken)
    },
    keeps = function() list(taken = taken, second = second$get()),
    stores = list(first, second)
  )
}

#' Remember the last outcome of each state and action, and learn from these again
#' @return A list of functions: `remember()` a step, `plan(taken)`, and `get()`, the memory in the
#'   form that the agent keeps.
#' @noRd
new_planning_memory <- function(agent, store) {
  rows <- nrow(agent$weights)
  columns <- ncol(agent$weights)
  count <- length(agent$memory$pair)
  pairs <- agent$memory$pair
  outcome <- agent$memory$outcome
  if (is.null(outcome)) outcome <- matrix(NA_real_, rows * columns, 4L)
  reward <- outcome[, 1L]
  led_to <- outcome[, 2L]
  over <- outcome[, 3L]
  tried <- outcome[, 4L]
  bonus <- agent$bonus
  enter <- function(pair, won, after, terminated, taken) {
    if (is.na(reward[[pair]])) {
      count <<- count + 1L
      pairs[[count]] <<- pair
    }
    reward[[pair]] <<- won
    led_to[[pair]] <<- after
    over[[pair]] <<- terminated
    tried[[pair]] <<- taken
  }
  discount <- agent$discount
  rate <- rate_of(agent$learning_rate)
  list(
    remember = function(x, column, won, after, terminated, taken) {
      if (bonus > 0) {
        for (other in which(store$row(x) > -Inf)) {
          pair <- x + rows * (other - 1L)
          # Enter the action as if it had been tried when training began.
          if (is.na(reward[[pair]])) enter(pair, 0, x, FALSE, 0)
        }
      }
      enter(x + rows * (column - 1L), won, after, terminated, taken)
    },
    plan = function(taken) {
      rate <- rate(taken)
      for (pair in pairs[sample.int(count, agent$planning, replace = TRUE)]) {
        ahead <- if (over[[pair]] == 1) 0 else max(store$row(led_to[[pair]]))
        x <- (pair - 1L) %% rows + 1L
        won <- reward[[pair]]
        if (bonus > 0) won <- won + bonus * sqrt(taken - tried[[pair]])
        store$toward(x, (pair - 1L) %/% rows + 1L, won + discount * ahead, rate)
      }
    },
    get = function() {
      list(pair = pairs, outcome = cbind(reward, led_to, over, tried, deparse.level = 0))
    }
  )
}

#' @export
format.gym_agent_q <- function(x, ...) {
  plans <- x$planning > 0L
  curious <- plans && x$bonus > 0
  name <- if (x$double) "Double Q-learning" else if (plans) "Dyna-Q" else "Q-learning"
  learner_text(paste0(name, if (curious) "+"), x, x[c(if (plans) "planning", if (curious) "bonus")])
}

#' @rdname agent_q
#' @export
learn_q <- function(env, ...) {
  if (!is.data.frame(env) && !inherits(env, "gym_rollout")) {
    return(make_and_train("agent_q", env, ..., defaults = list(episodes = 10)))
  }
  call <- rlang::current_env()
  given <- list(...)
  # Learning from data plays nothing, so most arguments do not apply.
  unfit <- setdiff(rlang::names2(given), c("discount", "double", "iterations"))
  abort_if(
    length(unfit),
    unfit[[1L]], NULL, call, "From data `learn_q()` has no argument `{unfit[[1L]]}`.",
    i = "It takes `discount`, `double` and `iterations`."
  )
  discount <- given[["discount"]] %||% 0.99
  double <- given[["double"]] %||% FALSE
  iterations <- given[["iterations"]]
  check_discount(discount)
  check_flag(double)
  check_count(iterations, allow_null = TRUE)
  learn_table(env, discount, double, iterations, call)
}
