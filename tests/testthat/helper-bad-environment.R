# Returns a client of a server whose answers a test chooses. The server has one environment with two
# numbers to observe and two actions. `...` replaces fields of its description.
local_bad_environment <- function(..., frame = parent.frame()) {
  about <- list(
    env_id = "Bad-v0",
    observation_space = list(
      name = "Box", shape = list(2L), dtype = "float64", low = list(-1, -1), high = list(1, 1)
    ),
    action_space = list(name = "Discrete", n = 2L)
  )
  given <- list(...)
  about[names(given)] <- given
  local_canned_server(list(
    "/v1/envs/" = list(text = jsonlite::toJSON(
      c(list(instance_id = "0a1b2c3d", request = list(key = "a", number = 1)), about),
      auto_unbox = TRUE
    )),
    "/v1/envs/0a1b2c3d/" = list(text = jsonlite::toJSON(about, auto_unbox = TRUE)),
    # The server answers a request for the layout of messages as if there were no arrays.
    "/v1/envs/0a1b2c3d/stream/" = list(text = good_step()),
    "/v1/envs/0a1b2c3d/close/" = list(status = 200, text = "{}")
  ), frame = frame)
}

# Returns a step's answer as JSON. Arguments replace its fields.
good_step <- function(...) {
  fields <- c(
    observation = "[0,1]", reward = "1.5", done = "false", terminated = "false",
    truncated = "false", info = "{}"
  )
  given <- c(...)
  fields[names(given)] <- given
  json_object(fields)
}
