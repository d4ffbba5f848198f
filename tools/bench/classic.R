# The classic pattern, written for the benchmark: httr for each call, content() and fromJSON() for
# each answer. `server` is the address of the development server.

classic_post <- function(server, route, data) {
  response <- httr::POST(httr::modify_url(server, path = route), body = data, encode = "json")
  text <- httr::content(response, as = "text", encoding = "UTF-8")
  jsonlite::fromJSON(text, simplifyVector = FALSE)
}

classic_create <- function(server, env_id) {
  classic_post(server, "/v1/envs/", list(env_id = env_id))$instance_id
}

classic_reset <- function(server, instance_id) {
  classic_post(server, paste0("/v1/envs/", instance_id, "/reset/"), list())$observation
}

classic_step <- function(server, instance_id, action, render = FALSE) {
  classic_post(
    server, paste0("/v1/envs/", instance_id, "/step/"),
    list(instance_id = instance_id, action = action, render = render)
  )
}

# Plays rounds as the tutorial's script ("Artificial Intelligence in R (I)", 2018) does: a data
# frame grows by a row each step, and neurons are computed one at a time. Unlike the script, it does
# not stop at the first round that reaches 195. tanh() and plogis() replace the package sigmoid.
# Returns the number of steps.
classic_rounds <- function(server, instance_id, rounds, episodes = 5, max_steps = 200) {
  steps <- 0
  neurons <- 2
  for (round in seq_len(rounds)) {
    played <- as.data.frame(t(1:9))[!1, ]
    hidden <- matrix(runif(4 * neurons, -1, 1), nrow = neurons)
    output <- rep(runif(neurons, -1, 1), neurons)
    for (episode in seq_len(episodes)) {
      seen <- classic_episode(server, instance_id, hidden, output, episode, max_steps)
      steps <- steps + nrow(seen) - 1
      seen$reward <- nrow(seen)
      colnames(played) <- colnames(seen)
      played[(nrow(played) + 1):(nrow(played) + nrow(seen)), ] <- seen
    }
    played <- played[complete.cases(played), ]
    mean(unique(played$reward))
  }
  steps
}

classic_episode <- function(server, instance_id, hidden, output, episode, max_steps) {
  seen <- as.data.frame(t(rep(NA, 4)))
  colnames(seen) <- paste0("obs_", 1:4)
  seen[1, 1:4] <- classic_reset(server, instance_id)
  seen$iteration[1] <- 0
  seen$reward[1] <- NA
  seen$done[1] <- FALSE
  seen$action[1] <- NA
  neuron <- numeric(nrow(hidden))
  for (j in seq_len(max_steps)) {
    input <- seen[j, 1:4]
    for (h in seq_along(neuron)) {
      neuron[h] <- tanh(sum(input[, 1:4] * hidden[h, ]))
    }
    action <- round(plogis(sum(neuron * output)))
    results <- classic_step(server, instance_id, action, render = TRUE)
    seen[j + 1, 1:4] <- results[[1]]
    seen$reward[j + 1] <- results[[2]]
    seen$done[j + 1] <- results[[3]]
    seen$action[j + 1] <- action
    seen$iteration[j + 1] <- j
    seen$round <- episode
    if (results[["done"]]) break
  }
  seen
}
