# What counts of a search, without how long it took, where, and what nobody played.
figures <- function(search) {
  search[setdiff(names(search), c("elapsed", "client", "env", "template", "provenance"))]
}

# A search that goes on from a file says so.
quiet_search <- function(...) {
  suppressMessages(search_random(...), classes = "gym_message_resumed")
}

environments <- list(
  single = function() fake_environment(reward = first_action),
  sync = function() fake_vector_env(2, "sync", reward = first_action),
  together = function() fake_vector_env(7, "vector_entry_point", reward = first_action)
)

test_that("a search goes on from the file of any batch to the result of an undisturbed one", {
  skip_unless_all()
  for (make in environments) {
    for (target in list(Inf, 13.5)) {
      play <- function(checkpoint = NULL) {
        quiet_search(make(), rounds = 8, episodes = 3, target = target, seed = 1,
                      checkpoint = checkpoint)
      }
      undisturbed <- play()
      kept <- local_kept_files()
      expect_identical(figures(play(local_checkpoint())), figures(undisturbed))
      expect_gt(length(kept$list), 3)
      for (bytes in kept$list) {
        expect_identical(figures(play(local_checkpoint(bytes))), figures(undisturbed))
      }
    }
  }
})

test_that("without a seed a search goes on with the one that was drawn, and draws no other", {
  kept <- local_kept_files()
  play <- function(checkpoint) {
    quiet_search(fake_vector_env(4, reward = first_action), rounds = 9, target = Inf,
                  checkpoint = checkpoint)
  }
  set.seed(3)
  undisturbed <- play(local_checkpoint())
  set.seed(99)
  state <- .Random.seed
  for (bytes in kept$list) {
    expect_identical(figures(play(local_checkpoint(bytes))), figures(undisturbed))
    expect_identical(.Random.seed, state)
  }
})

test_that("with a seed the session's generator stays as it was", {
  path <- local_checkpoint()
  set.seed(1)
  before <- .Random.seed
  for (time in 1:2) {
    quiet_search(fake_environment(), rounds = 2, seed = 5, checkpoint = path)
    expect_identical(.Random.seed, before)
  }
})

test_that("an interrupted search and one with an error go on by the same call", {
  for (stop_it in list(rlang::interrupt, function() gym_abort("lost"))) {
    path <- local_checkpoint()
    play <- function(env, checkpoint = path) {
      quiet_search(env, rounds = 5, episodes = 2, target = Inf, seed = 1, checkpoint = checkpoint)
    }
    undisturbed <- play(fake_environment(), NULL)
    env <- fake_environment()
    step <- env$step
    env$step <- function(action) if (length(env$seeds) == 5L) stop_it() else step(action)
    problem <- tryCatch(suppressMessages(play(env)), gym_error_search = identity)
    if (inherits(problem, "error")) {
      expect_match(conditionMessage(problem), basename(path), fixed = TRUE)
    }
    fresh <- fake_environment()
    expect_identical(figures(play(fresh)), figures(undisturbed))
    # Of ten episodes those that the file has are not played again.
    expect_lt(length(fresh$seeds), 10)
  }
})

test_that("a finished search is returned at once, with all its time", {
  path <- local_checkpoint()
  play <- function(env) quiet_search(env, rounds = 3, target = Inf, seed = 1, checkpoint = path)
  env <- fake_environment()
  step <- env$step
  env$step <- function(action) {
    Sys.sleep(0.01)
    step(action)
  }
  first <- play(env)
  idle <- fake_environment()
  again <- play(idle)
  expect_length(idle$seeds, 0)
  expect_identical(figures(again), figures(first))
  expect_gte(again$elapsed, 0.3)
})

test_that("the progress bar goes on, too", {
  kept <- local_kept_files()
  play <- function(path) {
    shown <- integer()
    local_functions(
      progress_bar = function(...) function(finished, note) shown <<- c(shown, finished)
    )
    quiet_search(fake_environment(), rounds = 3, episodes = 1, target = Inf, seed = 1,
                  progress = TRUE, checkpoint = path)
    unique(shown)
  }
  expect_equal(play(local_checkpoint()), 1:3)
  expect_equal(play(local_checkpoint(kept$list[[3]])), 2:3)
})

test_that("arguments that differ from the file's are named, with both values", {
  path <- local_checkpoint()
  env <- fake_environment()
  begun <- list(env = env, policy = policy_network(), rounds = 3, episodes = 2, target = Inf,
                max_steps = NULL, seed = 1, checkpoint = path)
  play <- function(...) {
    given <- list(...)
    begun[names(given)] <- given
    do.call(search_random, begun)
  }
  play()
  refused <- function(..., argument, message) {
    cnd <- expect_error(play(...), message, fixed = TRUE, class = "gym_error_checkpoint")
    expect_identical(cnd$argument, argument)
    expect_s3_class(cnd, "gym_error_argument")
  }
  refused(rounds = 4, argument = "rounds", message = "`rounds` is 3 in the file, and 4 here.")
  refused(episodes = 5, argument = "episodes", message = "`episodes` is 2 in the file, and 5 here.")
  refused(target = 7, argument = "target", message = "`target` is Inf in the file, and 7 here.")
  refused(max_steps = 9, argument = "max_steps",
          message = "`max_steps` is NULL in the file, and 9 here.")
  refused(seed = 2, argument = "seed", message = "`seed` is 1 in the file, and 2 here.")
  refused(policy = policy_network(c(4, 1)), argument = "policy", message = "`policy` is network")
  refused(env = fake_environment(id = "Other-v0"), argument = "env",
          message = "`env` is Fake-v0 in the file, and Other-v0 here.")
  refused(env = fake_vector_env(3), argument = "env",
          message = "Fake-v0 with 3 sub-environments here")
  refused(env = gym_wrap("Fake-v0", "TimeLimit", max_episode_steps = 5), argument = "env",
          message = "`env` is a different one in the file.")
  refused(seed = 2, rounds = 4, argument = c("rounds", "seed"), message = "`seed`")
  # What has no part in the result may differ, and so may weights that are not played.
  expect_s3_class(play(policy = policy_network(), seed = 1L, progress = FALSE), "gym_search")
})

test_that("a damaged or foreign file is an error, and stays as it is", {
  path <- local_checkpoint()
  env <- fake_environment()
  quiet_search(env, rounds = 2, checkpoint = path)
  whole <- readBin(path, "raw", file.size(path))
  flipped <- function(at) {
    bytes <- whole
    bytes[[at]] <- xor(bytes[[at]], as.raw(1))
    bytes
  }
  n <- length(whole)
  foreign <- function(x) serialize(x, NULL)
  newer <- structure(list(format = 99L, version = "9.9.9"), class = "gym_checkpoint")
  contents <- c(
    lapply(c(0, 1, 100, n %/% 2, n - 1), function(k) whole[seq_len(k)]),
    lapply(c(n %/% 3, n %/% 2, n - 200), flipped),
    list(charToRaw("a,b\n1,2\n"), foreign(mtcars), foreign(NULL), foreign(newer))
  )
  for (bytes in contents) {
    writeBin(bytes, path)
    expect_error(
      quiet_search("CartPole-v1", rounds = 2, checkpoint = path, client = no_client()),
      "resume = FALSE", fixed = TRUE, class = "gym_error_checkpoint"
    )
    expect_identical(readBin(path, "raw", n), bytes)
  }
  expect_error(quiet_search(env, checkpoint = path), "9.9.9", fixed = TRUE)
  again <- quiet_search(env, rounds = 2, checkpoint = path, resume = FALSE)
  expect_identical(nrow(again$rounds), 2L)
  expect_identical(nrow(quiet_search(env, rounds = 2, checkpoint = path)$rounds), 2L)
})

test_that("a file of an older version says that it is one", {
  # As version 1.0.0 wrote them.
  old <- structure(
    list(format = 5L, version = "1.0.0", hash = "", state = raw(1)), class = "gym_checkpoint"
  )
  path <- local_checkpoint(serialize(old, NULL))
  play <- function(...) quiet_search(fake_environment(), rounds = 1, checkpoint = path, ...)
  expect_error(play(), "was written by an older version of this package",
               class = "gym_error_checkpoint")
  expect_s3_class(play(resume = FALSE), "gym_search")
})

test_that("a place where no file can be is refused before anything is made", {
  folder <- withr::local_tempdir()
  for (path in c(folder, file.path(folder, "none", "search.rds"))) {
    expect_error(quiet_search(checkpoint = path, client = no_client()),
                 class = "gym_error_checkpoint")
  }
  expect_error(quiet_search(checkpoint = 1, client = no_client()), "checkpoint",
               class = "gym_error_argument")
  expect_error(quiet_search(resume = NA, client = no_client()), "resume",
               class = "gym_error_argument")
})

test_that("a disk that is full in the middle warns once and ends nothing", {
  local_functions(rest_per_writing = 0)
  folder <- withr::local_tempdir()
  env <- fake_environment()
  step <- env$step
  env$step <- function(action) {
    if (length(env$seeds) == 5L) unlink(folder, recursive = TRUE)
    step(action)
  }
  warnings <- testthat::capture_warnings(
    search <- quiet_search(env, rounds = 5, episodes = 2, target = Inf,
                            checkpoint = file.path(folder, "search.rds"))
  )
  expect_length(warnings, 1)
  expect_match(warnings, "continues without")
  expect_identical(nrow(search$rounds), 5L)
})

test_that("a write that ends in the middle leaves the file before it, and nothing else", {
  folder <- withr::local_tempdir()
  path <- file.path(folder, "search.rds")
  quiet_search(fake_environment(), rounds = 2, seed = 1, checkpoint = path)
  before <- readBin(path, "raw", 1e6)
  local_functions(replace_file = function(from, to) rlang::interrupt())
  tryCatch(write_checkpoint(path, list(1)), interrupt = function(cnd) NULL)
  expect_identical(readBin(path, "raw", 1e6), before)
  expect_identical(list.files(folder), "search.rds")
})

test_that("what a kill in the middle of a write has left goes with the next start", {
  folder <- withr::local_tempdir()
  left <- file.path(folder, c("search.rds-1-a.part", "search.rds-2-b.part", "other.part"))
  file.create(left)
  Sys.setFileTime(left[c(1, 3)], Sys.time() - 3600)
  quiet_search(fake_environment(), rounds = 1, checkpoint = file.path(folder, "search.rds"))
  expect_setequal(list.files(folder), c("search.rds", basename(left[2:3])))
})

test_that("the file stays small: of the policies those are kept that are needed", {
  path <- local_checkpoint()
  quiet_search(fake_environment(), policy_network(c(4, 100, 1)), rounds = 40, episodes = 1,
                target = Inf, checkpoint = path)
  # 500 weights are 4 kB, and there were 40 networks.
  expect_lt(file.size(path), 50000)
})

test_that("a relative path is that of the folder at the start", {
  folder <- normalizePath(withr::local_tempdir())
  other <- withr::local_tempdir()
  withr::local_dir(folder)
  env <- fake_environment()
  reset <- env$reset
  env$reset <- function(...) {
    setwd(other)
    reset(...)
  }
  quiet_search(env, rounds = 2, checkpoint = "here.rds")
  expect_identical(list.files(folder), "here.rds")
  expect_identical(read_checkpoint(file.path(folder, "here.rds"), NULL)$training$iteration, 2L)
  expect_identical(list.files(other), character())
})

test_that("a server that plays other episodes than the one before is an error", {
  kept <- local_kept_files()
  play <- function(threshold, path) {
    quiet_search(fake_environment(reward_threshold = threshold), rounds = 3, checkpoint = path)
  }
  play(100, local_checkpoint())
  cnd <- expect_error(play(99, local_checkpoint(kept$list[[2]])), "threshold.*100.*99",
                      class = "gym_error_checkpoint")
  # No argument of the call differs.
  expect_null(cnd$argument)
})

test_that("kill -9 of the server: the same call goes on to the result of an undisturbed search", {
  skip_unless_all()
  path <- local_checkpoint()
  # Kills its server when it takes step `last`.
  play <- function(server, last = Inf, ...) {
    env <- gym_make("CartPole-v1", num_envs = 32, client = server)
    process <- the_session$servers[[server$remote_base]]$process
    steps <<- 0
    step <- env$step
    unlockBinding("step", env)
    env$step <- function(...) {
      steps <<- steps + 1
      if (steps == last) process$kill()
      step(...)
    }
    quiet_search(env, rounds = 40, target = Inf, seed = 1, ...)
  }
  server <- local_server()
  undisturbed <- play(server)
  all <- steps
  for (share in c(0.6, 0.3)) {
    expect_error(play(server, round(share * all), checkpoint = path),
                 class = "gym_error_connection")
    expect_true(file.exists(path))
    server <- local_server()
  }
  search <- play(server, checkpoint = path)
  expect_lt(steps, 0.5 * all)
  expect_identical(figures(search), figures(undisturbed))
})

test_that("a search says that it goes on, and how far the file is, or that it had ended", {
  kept <- local_kept_files()
  play <- function(path) {
    search_random(fake_environment(reward = first_action), rounds = 4, episodes = 2, target = Inf,
                  seed = 1, checkpoint = path)
  }
  path <- local_checkpoint()
  expect_no_condition(play(path), class = "gym_message_resumed")
  expect_message(play(path), "has already ended", class = "gym_message_resumed")
  half <- local_checkpoint(kept$list[[3]])
  expect_message(play(half), "after 2 of 4 rounds", class = "gym_message_resumed")
})

test_that("of two searches on one file the one that is further is kept, with a warning", {
  local_functions(rest_per_writing = 0)
  path <- local_checkpoint()
  writer <- function(steps, arguments = list(seed = 1), saved = NULL) {
    played <- rlang::env(steps = steps)
    state <- function() {
      list(what = "search", arguments = arguments, training = list(steps = played$steps),
           rest = numeric(played$steps))
    }
    opened <- open_checkpoint(path, arguments, resume = TRUE, "search", NULL)
    played$write <- checkpoint_writer(opened, state, "search", NULL)
    played
  }
  steps_kept <- function() read_checkpoint(path, NULL)$training$steps
  slow <- writer(0)
  quick <- writer(0)
  quick$steps <- 30
  expect_silent(quick$write())
  slow$steps <- 10
  expect_warning(slow$write(), "ahead", class = "gym_warning_checkpoint")
  expect_silent(slow$write())
  expect_identical(steps_kept(), 30)
  # Where the other has ended it is overtaken.
  slow$steps <- 40
  expect_silent(slow$write())
  expect_identical(steps_kept(), 40)
  unlink(path)
  other <- writer(1, list(seed = 2))
  expect_warning(quick$write(), "another search", class = "gym_warning_checkpoint")
  expect_identical(steps_kept(), 1)
})

test_that("files that cannot be written leave no connection behind", {
  skip_unless_all()
  connections <- function() nrow(showConnections(all = TRUE))
  before <- connections()
  nowhere <- file.path(withr::local_tempdir(), "no", "file")
  for (i in 1:3) {
    expect_error(write_bytes(nowhere, raw(10), "ab"), "cannot open")
    expect_error(write_checkpoint(nowhere, 1), "cannot open")
    expect_error(write_config(nowhere, list(seed = 1)))
  }
  skip_if_not(file.exists("/dev/full"))
  expect_error(write_bytes("/dev/full", raw(10), "wb"), "not all")
  expect_error(write_bytes("/dev/full", raw(10), "ab"), "not all")
  expect_identical(connections(), before)
})
