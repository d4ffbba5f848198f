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
