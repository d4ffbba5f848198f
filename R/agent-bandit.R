#' Learn in a bandit
#'
#' Let many learners play a bandit, each with its own arms, and record the mean of their rewards in
#' each step. This is the ten-armed testbed of Sutton and Barto (2018, section 2.3). The learners
#' are independent. They play together only because that is faster.
#'
#' | `method` | which arm it takes | section |
#' |---|---|---|
#' | `"epsilon_greedy"` | the largest mean reward so far; any with probability `epsilon` | 2.2 |
#' | `"ucb"` | the largest upper confidence bound | 2.7 |
#' | `"gradient"` | drawn by a softmax of preferences | 2.8 |
#' | `"linucb"` | the largest upper confidence bound of a linear model of the context | Li 2010 |
#' | `"thompson"` | the best by a draw from the posterior of such a model | Agrawal and Goyal 2013 |
#'
#' The upper confidence bound of an arm that was taken `n` times in `t` steps is its mean reward
#' plus `confidence` times `sqrt(log(t) / n)`. Each arm is taken once first. Preferences rise with
#' rewards above the mean.
#'
#' Ties are broken at random.
#'
#' # Contexts
#'
#' `"linucb"` and `"thompson"` have a linear model of the context for every action (with a ridge of
#' 1). They learn in an environment, whose observations are the contexts: a Box gives numbers, and
#' each value of a Discrete or MultiDiscrete has a weight of its own. They also learn from logged
#' steps, each of which has a context (the state), an action and a reward. Logged data is replayed
#' (Li 2011): in each row the learner sees the context and chooses an action. If this is the action
#' of the data, the learner sees the reward and learns from it. Otherwise it skips the row. If the
#' actions of the data were drawn with equal probabilities, the mean of the rewards that it sees
#' estimates what it would have got by itself. If the data has the column `probability`, each row is
#' used with a probability proportional to 1 / `probability`, as if all actions had been equally
#' likely.
#'
#' @param env A bandit made by [bandit()]. For a method with contexts an environment with countable
#'   actions, its id or an object of [gym_make()] or [gym_env()]; or logged steps, as for
#'   [learn_fitted_q()].
#' @param method The method, a string.
#' @param epsilon The probability of exploring, a number from 0 to 1. The default is 0.1.
#' @param confidence How much `"ucb"` and `"linucb"` favour arms that were seldom taken, and the
#'   standard deviation of a reward for `"thompson"`, a number of at least 0. The default is 2, and
#'   1 with contexts.
#' @param learning_rate How far a value or a preference moves towards its target, a number above 0.
#'   `NULL`, the default, uses the mean of all rewards, and 0.1 for `"gradient"`.
#' @param initial The first value of all arms, a number. The default is 0. With a constant
#'   `learning_rate`, a large value makes the learner try all arms (section 2.6).
#' @param baseline What does `"gradient"` compare rewards with? `TRUE`, the default, for the mean
#'   reward so far, `FALSE` for 0.
#' @param learners The number of learners, a whole number of at least 1. The default is 2,000.
#' @param horizon The number of steps, a whole number. `NULL`, the default, plays one episode of the
#'   bandit, and 1,000 steps with contexts. If you interrupt these steps, the call returns what was
#'   learned until then. Logged data ignores `horizon`.
#' @param seed A whole number that fixes all random numbers, as for [rollout()].
#' @return An object of class `gym_bandit_learning`, with methods for [print()], [as.data.frame()]
#'   and [plot()][plot.gym_bandit_learning()]. It is a list with the elements `curve`, a data frame
#'   of `step` (integer), `mean_reward` (the mean over the learners) and `best_share` (the share of
#'   learners that took an arm with the largest mean reward, from 0 to 1); `values`, a matrix with a
#'   row for each learner and a column for each arm, holding the final values or preferences; and
#'   `label`, `learners` and `seed`.
#'
#'   With contexts it is one learner. `curve` then has a row for each step that it saw, with the
#'   mean of all rewards until then, and there are the further elements `reward` and `se` (the mean
#'   of the rewards that it saw, and its standard error), `seen` and `rows` (their number, and that
#'   of the data's rows), and `policy`, which takes the best action by the final models.
#' @section Errors: `gym_error_argument`.
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press, chapter 2. L. Li, W. Chu, J. Langford, R. Schapire (2010), A
#'   contextual-bandit approach to personalized news article recommendation, WWW. L. Li et al.
#'   (2011), Unbiased offline evaluation of contextual-bandit-based news article recommendation
#'   algorithms, WSDM. S. Agrawal, N. Goyal (2013), Thompson sampling for contextual bandits with
#'   linear payoffs, ICML.
#' @export
#' @examples
#' testbed <- bandit(arms = 10)
#' greedy <- learn_bandit(testbed, epsilon = 0, learners = 200, seed = 1)
#' explores <- learn_bandit(testbed, epsilon = 0.1, learners = 200, seed = 1)
#' explores
#' plot(greedy, explores)
#'
#' # A shop that shows one of two pictures: older visitors prefer the second.
#' shop <- gym_env(
#'   reset = function(self) self$age <- runif(1),
#'   step = function(self, action) {
#'     clicks <- runif(1) < if (action == 1) self$age else 0.5
#'     list(observation = self$age, reward = as.numeric(clicks), terminated = TRUE)
#'   },
#'   observation_space = space_box(0, 1), action_space = space_discrete(2), id = "Shop"
#' )
#' learned <- learn_bandit(shop, "linucb", horizon = 300, seed = 1)
#' learned
#' predict(learned$policy, c(0.1, 0.9))
#'
#' # Logged clicks: a learner replays them.
#' set.seed(1)
#' clicks <- data.frame(episode = 1:2000, age = runif(2000), action = sample(0:1, 2000, TRUE))
#' clicks$reward <- rbinom(2000, 1, ifelse(clicks$action == 1, clicks$age, 0.5))
#' learn_bandit(clicks, "linucb", seed = 1)
learn_bandit <- function(env,
                         method = c("epsilon_greedy", "ucb", "gradient", "linucb", "thompson"),
                         epsilon = 0.1, confidence = NULL, learning_rate = NULL, initial = 0,
                         baseline = TRUE, learners = 2000, horizon = NULL, seed = NULL) {
  contextual <- c("linucb", "thompson")
  problem <- if (inherits(env, "gym_r_env")) bandit_of(env)
  if (method[1L] %in% contextual) {
    check_number(confidence, min = 0, allow_null = TRUE)
    check_count(horizon, allow_null = TRUE)
    check_seed(seed)
    call <- rlang::current_env()
    confidence <- confidence %||% 1
    seed <- seed %||% draw_seed()
    if (is.data.frame(env) || inherits(env, "gym_rollout")) {
      return(replay_bandit(env, method[1L], confidence, seed, call))
    }
    if (rlang::is_string(env) || inherits(env, "gym_env") && is.null(problem)) {
      return(live_bandit(env, method[1L], confidence, horizon %||% 1000L, seed, call))
    }
    abort_argument(env, "an environment with contexts, or logged steps", "env", call)
  }
  confidence <- confidence %||% 2
  if (is.null(problem)) {
    hint <- if (is.data.frame(env)) {
      "To learn from logged data, use `method = \"linucb\"` or `\"thompson\"`."
    }
    abort_argument(env, "a bandit made by `bandit()`", "env", rlang::current_env(), hint)
  }
  choices <- c("epsilon_greedy", "ucb", "gradient", contextual)
  method <- check_choice(method[1L], choices, arg = "method")
  check_number(epsilon, min = 0, max = 1)
  check_number(confidence, min = 0)
  if (!is.null(learning_rate)) check_above_zero(learning_rate)
  check_number(initial)
  check_flag(baseline)
  check_count(learners)
  check_count(horizon, allow_null = TRUE)
  check_seed(seed)
  horizon <- horizon %||% env$spec$max_episode_steps
  seed <- seed %||% draw_seed()
  rule <- list(
    method = method, epsilon = epsilon, confidence = confidence, learning_rate = learning_rate,
    baseline = baseline
  )
  played <- with_generator(
    new_generator(seed), play_bandits(problem, rule, initial, as.integer(learners), horizon)
  )
  structure(
    c(played, list(label = bandit_text(rule, initial), learners = learners, seed = seed,
                   env_id = env$spec$id)),
    class = "gym_bandit_learning"
  )
}

play_bandits <- function(problem, rule, initial, learners, horizon) {
  means <- draw_means(problem, learners)
  values <- matrix(as.double(initial), learners, problem$arms)
  taken <- matrix(0, learners, problem$arms)
  mean_so_far <- numeric(learners)
  mean_reward <- best_share <- numeric(horizon)
  for (step in seq_len(horizon)) {
    arm <- choose_arms(rule, values, taken, step)
    at <- cbind(seq_len(learners), arm)
    best_share[[step]] <- mean(means[at] >= row_max(means))
    paid <- pull(problem, means, arm)
    means <- paid$means
    mean_reward[[step]] <- mean(paid$reward)
    taken[at] <- taken[at] + 1
    if (rule$method == "gradient") {
      # The mean of all rewards up to this one.
      mean_so_far <- mean_so_far + (paid$reward - mean_so_far) / step
      above <- paid$reward - if (rule$baseline) mean_so_far else 0
      step_up <- -softmax_rows(values)
      step_up[at] <- step_up[at] + 1
      values <- values + (rule$learning_rate %||% 0.1) * above * step_up
    } else {
      rate <- rule$learning_rate %||% (1 / taken[at])
      values[at] <- values[at] + rate * (paid$reward - values[at])
    }
  }
  list(
    curve = data.frame(
      step = seq_len(horizon), mean_reward = mean_reward, best_share = best_share
    ),
    values = values
  )
}

choose_arms <- function(rule, values, taken, step) {
  n <- nrow(values)
  if (rule$method == "gradient") {
    return(draw_by_row(softmax_rows(values)))
  }
  if (rule$method == "ucb") {
    values <- values + rule$confidence * sqrt(log(step) / taken)
    # Take an arm that was never taken before any other.
    values[taken == 0] <- Inf
  }
  arm <- any_best_column(values)
  if (rule$method == "epsilon_greedy" && rule$epsilon > 0) {
    explores <- stats::runif(n) < rule$epsilon
    arm[explores] <- sample.int(ncol(values), sum(explores), replace = TRUE)
  }
  arm
}

bandit_text <- function(rule, initial) {
  parts <- c(
    switch(
      rule$method,
      epsilon_greedy = paste("epsilon", number_text(rule$epsilon)),
      ucb = paste("UCB, confidence", number_text(rule$confidence)),
      gradient = paste0("gradient", if (!rule$baseline) " without baseline")
    ),
    if (!is.null(rule$learning_rate)) paste("learning_rate", number_text(rule$learning_rate)),
    if (initial != 0) paste("initial", number_text(initial))
  )
  paste(parts, collapse = ", ")
}

#' @export
print.gym_bandit_learning <- function(x, ...) {
  if (!is.null(x$policy)) {
    return(print_lines(x, c(
      paste0("A learner in ", x$env_id, ": ", x$label),
      paste0("It saw ", count_of(x$seen, "step"),
             if (x$rows > x$seen) paste(" of", whole_number_text(x$rows)),
             ": mean reward ", number_text(x$reward), se_text(x$se))
    )))
  }
  last <- utils::tail(x$curve, 100L)
  print_lines(x, c(
    paste0(count_of(x$learners, "learner"), " in ", x$env_id, ": ", x$label),
    paste0("Last ", count_of(nrow(last), "step"), " of ", number_text(nrow(x$curve)),
           ": mean reward ", number_text(mean(last$mean_reward)), ", the best arm in ",
           percent_text(mean(last$best_share)))
  ))
}

#' @export
as.data.frame.gym_bandit_learning <- function(x, row.names = NULL, optional = FALSE, ...) x$curve
