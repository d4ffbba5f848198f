test_that("an answer that does not come within the timeout is an error", {
  skip_unless_all()
  server <- odd_server()
  patient <- make_odd("Slow", server)
  patient$reset()
  hasty <- create_GymClient(server$remote_base, timeout = 0.3)
  expect_error(env_step(hasty, patient$instance_id, 1), "[Tt]ime", class = "gym_error_connection")
})

# Steps and resets by HTTP.
messages_to <- function(id) paste0("POST /v1/envs/", id, "/stream/")

# An environment after its reset, and a client whose connections break at its messages.
local_cut_env <- function(when, times, frame = parent.frame()) {
  server <- local_server(frame = frame)
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, when, messages_to(id), times, frame)
  steps <- function() get_request(server, paste0("/v1/envs/", id, "/"))$steps
  list(client = client, id = id, steps = steps)
}

test_that("a step whose answer was lost is not taken twice", {
  server <- local_server()
  id <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, id)
  client <- local_cut_client(server, "answered", messages_to(id))
  first <- env_step(client, id, 1)
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)

  twin <- env_create(server, "CartPole-v1", seed = 1)
  env_reset(server, twin)
  expect_identical(first, env_step(server, twin, 1))
  expect_identical(env_step(client, id, 0), env_step(server, twin, 0))
})

test_that("creating is not done twice, nor is closing", {
  skip_unless_all()
  server <- local_server()
  client <- local_cut_client(server, "answered", "POST /v1/envs/ ")
  id <- env_create(client, "CartPole-v1")
  expect_named(env_list_all(server), id)
  client <- local_cut_client(server, "answered", "/close")
  expect_error(env_close(client, id), NA)
  expect_length(env_list_all(server), 0)
})

test_that("a call that was cut before it was sent is made", {
  skip_unless_all()
  cut <- local_cut_env("unsent", times = 2)
  expect_equal(env_step(cut$client, cut$id, 1)$reward, 1)
  expect_equal(cut$steps(), 1)
})

test_that("a connection that breaks each time is an error in the end", {
  skip_unless_all()
  cut <- local_cut_env("answered", times = 100)
  expect_error(env_step(cut$client, cut$id, 1), class = "gym_error_connection")
  expect_equal(cut$steps(), 1)
})

test_that("a call without a number is not repeated", {
  skip_unless_all()
  server <- local_server()
  id <- env_create(server, "CartPole-v1")
  env_reset(server, id)
  client <- local_cut_client(server, "answered", "/step")
  expect_error(
    post_request(client, paste0("/v1/envs/", id, "/step/"), list(action = 1)),
    class = "gym_error_connection"
  )
  expect_equal(get_request(server, paste0("/v1/envs/", id, "/"))$steps, 1)
})
