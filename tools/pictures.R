# Draws a picture of each kind, small (4 inches wide) and large (7 inches), for a look at them.
#
#   tools/in-env Rscript --no-init-file tools/pictures.R [FOLDER]     FOLDER: pictures/kinds
#
# Uses the results of the vignettes where possible. Takes a minute, and needs the packages magick
# and png.

library(gym)

folder <- c(commandArgs(trailingOnly = TRUE), "pictures/kinds")[[1L]]
dir.create(folder, recursive = TRUE, showWarnings = FALSE)

draw <- function(name, ..., height = 5) {
  for (width in c(4, 7)) {
    file <- file.path(folder, paste0(name, if (width == 4) "-small", ".png"))
    grDevices::png(file, width, height * if (width == 4) 0.64 else 1, units = "in", res = 120)
    tryCatch(plot(...), finally = grDevices::dev.off())
  }
}

# CartPole: the search of the tutorial, and the trainings ---------------------------------

cartpole <- readRDS("vignettes/results.rds")
trained <- readRDS("vignettes/learning.rds")
policy <- cartpole$search$policy

draw("returns", cartpole$random)
draw("search", cartpole$search)
draw("network", policy)
draw("network-wide", policy_network(c(24, 16, 16, 4)))
draw("decision-output", cartpole$map)
draw("luck", cartpole$searches)
draw("training", trained$one)
agents <- trained$trained
draw("trainings", agents$ars)
draw("trainings-single", first = agents$ars$trainings[[1]], second = agents$cem$trainings[[1]])
draw("trainings-compared", random = agents$random,
     `hill climbing` = agents$hill_climb, CEM = agents$cem, ARS = agents$ars)

draw("compared-steps", compare_trainings(CEM = agents$cem, ARS = agents$ars, PPO = agents$ppo))
curves <- learning_curves(CEM = agents$cem, ARS = agents$ars, PPO = agents$ppo)
scores <- compare_trainings(curves, total_steps = 3000, seed = 1)
draw("compared-scores", scores)
draw("compared-profile", scores, type = "profile")
draw("compared-improvement", scores, type = "improvement")

follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
policies <- list(random = policy_random(), `follow the pole` = follow_pole, found = policy)
compared <- rollout("CartPole-v1", policies, episodes = 100, seed = 2)
draw("comparison", compared)
pendulum <- rollout("Pendulum-v1", policy_random(), episodes = 50, seed = 2)
draw("comparison-environments", random = cartpole$random, random = pendulum)
draw("evaluation", evaluate_policy("CartPole-v1", policies, episodes = 100, seed = 2))

played <- rollout("CartPole-v1", follow_pole, seed = 1, steps = TRUE, frames = TRUE)
draw("trajectory", played, type = "trajectory")
draw("filmstrip", played, type = "filmstrip")
draw("filmstrip-flat", played, type = "filmstrip", height = 1.3)
draw("frame", cartpole$frame)

# Other observations and actions -----------------------------------------------------------

pendulum <- rollout("Pendulum-v1", policy_random(), seed = 1, steps = TRUE)
draw("trajectory-number", pendulum, type = "trajectory")
car <- rollout("MountainCar-v0", policy_random(), seed = 1, steps = TRUE, max_steps = 60)
draw("trajectory-goal", car, type = "trajectory")
lander <- rollout("LunarLander-v3", policy_random(), seed = 1, steps = TRUE)
draw("trajectory-many", lander, type = "trajectory")
continuous <- rollout("LunarLander-v3", policy_random(), seed = 1, steps = TRUE, continuous = TRUE)
draw("trajectory-parts", continuous, type = "trajectory")

energy <- function(observation) ifelse(observation[, 2L] < 0, 0L, 2L)
draw("decision-choice", decision_map("MountainCar-v0", energy))
push <- policy_network(c(2, 1), "tanh", weights = list(matrix(c(0.5, 30), 1L)))
draw("decision-value", decision_map("MountainCarContinuous-v0", push))

# Few different returns, tables and models ---------------------------------------------------

right <- policy_table(matrix(c(0, 0, 1, 0), 16L, 4L, byrow = TRUE))
lake <- solve_mdp("FrozenLake-v1")
policies <- list(random = policy_random(), right = right, best = lake$policy)
draw("returns-few", rollout("FrozenLake-v1", lake$policy, episodes = 200, seed = 1))
draw("comparison-few", rollout("FrozenLake-v1", policies, episodes = 200, seed = 1))
draw("values", lake)
draw("values-q", lake, type = "q")
draw("values-8x8", solve_mdp("FrozenLake8x8-v1"))
draw("values-cliff", solve_mdp("CliffWalking-v1"), height = 3.5)
draw("values-taxi", solve_mdp("Taxi-v4"))
walk <- data.frame(
  state = rep(1:5, each = 2), action = 0:1, next_state = as.vector(rbind(0:4, 2:6)),
  reward = rep(c(0, 1), c(9, 1))
)
draw("values-points", solve_mdp(gym_model(walk, start = 3, id = "Walk"), policy = policy_random()))
draw("states", decision_map("FrozenLake-v1", lake$policy))
draw("states-q", decision_map("FrozenLake-v1", policy_table(lake$q)), type = "q")
sums <- rep(0:31, each = 22)
sticks <- policy_table(cbind(sums >= 20, sums < 20) + 0)
draw("states-parts", decision_map("Blackjack-v1", sticks, "dealer_card", "player_sum",
                                  xlim = c(1, 10), ylim = c(12, 21)))
draw("states-taxi", decision_map("Taxi-v4", solve_mdp("Taxi-v4")$policy))

learned <- learn_q("CliffWalking-v1", iterations = 30, learning_rate = 0.5, discount = 1,
                   max_steps = 1000, seed = 1)
draw("training-learner", learned)

by_gradients <- learn_ppo("CartPole-v1", total_steps = 10000, target = Inf, seed = 1)
draw("diagnostics", by_gradients, type = "diagnostics")
settings <- expand.grid(step_size = c(0.02, 0.1), noise = c(0.05, 0.1))
draw("sweep", sweep_agent(agent_ars, "CartPole-v1", settings, seeds = 1:5, total_steps = 5000,
                          target = Inf, eval_every = 2, eval_episodes = 10))

testbed <- bandit(arms = 10, horizon = 500)
greedy <- learn_bandit(testbed, epsilon = 0, learners = 300, seed = 1)
seldom <- learn_bandit(testbed, epsilon = 0.01, learners = 300, seed = 1)
often <- learn_bandit(testbed, epsilon = 0.1, learners = 300, seed = 1)
draw("bandits", greedy, seldom, often)
draw("bandits-best", greedy, seldom, often, what = "best_share")
