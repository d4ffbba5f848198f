#' Actor-critic, step by step
#'
#' Learn a policy (the actor) and the values of states (the critic) together. A softmax turns the
#' actor's preferences into the probabilities of the actions. A preference rises if its action led
#' to a higher return than the critic expected, and falls if it led to a lower one (Barto, Sutton
#' and Anderson 1983; Sutton and Barto 2018, section 13.5). The actor and the critic have
#' accumulating eligibility traces. `lambda = 0` and `actor_lambda = 0` turn them off.
#'
#' @inheritParams agent_sarsa
#' @param learning_rate How far a value of the critic moves towards its target, a number above 0 and
#'   at most 1, or a function of the steps so far. The default is 0.1.
#' @param actor_rate How far preferences move, a number from 0 to 1 or a function of the steps so
#'   far. The default is 0.1.
#' @param lambda,actor_lambda How slowly the traces of the critic and of the actor fade, numbers
#'   from 0 (the default) to 1.
#' @param initial The first value of all states, a number. The default is 0. Preferences start at 0.
#' @return `agent_actor_critic()` returns an agent of class `gym_agent_actor_critic`.
#'   `learn_actor_critic()` makes this agent, trains it and returns the result of [train_agent()].
#'   Its `$policy` draws each action with the learned probability, and [state_values()] returns the
#'   values of the states.
#' @inheritSection agent_q Errors
#' @references A. G. Barto, R. S. Sutton and C. W. Anderson (1983), Neuronlike adaptive elements
#'   that can solve difficult learning control problems, IEEE Transactions on Systems, Man, and
#'   Cybernetics 13. R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction,
#'   second edition, MIT Press.
#' @seealso [learn_sarsa()], which learns the values of actions
#' @export
#' @examples
#' walk <- gym_model(data.frame(
#'   state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
#'   reward = c(0, 0, 0, 1)
#' ), start = 1)
#' learned <- learn_actor_critic(walk, iterations = 50, seed = 1)
#' predict(learned, 1:2, type = "output")
agent_actor_critic <- function(discount = 0.99, learning_rate = 0.1, actor_rate = 0.1,
                               initial = 0, features = NULL, lambda = 0, actor_lambda = 0) {
  check_number(lambda, min = 0, max = 1)
  check_number(actor_lambda, min = 0, max = 1)
  settings <- list(
    discount = discount, learning_rate = learning_rate, actor_rate = actor_rate,
    temperature = 1, initial = initial, features = features, lambda = lambda,
    actor_lambda = actor_lambda
  )
  check_schedules(settings, "actor_rate", max = 1)
  check_learner(settings)
  new_learner("actor_critic", settings)
}

#' @export
agent_start.gym_agent_actor_critic <- function(agent, policy) {
  agent <- NextMethod()
  # `weights` are those of the critic. The actor's weights are `preferences`.
  columns <- count_actions(agent)
  preferences <- if (!is.null(agent$weights)) matrix(0, nrow(agent$weights), columns)
  possible <- policy$possible
  if (is.null(agent$features) && !is.null(possible)) {
    preferences[!possible & rowSums(possible) > 0] <- -Inf
  }
  agent["preferences"] <- list(preferences)
  agent
}

#' @exportS3Method
learner_of.gym_agent_actor_critic <- function(agent, draw) {
  learning <- learning_of(agent, draw)
  critic <- learning$store
  actor <- value_store(agent$basis, agent$preferences, 0, count_actions(agent))
  discount <- agent$discount
  rate <- rate_of(agent$learning_rate)
  actor_rate <- rate_of(agent$actor_rate, "actor_rate")
  taken <- agent$taken
  each <- critic$each
  sparse <- !is.null(agent$basis$each)
  trace_of <- for_each_sub_env(function() {
    list(
      critic = new_trace(critic, discount * agent$lambda, FALSE, sparse),
      actor = new_trace(actor, discount * agent$actor_lambda, FALSE, sparse)
    )
  })
  act <- function(x) draw_place(softmax(actor$row(x)), draw())
  new_steps(
    agent, learning,
    act = function(x, sub_env, observation) act(x),
    observe = function(x, column, reward, after, terminated, ended, sub_env, observation) {
      traces <- trace_of(sub_env)
      ahead <- if (terminated) 0 else critic$row(after)
      error <- reward + discount * ahead - critic$row(x)
      # The gradient of the action's log-probability by the preferences of all actions.
      towards <- -softmax(actor$row(x))
      towards[[column]] <- towards[[column]] + 1
      gradient <- critic$gradient(x)
      traces$critic$pass(critic$cells(x, 1L), gradient, rate(taken) / each * error)
      columns <- which(towards != 0)
      cells <- unlist(lapply(columns, function(one) actor$cells(x, one)))
      by <- actor_rate(taken) / each * error
      traces$actor$pass(cells, rep(towards[columns], each = length(gradient)) * gradient, by)
      taken <<- taken + 1
      if (ended) {
        traces$critic$clear()
        traces$actor$clear()
        NA_integer_
      } else {
        act(after)
      }
    },
    keeps = function() list(taken = taken, preferences = actor$get()),
    stores = list(actor)
  )
}

softmax <- function(preferences) {
  weight <- exp(preferences - max(preferences))
  weight / sum(weight)
}

#' @export
agent_policy.gym_agent_actor_critic <- function(agent) {
  agent$weights <- agent$preferences
  policy <- weights_policy(agent, count_actions(agent))
  policy$temperature <- 1
  policy
}

#' @export
format.gym_agent_actor_critic <- function(x, ...) {
  traces <- list(lambda = x$lambda, actor_lambda = x$actor_lambda)
  x$temperature <- NULL
  learner_text(
    "Actor-critic", x,
    c(Filter(function(lambda) lambda > 0, traces),
      list(actor_rate = if (is.function(x$actor_rate)) "scheduled" else x$actor_rate))
  )
}

#' @rdname agent_actor_critic
#' @export
learn_actor_critic <- function(env, ...) {
  make_and_train("agent_actor_critic", env, ..., defaults = list(episodes = 10))
}
