# The trainings in the table of learners: their settings, their targets and the number of seeds. The
# settings were chosen with seeds 1 to 99. The table reports seeds from 1001 on.
#
# `judge` returns the expected return of the learned policy: exact if the environment has a model,
# otherwise the mean of 100 fresh episodes.

by_training <- function(learned) learned$final$mean_return

learn_jobs <- list(
  list(
    env_id = "FrozenLake-v1", goal = 0.73, seeds = 10, measure = "exact", judge = by_training,
    learn = function(seed) {
      learn_q(
        "FrozenLake-v1", total_steps = 3e5, learning_rate = schedule_exponential(0.5, 0.005, 2.5e5),
        epsilon = schedule_linear(1, 0.1, 2e5), episodes = 64, target = Inf, seed = seed,
        progress = FALSE
      )
    }
  ),
  list(
    env_id = "FrozenLake8x8-v1", goal = 0.87, seeds = 10, measure = "exact", judge = by_training,
    learn = function(seed) {
      learn_q(
        "FrozenLake8x8-v1", total_steps = 2e6, discount = 0.999,
        learning_rate = schedule_exponential(0.5, 0.005, 1.6e6),
        epsilon = schedule_linear(1, 0.1, 1.5e6), episodes = 256, target = Inf, seed = seed,
        progress = FALSE
      )
    }
  ),
  list(
    env_id = "CliffWalking-v1", goal = -13, seeds = 20, measure = "exact", judge = by_training,
    learn = function(seed) {
      learn_q(
        "CliffWalking-v1", total_steps = 5e4, max_steps = 1000, discount = 1, learning_rate = 0.5,
        target = Inf, seed = seed, progress = FALSE
      )
    }
  ),
  list(
    env_id = "Taxi-v4", goal = 7.88, seeds = 10, measure = "exact", judge = by_training,
    learn = function(seed) {
      learn_q(
        "Taxi-v4", iterations = 100, episodes = 200, discount = 1, learning_rate = 1,
        target = Inf, seed = seed, progress = FALSE
      )
    }
  ),
  list(
    env_id = "Blackjack-v1", goal = -0.0531, seeds = 10, measure = "exact",
    judge = function(learned) blackjack_value(learned$policy),
    learn = function(seed) {
      learn_q(
        "Blackjack-v1", iterations = 100, episodes = 1000, discount = 1,
        learning_rate = schedule_exponential(0.1, 0.002, 130000),
        epsilon = schedule_linear(1, 0.2, 120000), num_envs = 64, num_workers = 0, target = Inf,
        eval_episodes = 2, seed = seed, progress = FALSE
      )
    }
  ),
  list(
    env_id = "MountainCar-v0", goal = -110, seeds = 20, measure = "100 episodes",
    judge = by_training,
    learn = function(seed) {
      learn_sarsa(
        "MountainCar-v0", iterations = 60, discount = 1, features = tile_coding(8, 8),
        lambda = 0.9, epsilon = 0, learning_rate = 0.3, target = -107, seed = seed,
        progress = FALSE
      )
    }
  )
)
names(learn_jobs) <- vapply(learn_jobs, function(job) job$env_id, "")
