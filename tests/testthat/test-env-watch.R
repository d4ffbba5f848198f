# A viewer that notes the addresses that it is given; the page is there at once.
local_viewer <- function(frame = parent.frame()) {
  seen <- new.env(parent = emptyenv())
  seen$addresses <- character()
  withr::local_options(
    gym.viewer = function(address) {
      seen$addresses <- c(seen$addresses, address)
      be_there(address)
    },
    .local_envir = frame
  )
  seen
}

be_there <- function(address) curl::curl_fetch_memory(below(address, "presence/"))

# An address below a page's, with the page's key.
below <- function(address, path) sub("?", paste0(path, "?"), address, fixed = TRUE)

without_key <- function(address) sub("[?]key=[A-Za-z0-9_-]+$", "", address)

# The page, as a browser asks for it.
fetch_page <- function(address) {
  handle <- curl::new_handle()
  curl::handle_setheaders(handle, Accept = "text/html")
  curl::curl_fetch_memory(address, handle)
}

test_that("env_watch() gives the address of a page", {
  seen <- local_viewer()
  env <- local_env()
  address <- expect_invisible(env_watch(env$client, env$instance_id))
  expect_identical(
    without_key(address), paste0(env$client$remote_base, "/v1/envs/", env$instance_id, "/watch/")
  )
  expect_identical(without_key(env$watch()), without_key(address))
  expect_identical(without_key(seen$addresses), rep(without_key(address), 2))
  page <- fetch_page(address)
  expect_identical(page$status_code, 200L)
  expect_match(page$type, "text/html")
})

test_that("an environment that is not there cannot be watched", {
  seen <- local_viewer()
  expect_error(env_watch(test_client(), "00000000"), class = "gym_error_http_400")
  env <- local_env()
  env$close()
  expect_error(env$watch(), class = "gym_error_argument")
  expect_length(seen$addresses, 0)
})

test_that("the first step with render = TRUE opens the page, and no other", {
  seen <- local_viewer()
  client <- test_client()
  instance_id <- env_create(client, "CartPole-v1")
  withr::defer(env_close(client, instance_id))
  env_reset(client, instance_id)
  env_step(client, instance_id, 1)
  expect_length(seen$addresses, 0)
  for (i in 1:3) env_step(client, instance_id, 1, render = TRUE)
  expect_length(seen$addresses, 1)
  expect_match(seen$addresses, instance_id)
})

test_that("an environment with render_mode \"human\" opens its page when it is made", {
  seen <- local_viewer()
  env <- local_env(render_mode = "human")
  expect_match(seen$addresses, env$instance_id)
  env$reset()
  env_step(env$client, env$instance_id, 1, render = TRUE)
  sub_envs <- local_env(render_mode = "human", num_envs = 2)
  expect_length(seen$addresses, 2)
  local_env(render_mode = "rgb_array")
  expect_length(seen$addresses, 2)
})

test_that("a viewer that fails leaves no environment behind", {
  withr::local_options(gym.viewer = function(address) stop("there is no screen"))
  client <- test_client()
  before <- env_list(client)$instance_id
  expect_error(gym_make("CartPole-v1", render_mode = "human", client = client), "no screen")
  expect_error(env_create(client, "CartPole-v1", render_mode = "human"), "no screen")
  expect_identical(env_list(client)$instance_id, before)
})

test_that("a script prints the address, once an environment", {
  withr::local_options(gym.viewer = NULL, rlang_interactive = FALSE)
  expect_message(env <- local_env(render_mode = "human"), class = "gym_message_watch")
  env$reset()
  expect_no_message(env_step(env$client, env$instance_id, 1, render = TRUE))
  expect_message(env$watch(), "Watch CartPole-v1 at http.*/watch/[?]key=[^/ ]+$",
                 class = "gym_message_watch")
})

test_that("an interactive session opens the pane where there is one, else the browser", {
  opened <- character()
  open_as <- function(name) {
    function(url) {
      opened <<- c(opened, name)
      be_there(url)
    }
  }
  withr::local_options(
    gym.viewer = NULL, rlang_interactive = TRUE,
    viewer = open_as("pane"), browser = open_as("browser")
  )
  env <- local_env()
  expect_no_message(env$watch())
  withr::local_options(viewer = NULL)
  expect_no_message(env$watch())
  expect_identical(opened, c("pane", "browser"))
  # A machine without a browser.
  withr::local_options(browser = function(url) stop("no display"))
  expect_message(env$watch(), class = "gym_message_watch")
})

test_that("the address is printed when nobody came", {
  local_binding("watcher_timeout", 0.3)
  # What xdg-open does without a display: nothing, and no error.
  withr::local_options(
    gym.viewer = NULL, rlang_interactive = TRUE, viewer = NULL, browser = function(url) NULL
  )
  env <- local_env()
  expect_message(env$watch(), "Watch CartPole-v1 at http", class = "gym_message_watch")
  withr::local_options(gym.viewer = function(address) NULL)
  expect_message(env$watch(), class = "gym_message_watch")
  withr::local_options(gym.viewer = FALSE)
  expect_no_message(env$watch())
})

test_that("the option gym.viewer may ask for silence, and must make sense", {
  withr::local_options(gym.viewer = FALSE, rlang_interactive = TRUE)
  expect_no_message(env <- local_env(render_mode = "human"))
  expect_no_message(address <- env$watch())
  expect_match(address, env$instance_id)
  before <- env_list_all(env$client)
  withr::local_options(gym.viewer = "firefox")
  error <- expect_error(env$watch(), "gym.viewer", class = "gym_error_argument")
  expect_error(gym_make("CartPole-v1", render_mode = "human"), class = "gym_error_argument")
  expect_identical(env_list_all(env$client), before)
})

test_that("the call knows when the page is there", {
  client <- test_client()
  asked <- 0
  withr::local_options(gym.viewer = function(address) {
    # What the page does first.
    get_request(client, sub(client$remote_base, "", below(address, "state/"), fixed = TRUE))
    asked <<- asked + 1
  })
  env <- local_env(client = client)
  env$watch()
  expect_identical(asked, 1)
  expect_true(get_answer(client, paste0("/v1/envs/", env$instance_id))$watched)
})

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
