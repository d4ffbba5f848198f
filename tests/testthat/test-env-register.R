# A guess of a number from 0 to choices - 1.
guess <- function(...) {
  gym_env(
    reset = function(self) {
      self$secret <- sample(self$choices, 1) - 1
      0
    },
    step = function(self, action) {
      list(observation = 0, reward = as.numeric(action == self$secret), terminated = TRUE)
    },
    observation_space = space_discrete(1), action_space = space_discrete(4), choices = 4, ...
  )
}

counter <- function(stop = 3) {
  gym_env(
    function(self) self$at <- 0,
    function(self, action) {
      self$at <- self$at + 1
      list(observation = self$at, reward = 1, terminated = self$at == stop)
    },
    observation_space = space_discrete(9), action_space = space_discrete(2), id = "Counter"
  )
}

local_registered <- function(id, ..., frame = parent.frame()) {
  gym_register(id, ...)
  withr::defer(if (is_registered(id)) gym_unregister(id), envir = frame)
}

# No server can be asked, and none is started.
local_no_server <- function(frame = parent.frame()) {
  withr::local_envvar(GYM_SERVER_URL = "http://127.0.0.1:9", .local_envir = frame)
  withr::local_options(gym.start = FALSE, .local_envir = frame)
}

test_that("a registered id is known to everything that takes one, and no server is asked", {
  local_no_server()
  local_registered("Guess-v0", guess(), reward_threshold = 0.2)
  env <- gym_make("Guess-v0", seed = 1)
  expect_s3_class(env, "gym_r_env")
  expect_identical(env$spec$id, "Guess-v0")
  expect_identical(env$spec$reward_threshold, 0.2)
  expect_identical(as_vector_env("Guess-v0")$num_envs, 16L)
  played <- rollout("Guess-v0", policy_random(), 200, seed = 1)
  expect_identical(played$env_id, "Guess-v0")
  expect_identical(played$episodes, rollout(guess(), policy_random(), 200, seed = 1)$episodes)
  search <- search_random("Guess-v0", policy_network(c(1, 4)), rounds = 3, seed = 1,
                          progress = FALSE)
  expect_identical(search$env_id, "Guess-v0")
  expect_s3_class(search, "gym_search")
})

test_that("a saved search of an environment in R is found again without a server", {
  local_no_server()
  local_registered("Guess-v0", guess(), reward_threshold = 2)
  file <- withr::local_tempfile(fileext = ".rds")
  search <- function() {
    search_random("Guess-v0", policy_network(c(1, 4)), rounds = 2, seed = 1, progress = FALSE,
                  checkpoint = file)
  }
  first <- search()
  again <- suppressMessages(search())
  expect_identical(again$history, first$history)
  expect_null(again$client)
})

test_that("gym_make() seeds, replaces arguments and sets another limit", {
  local_registered("Guess-v0", guess(), choices = 2, max_episode_steps = 7)
  expect_identical(gym_make("Guess-v0")$spec$max_episode_steps, 7L)
  expect_null(gym_make("Guess-v0", max_episode_steps = -1)$spec$max_episode_steps)
  expect_identical(gym_make("Guess-v0", max_episode_steps = 9)$spec$max_episode_steps, 9L)
  returns <- function(...) {
    mean(rollout("Guess-v0", function(o) 0 * o, 400, seed = 1, ...)$episodes$return)
  }
  expect_lt(abs(returns() - 1 / 2), 0.1)
  expect_lt(abs(returns(choices = 4) - 1 / 4), 0.1)
  local_registered("Dice-v0", function(...) {
    gym_env(function(self) runif(1), function(self, action) NULL, space_box(0, 1),
            space_discrete(1))
  })
  expect_identical(gym_make("Dice-v0", seed = 4)$reset(), gym_make("Dice-v0")$reset(seed = 4))
  withr::local_seed(2)
  first <- gym_make("Dice-v0")$reset()
  set.seed(2)
  expect_identical(gym_make("Dice-v0")$reset(), first)
})

test_that("what an entry point draws is the same for each, and moves no generator", {
  withr::local_seed(1)
  local_registered("Bandit-v0", function() {
    arms <- runif(1)
    gym_env(function(self) arms, function(self, action) NULL, space_box(0, 1), space_discrete(1))
  })
  before <- .Random.seed
  first <- gym_make("Bandit-v0", seed = 1)$reset()
  expect_identical(gym_make("Bandit-v0", seed = 2)$reset(), first)
  expect_identical(.Random.seed, before)
})

test_that("an id that is registered again gets the new environment, and one can be forgotten", {
  local_registered("Again-v0", guess())
  gym_register("Again-v0", counter)
  expect_identical(gym_make("Again-v0")$observation_space$n, 9L)
  expect_identical(gym_unregister("Again-v0"), "Again-v0")
  expect_false(is_registered("Again-v0"))
  expect_error(gym_unregister("Again-v0"), "registered as \"Again-v0\"",
               class = "gym_error_argument")
  local_registered("Corridor-v0", guess())
  expect_error(gym_unregister("Coridor-v0"), "Did you mean \"Corridor-v0\"", fixed = TRUE,
               class = "gym_error_argument")
})

test_that("the registry has environments in R beside the server's", {
  local_registered("Guess-v0", guess(), max_episode_steps = 7, reward_threshold = 1)
  local_registered("Poles-v0", r_cartpole_vectorized())
  client <- test_client()
  all <- env_registry(client)
  own <- all[all$id %in% c("Guess-v0", "Poles-v0"), ]
  expect_identical(own$max_episode_steps, c(7L, 500L))
  expect_identical(own$vectorised, c(FALSE, TRUE))
  expect_true(all(own$available))
  expect_true("CartPole-v1" %in% all$id)
  expect_true("Poles-v0" %in% env_registry(client, search = "poles")$id)
  expect_false("Poles-v0" %in% env_registry(client, search = "cartpole")$id)
})

test_that("a classic call says that a server cannot see it", {
  local_registered("Guess-v0", guess())
  client <- create_GymClient("http://127.0.0.1:9")
  expect_error(env_create(client, "Guess-v0"), "Guess-v0 is an environment written in R",
               class = "gym_error_argument")
})

test_that("a vectorised one is made with as many sub-environments as asked for", {
  local_registered("Poles-v0", r_cartpole_vectorized())
  expect_identical(gym_make("Poles-v0", num_envs = 3)$num_envs, 3L)
  expect_identical(nrow(gym_make("Poles-v0", num_envs = 3)$reset()), 3L)
  expect_identical(as_vector_env("Poles-v0", num_envs = 3)$num_envs, 3L)
})

test_that("what cannot be registered or made is refused with the fix", {
  refused <- function(code, words) {
    expect_error(code, words, fixed = TRUE, class = "gym_error_argument")
  }
  refused(gym_register("my env", guess()), "`id` must be a string of letters")
  refused(gym_register(3, guess()), "`id` must be a string")
  refused(gym_register("Bad-v0", 3), "`entry_point` must be an environment of `gym_env()`")
  refused(gym_register("Bad-v0", guess(), 3), "Further arguments need names")
  refused(gym_register("Bad-v0", guess(), choice = 3), "Bad-v0 has no argument `choice`")
  refused(gym_register("Bad-v0", guess(), max_episode_steps = 0), "`max_episode_steps`")
  expect_false(is_registered("Bad-v0"))
  local_registered("Guess-v0", guess())
  refused(gym_make("Guess-v0", choice = 3), "Did you mean `choices`?")
  refused(gym_make("Guess-v0", num_envs = 3), "`rollout()` and searches play several")
  refused(gym_make("Guess-v0", name = "mine"), "`name` is for an environment on a server")
  refused(gym_make("Guess-v0", seed = -1), "`seed` must be a whole number")
  refused(gym_make("Guess-v0", max_episode_steps = 0.5), "`max_episode_steps`")
  local_registered("Number-v0", function() 3)
  refused(gym_make("Number-v0"), "The `entry_point` of Number-v0 must return an environment, not 3")
  refused(rollout("Number-v0", policy_random()), "must return an environment, not 3")
})

test_that("an argument that the entry point does not take is refused by name", {
  local_registered("Refusing-v0", counter)
  expect_identical(rollout("Refusing-v0", policy_random(), stop = 5)$episodes$length, 5L)
  expect_error(gym_make("Refusing-v0", stpo = 5), "no argument `stpo`.*`stop`",
               class = "gym_error_argument")
  expect_error(rollout("Refusing-v0", policy_random(), depth = 5), "no argument `depth`",
               class = "gym_error_argument")
})

test_that("an entry point may return any environment with reset() and step()", {
  local_registered("Plain-v0", function() {
    list(
      observation_space = space_discrete(1), action_space = space_discrete(2),
      spec = list(id = "Plain"), reset = function(seed = NULL) 0L,
      step = function(action) {
        list(observation = 0L, reward = 1, terminated = TRUE, truncated = FALSE)
      }
    )
  })
  expect_identical(rollout("Plain-v0", policy_random(), episodes = 2)$episodes$return, c(1, 1))
})

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
