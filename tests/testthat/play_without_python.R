# Plays everything that needs no server, at its smallest. Prints each call that failed, and why.

Sys.unsetenv(c("GYM_SERVER_URL", "RETICULATE_PYTHON", "VIRTUAL_ENV", "CONDA_PREFIX"))
path <- Sys.getenv("PATH")
Sys.setenv(GYM_PYTHON = "/nonexistent", PATH = "/nonexistent")

library(gym)
grDevices::pdf(NULL)

step <- function(self, action) {
  self$place <- pmax(self$place + ifelse(action == 1, 1, -1), 0)
  list(observation = self$place, reward = 0 * self$place - 1, terminated = self$place == 3)
}
corridor <- gym_env(
  reset = function(self) self$place <- 0, step = step,
  render = function(self) plot(self$place),
  observation_space = space_discrete(4), action_space = space_discrete(2),
  max_episode_steps = 6
)
wide <- gym_env(
  reset = function(self) self$place <- numeric(self$num_envs), step = step,
  observation_space = space_discrete(4), action_space = space_discrete(2),
  vectorized = TRUE, max_episode_steps = 6
)
point <- gym_env(
  reset = function(self) runif(4),
  step = function(self, action) {
    list(observation = runif(4), reward = runif(1), terminated = FALSE)
  },
  observation_space = space_box(numeric(4), rep(1, 4)), action_space = space_discrete(2),
  max_episode_steps = 3, reward_threshold = 9
)
walk <- gym_model(data.frame(
  state = c(1, 1, 2, 2), action = c(0, 1, 0, 1), next_state = c(0, 2, 1, 3),
  reward = c(0, 0, 0, 1)
), start = 1)
gym_register("Corridor-v0", corridor)
gym_register("Point-v0", point)
random <- policy_random()

works <- function(...) {
  for (call in as.list(substitute(list(...)))[-1L]) {
    tryCatch(
      eval(call, globalenv()),
      error = function(cnd) cat(deparse1(call), ": ", conditionMessage(cnd), "\n", sep = "")
    )
  }
}

for (env in list(corridor, wide, walk, "Corridor-v0")) {
  works(
    played <- rollout(env, random, episodes = 2, max_steps = 9, steps = TRUE,
                      next_observation = TRUE),
    plot(played),
    estimate_model(played),
    evaluate_policy(env, list(random, random), max_steps = 9),
    learn_q(env, iterations = 1, episodes = 1, eval_episodes = 2, max_steps = 9),
    learn_sarsa(env, iterations = 1, episodes = 1, eval_episodes = 2, max_steps = 9)
  )
}
for (env in list(point, "Point-v0", walk)) {
  works(
    objective <- gym_objective(env, episodes = 1, max_steps = 3),
    objective(coef(attr(objective, "policy"))),
    trained <- search_ars(env, iterations = 1, eval_episodes = 2, max_steps = 3, version = "V1-t"),
    plot(trained),
    search_cem(env, iterations = 1, eval_episodes = 2, max_steps = 3),
    search_hill_climb(env, iterations = 1, eval_episodes = 2, max_steps = 3),
    found <- search_random(env, rounds = 2, episodes = 1, max_steps = 3, target = 9,
                           checkpoint = "search.rds", resume = FALSE),
    again <- search_random(env, rounds = 2, episodes = 1, max_steps = 3, target = 9,
                           checkpoint = "search.rds"),
    stopifnot(is.null(again$client)),
    plot(found),
    summary(found, episodes = 2),
    search_random(env, rounds = 2, episodes = 1, max_steps = 3, target = 9, seeds = 1:2),
    plot(found$policy, env),
    as_vector_env(env)
  )
}
works(plot(decision_map("Point-v0", policy_network(), 1, 2, path = TRUE)))
works(
  stopifnot(all(check_env(corridor)$severity != "wrong")),
  check_env("Corridor-v0"),
  gym_make("Corridor-v0")$reset(),
  env_model(walk),
  plot(solve_mdp(walk)),
  model_env(walk, 2)$reset(),
  rollout(bandit(2, horizon = 3), random),
  plot(learn_bandit(bandit(2), learners = 2, horizon = 2)),
  learn_td(corridor, random, iterations = 1, episodes = 1, eval_episodes = 2),
  learn_monte_carlo(corridor, iterations = 1, episodes = 1, eval_episodes = 2),
  framed <- rollout("Corridor-v0", random, frames = TRUE),
  plot(framed, type = "filmstrip"),
  learned <- learn_q("Corridor-v0", iterations = 1, eval_episodes = 2, checkpoint = "training.rds"),
  learn_q("Corridor-v0", iterations = 2, eval_episodes = 2, checkpoint = "training.rds"),
  saveRDS(learned, "learned.rds"),
  learned <- readRDS("learned.rds"),
  predict(learned, 0L),
  provenance(learned)
)

if (requireNamespace("magick", quietly = TRUE)) {
  works(animate(learned), animate(random, env = "Corridor-v0"), animate(framed))
}

# On a worker, whose R starts by programs of the PATH.
if (requireNamespace("future", quietly = TRUE)) {
  Sys.setenv(PATH = path)
  future::plan(future::cluster, workers = "localhost")
  for (env in list(walk, "Point-v0")) {
    works(rollout(env, random, episodes = 2), evaluate_policy("Point-v0", random, episodes = 2))
  }
  works(search_ars("Point-v0", iterations = 1, eval_episodes = 2, seeds = 1:2))
  future::plan(future::sequential)
}

# Cleaners of /tmp delete the session's folder after some days.
unlink(tempdir(), recursive = TRUE)
works(rollout(corridor, random, frames = TRUE), plot(framed, type = "filmstrip"))
if (requireNamespace("magick", quietly = TRUE)) works(animate(framed))
