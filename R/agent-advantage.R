# Returns and advantages of whole episodes, whose steps are in order.

#' Sum the values from each step to the end of its episode
#' @param values The value of each step.
#' @param decay The discount per step.
#' @param last Whether a step is the last of its episode. By default all steps are of one episode.
#' @noRd
sum_backwards <- function(values, decay, last = seq_along(values) == length(values)) {
  sum <- 0
  for (t in rev(seq_along(values))) {
    sum <- values[[t]] + if (last[[t]]) 0 else decay * sum
    values[[t]] <- sum
  }
  values
}

# Whether each step is the last of its episode, given the episodes' numbers.
ends_of <- function(episode) c(episode[-1L] != episode[-length(episode)], TRUE)

# The value of the state after each step. It is 0 if the episode terminated. A truncated episode
# would have gone on, so its last state keeps its value.
next_values <- function(value, last_value, terminated, last) {
  after <- c(value[-1L], 0)
  after[last] <- last_value
  after[terminated] <- 0
  after
}

#' Estimate advantages (generalized advantage estimation, Schulman et al. 2016)
#' @param after As next_values() returns it.
#' @noRd
estimate_advantages <- function(reward, value, after, last, gamma, lambda) {
  sum_backwards(reward + gamma * after - value, gamma * lambda, last)
}

# Divides rewards by the standard deviation of the discounted return so far and clips them at 10.
# Returns a list: `reward`, and the `moments` of that return.
scale_rewards <- function(reward, last, gamma, moments) {
  so_far <- reward
  for (t in seq_along(reward)[-1L]) {
    if (!last[[t - 1L]]) so_far[[t]] <- reward[[t]] + gamma * so_far[[t - 1L]]
  }
  moments <- merge_moments(moments, moments_of(matrix(so_far)))
  deviation <- sqrt(moments$squares / moments$count)
  list(reward = pmax(-10, pmin(reward / max(deviation, 1e-4), 10)), moments = moments)
}

# A single advantage has no standard deviation. Less its mean it would be 0 and teach nothing, so it
# stays as it is, as in Stable-Baselines3.
standardized <- function(x) {
  n <- length(x)
  if (n < 2L) {
    return(x)
  }
  deviation <- x - sum(x) / n
  deviation / (sqrt(sum(deviation * deviation) / (n - 1)) + 1e-8)
}

explained_variance <- function(value, return) {
  spread <- stats::var(return)
  if (isTRUE(spread > 0)) 1 - stats::var(return - value) / spread else NA_real_
}
