test_that("the registry is a data frame of what can be made", {
  registry <- env_registry(test_client())
  expect_identical(
    vapply(registry, typeof, ""),
    c(id = "character", max_episode_steps = "integer", reward_threshold = "double",
      vectorised = "logical", extra = "character", available = "logical", reason = "character")
  )
  row <- registry[registry$id == "CartPole-v1", ]
  expect_identical(row$max_episode_steps, 500L)
  expect_identical(row$reward_threshold, 475)
  expect_true(row$available)
  expect_identical(row$extra, NA_character_)
  expect_identical(registry$extra[registry$id == "LunarLander-v3"], "box2d")
  expect_identical(registry$extra[registry$id == "FrozenLake-v1"], NA_character_)
  expect_identical(is.na(registry$reason), registry$available)
  expect_match(registry$reason[registry$id == "Ant-v2"], "no longer part of Gymnasium")
  expect_false(anyDuplicated(registry$id) > 0)
})

test_that("searching finds parts of ids in any case, and near misses", {
  client <- test_client()
  expect_true(all(grepl("cartpole", env_registry(client, "cartpole")$id, ignore.case = TRUE)))
  expect_true("FrozenLake-v1" %in% env_registry(client, "FrozenLaek")$id)
  expect_identical(names(env_registry(client, "zzzzzzzzzz")), names(env_registry(client, "Taxi")))
  expect_error(env_registry(client, 3), "search", class = "gym_error_argument")
})

# The environments that were made ---------------------------------------------------------

test_that("who has which environment is a data frame, the oldest first", {
  skip_unless_all()
  server <- local_server()
  none <- env_list(server)
  expect_identical(
    vapply(none, typeof, ""),
    c(instance_id = "character", name = "character", env_id = "character", num_envs = "integer",
      age = "double", idle = "double", steps = "double", watched = "logical")
  )
  expect_identical(nrow(none), 0L)
  first <- env_create(server, "CartPole-v1", name = "J\u00fcrgen's \"pole\"")
  sub_envs <- gym_make("CartPole-v1", num_envs = 3, name = "three", client = server)
  third <- gym_make("Pendulum-v1", client = server)
  sub_envs$reset()
  sub_envs$step(c(0, 0, 1))
  listed <- env_list(server)
  expect_identical(vapply(listed, typeof, ""), vapply(none, typeof, ""))
  expect_identical(listed$instance_id, c(first, sub_envs$instance_id, third$instance_id))
  expect_identical(listed$name, c("J\u00fcrgen's \"pole\"", "three", NA))
  expect_identical(listed$env_id, c("CartPole-v1", "CartPole-v1", "Pendulum-v1"))
  expect_identical(listed$num_envs, c(NA, 3L, NA))
  expect_identical(listed$steps, c(0, 3, 0))
  expect_identical(listed$watched, c(FALSE, FALSE, FALSE))
  expect_true(all(listed$age >= listed$idle & listed$idle >= 0))
  expect_false(is.unsorted(-listed$age))
  expect_error(env_list(3), "client", class = "gym_error_argument")
})

test_that("a name is a short string", {
  client <- test_client()
  for (bad in list(3, NA_character_, "", c("a", "b"))) {
    expect_error(gym_make("CartPole-v1", name = bad, client = client), "`name`",
                 class = "gym_error_argument")
  }
  for (bad in c(strrep("x", 101), "two\nlines")) {
    expect_error(env_create(client, "CartPole-v1", name = bad), "1 to 100 printable",
                 class = "gym_error_http_400")
  }
})

test_that("a server's limits say what to do about them", {
  error <- expect_error(gym_make("CartPole-v1", num_envs = 100001, client = test_client()),
                        "Create several", class = "gym_error_http_429")
  expect_identical(error$code, "too_many_sub_envs")
})

test_that("a rollout takes one environment where the memory is too little for sub-environments", {
  skip_unless_all()
  skip_on_os(c("windows", "mac"))
  server <- local_server(max_memory_mb = 200)
  stacked <- gym_wrap("CartPole-v1", "FrameStackObservation", stack_size = 900) |>
    gym_wrap("FrameStackObservation", stack_size = 100)
  expect_error(gym_make(stacked, num_envs = 64, client = server), "max-memory-mb",
               class = "gym_error_http_429")
  expect_s3_class(rollout(stacked, policy_random(), episodes = 16, max_steps = 2, client = server),
                  "gym_rollout")
})

test_that("an environment that was thrown away is not in the list", {
  skip_unless_all()
  server <- local_server()
  local({
    gym_make("CartPole-v1", client = server)
    NULL
  })
  gc()
  expect_identical(nrow(env_list(server)), 0L)
})

test_that("an environment that nobody uses is closed, which its calls say, and close() takes", {
  skip_unless_all()
  server <- local_server(idle_minutes = 0.01)
  env <- gym_make("CartPole-v1", client = server)
  deadline <- Sys.time() + 20
  while (nrow(env_list(server)) && Sys.time() < deadline) Sys.sleep(0.1)
  error <- expect_error(env$reset(), "nobody used it for 0.01 minutes",
                        class = "gym_error_http_410")
  expect_identical(error$code, "instance_idle_closed")
  expect_silent(env$close())
})

test_that("more sub-environments than the server allows are refused", {
  skip_unless_all()
  many <- gym_make("CartPole-v1", num_envs = 1e6, client = test_client()) |>
    expect_error(class = "gym_error_http_429")
  expect_identical(many$code, "too_many_sub_envs")
})
