play_episodes <- function(env, episodes) {
  vapply(seq_len(episodes), function(episode) {
    env$reset()
    steps <- 0
    repeat {
      steps <- steps + 1
      if (env$step(1)$done) return(steps)
    }
  }, numeric(1))
}

test_that("each finished episode is a row", {
  env <- local_env(seed = 1)
  directory <- withr::local_tempdir()
  expect_invisible(env_monitor_start(env$client, env$instance_id, directory))
  lengths <- play_episodes(env, 3)
  expect_warning(env$step(1), class = "gym_warning_step_after_done")
  env_monitor_close(env$client, env$instance_id)
  play_episodes(env, 1)
  rows <- read.csv(file.path(directory, "episodes.csv"))
  expect_named(rows, c("episode", "return", "length", "seconds"))
  expect_equal(rows$length, lengths)
  expect_equal(rows$return, lengths)
  expect_true(all(rows$seconds >= 0))
})

test_that("resume goes on counting, force begins anew, neither is refused", {
  directory <- withr::local_tempdir()
  keep <- file.path(directory, "notes.txt")
  writeLines("mine", keep)
  episodes <- function(...) {
    env <- local_env(seed = 1)
    env_monitor_start(env$client, env$instance_id, directory, ...)
    play_episodes(env, 2)
    env_monitor_close(env$client, env$instance_id)
    read.csv(file.path(directory, "episodes.csv"))$episode
  }
  first <- episodes()
  expect_length(first, 2)
  expect_error(episodes(), class = "gym_error_http_400")
  resumed <- episodes(resume = TRUE)
  expect_equal(resumed, first[1] + 0:3)
  expect_equal(episodes(force = TRUE), first)
  expect_equal(readLines(keep), "mine")
})

test_that("several environments that name one directory each have one of their own", {
  directory <- withr::local_tempdir()
  envs <- list(local_env(seed = 1), local_env(seed = 2), local_env(seed = 3))
  for (env in envs) {
    env_monitor_start(env$client, env$instance_id, directory, force = TRUE)
  }
  lengths <- lapply(envs, play_episodes, episodes = 2)
  ids <- vapply(envs, function(env) env$instance_id, "")
  tables <- file.path(c(directory, file.path(directory, ids[-1])), "episodes.csv")
  recorded <- lapply(tables, function(table) read.csv(table)$length)
  expect_equal(recorded, lengths)
  found <- list.files(directory, "^episodes[.]csv$", recursive = TRUE, full.names = TRUE)
  expect_setequal(found, tables)
})

test_that("closing a monitor twice, or none, is no error", {
  env <- local_env()
  expect_invisible(env_monitor_close(env$client, env$instance_id))
  env_monitor_start(env$client, env$instance_id, withr::local_tempdir())
  env_monitor_close(env$client, env$instance_id)
  expect_no_error(env_monitor_close(env$client, env$instance_id))
})

test_that("a directory outside is refused", {
  env <- local_env()
  for (directory in c("/usr/gym-monitor", "../../gym-monitor")) {
    error <- expect_error(
      env_monitor_start(env$client, env$instance_id, directory), class = "gym_error_http_400"
    )
    expect_identical(error$code, "monitor_directory")
  }
})

test_that("bad arguments are refused before anything is sent", {
  env <- local_env()
  start <- function(...) env_monitor_start(env$client, env$instance_id, ...)
  expect_error(start(NULL), "directory", class = "gym_error_argument")
  expect_error(start("a", force = NA), "force", class = "gym_error_argument")
  expect_error(start("a", video_callable = 0), "video_callable", class = "gym_error_argument")
})

test_that("videos are recorded where they are asked for", {
  directory <- withr::local_tempdir()
  env <- local_env(seed = 1)
  started <- tryCatch(
    env_monitor_start(env$client, env$instance_id, directory, video_callable = 2),
    gym_error_http_400 = function(cnd) cnd$code
  )
  skip_if(identical(started, "video_unavailable"), "the server's extra `video` is not installed")
  play_episodes(env, 3)
  env_monitor_close(env$client, env$instance_id)
  videos <- list.files(directory, pattern = "\\.mp4$")
  expect_length(videos, 2)
  expect_true(all(file.size(file.path(directory, videos)) > 1000))
})
