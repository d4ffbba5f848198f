#' Make a bandit
#'
#' A bandit has arms, each of which pays a reward from its own normal distribution (Sutton and Barto
#' 2018, chapter 2). The observation is always 0, and an action is the number of an arm, from 0.
#' Unless you give the means, each episode draws new ones. This is the testbed of section 2.3.
#'
#' @param arms The number of arms, a whole number of at least 1. The default is 10, or the number of
#'   means given.
#' @param mean The mean reward of each arm, a numeric vector. `NULL`, the default, draws them from
#'   the normal distribution with mean `centre` and standard deviation 1.
#' @param sd The standard deviation of rewards around the mean, a number of at least 0.
#' @param centre The mean of the distribution of means, a number. The default is 0.
#' @param drift The standard deviation of the random step of each mean after each action, a number
#'   of at least 0. The default, 0, keeps the means constant.
#' @param horizon The number of actions in an episode, a whole number. The default is 1,000.
#' @return An environment, as made by [gym_env()]. [rollout()] plays 256 sub-environments of it,
#'   each with its own arms. [learn_bandit()] learns in it.
#' @section Errors: `gym_error_argument`.
#' @references R. S. Sutton and A. G. Barto (2018), Reinforcement Learning: An Introduction, second
#'   edition, MIT Press.
#' @export
#' @examples
#' bandit()
#' rollout(bandit(3, mean = c(0, 1, 2), horizon = 10), policy_random(), episodes = 100, seed = 1)
bandit <- function(arms = 10, mean = NULL, sd = 1, centre = 0, drift = 0,
                   horizon = 1000) {
  if (missing(arms) && !is.null(mean)) arms <- length(mean)
  check_count(arms)
  mean <- plain_numbers(mean)
  if (!is.null(mean) && !(is.numeric(mean) && length(mean) == arms && all(is.finite(mean)))) {
    abort_argument(mean, paste("a finite number for each of", count_of(arms, "arm"), "or NULL"),
                   "mean", rlang::current_env())
  }
  check_number(sd, min = 0)
  check_number(centre)
  check_number(drift, min = 0)
  check_count(horizon)
  arms <- as.integer(arms)
  gym_env(
    reset = function(self) {
      self$means <- draw_means(self$bandit, self$num_envs)
      integer(self$num_envs)
    },
    step = function(self, action) {
      paid <- pull(self$bandit, self$means, action + 1L)
      self$means <- paid$means
      list(
        observation = integer(self$num_envs), reward = paid$reward,
        terminated = logical(self$num_envs)
      )
    },
    observation_space = space_discrete(1), action_space = space_discrete(arms), vectorized = TRUE,
    bandit = structure(
      list(arms = arms, mean = mean, sd = sd, centre = centre, drift = drift), class = "gym_bandit"
    ),
    id = paste0("Bandit-", arms), max_episode_steps = horizon
  )
}

# The mean rewards of n bandits, a matrix with a row for each.
draw_means <- function(bandit, n) {
  if (is.null(bandit$mean)) {
    matrix(stats::rnorm(n * bandit$arms, bandit$centre), n, bandit$arms)
  } else {
    matrix(bandit$mean, n, bandit$arms, byrow = TRUE)
  }
}

# Pulls an arm of each bandit.
pull <- function(bandit, means, arm) {
  n <- nrow(means)
  reward <- means[cbind(seq_len(n), arm)] + bandit$sd * stats::rnorm(n)
  if (bandit$drift > 0) means <- means + bandit$drift * stats::rnorm(length(means))
  list(reward = reward, means = means)
}

# The settings of a bandit's environment, `NULL` for any other environment.
bandit_of <- function(env) {
  bandit <- definition_of(env)$parameters[["bandit"]]
  if (inherits(bandit, "gym_bandit")) bandit
}
