# A short rollout of CartPole with steps and frames.
short_rollout <- function(max_steps = 10, policy = policy_random(), ...) {
  rollout(
    "CartPole-v1", policy, max_steps = max_steps, seed = 1, steps = TRUE, frames = TRUE,
    client = test_client(), ...
  )
}
