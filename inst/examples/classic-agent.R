# The classic calls: a random agent plays CartPole. The server writes a table of its episodes.

library(gym)

client <- gym_server_start()
print(client)

instance_id <- env_create(client, "CartPole-v1")
print(env_list_all(client))

action_space_info <- env_action_space_info(client, instance_id)
print(action_space_info)
agent <- random_discrete_agent(action_space_info[["n"]])

directory <- file.path(tempdir(), "random-agent-results")
env_monitor_start(client, instance_id, directory, force = TRUE)

for (episode in 1:20) {
  observation <- env_reset(client, instance_id)
  for (step in 1:200) {
    results <- env_step(client, instance_id, act(agent, observation))
    observation <- results[["observation"]]
    if (results[["done"]]) break
  }
}

env_monitor_close(client, instance_id)
env_close(client, instance_id)

episodes <- read.csv(file.path(directory, "episodes.csv"))
print(summary(episodes$return))

gym_server_stop(client)
