# Values from Python to R and back; see mirror_environments.py.

# Sends back each value that a mirror shows. Returns the values and what the mirror
# found different.
play_mirror <- function(env, tensors) {
  instance <- known_instance(env$client, env$instance_id)
  # Calls were prepared for the other way.
  instance$resets[] <- instance$steps[] <- list(NULL)
  # An empty Tuple or Dict would be a file without a tensor, and no action in it.
  empty <- all(all_kinds(env$action_space) %in% c("Tuple", "Dict"))
  instance$sends_tensors <- tensors && !empty
  seen <- list()
  problems <- character()
  observation <- env$reset(seed = 1)
  repeat {
    seen[[length(seen) + 1L]] <- observation
    out <- env$step(observation)
    if (out$reward != 1) {
      problems <- c(problems, paste0(format(env$observation_space), ": ", out$info$problem))
    }
    if (out$terminated) break
    observation <- out$observation
  }
  list(seen = seen, problems = problems)
}

test_that("random values of random spaces come back to Python as they were", {
  skip_unless_all()
  server <- odd_server()
  tried <- c(json = 0L, tensors = 0L)
  kinds <- character()
  problems <- character()
  how_many <- as.integer(Sys.getenv("GYM_TEST_SPACES", "40"))
  for (number in seq_len(how_many)) {
    env <- gym_make("mirror_environments:Mirror-v0", number = number, values = 8, client = server)
    kinds <- union(kinds, all_kinds(env$observation_space))
    by_json <- play_mirror(env, tensors = FALSE)
    tried[["json"]] <- tried[["json"]] + length(by_json$seen)
    problems <- c(problems, by_json$problems)
    if (has_tensors(env$observation_space)) {
      by_tensors <- play_mirror(env, tensors = TRUE)
      tried[["tensors"]] <- tried[["tensors"]] + length(by_tensors$seen)
      problems <- c(problems, by_tensors$problems)
      expect_identical(by_tensors$seen, by_json$seen, info = number)
    }
    env$close()
  }
  expect_identical(problems, character())
  expect_identical(tried[["json"]], 8L * how_many)
  expect_gt(tried[["tensors"]], 3L * how_many)
  expect_setequal(kinds, c("Box", "Discrete", "MultiDiscrete", "MultiBinary", "Text", "Tuple",
                           "Dict", "Sequence", "Graph", "OneOf"))
})
