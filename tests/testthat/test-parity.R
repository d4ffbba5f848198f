# What R sees is what Python sees: each environment of environments.csv is played by
# the server for R, and in process by reference_trajectories.py, with the same seed
# and actions. The observations, rewards, flags and frames are compared byte by byte.
#
# All Atari games observe large pictures, and all robots long vectors: one game in eighty plays 20
# steps, and one robot in six 30, as all others do; `make test` has a sixth of these play 10. With
# GYM_TEST_PARITY=all, as `make soak` has it, every environment plays 200. (The server's
# test_environments.py makes, resets, steps and draws games and others.)

registered <- utils::read.csv(test_path("environments.csv"), na.strings = "")
played <- registered[is.na(registered$why_not), ]
if (soaks("GYM_TEST_PARITY")) {
  played$steps <- 200L
} else {
  played$steps <- if (tests_all()) ifelse(played$family == "atari", 20L, 30L) else 10L
  every <- c(atari = 80L, mujoco = 6L)
  for (family in names(every)) {
    alike <- which(played$family == family)
    played <- played[-alike[seq_along(alike) %% every[[family]] != 1L], ]
  }
  if (!tests_all()) played <- played[seq_len(nrow(played)) %% 6L == 1L, ]
}
played$file <- sprintf("%04d", seq_len(nrow(played)))

# Started by the first test; works ahead on the next environments.
reference <- new.env()

start_reference <- function(client, frame) {
  reference$directory <- withr::local_tempdir(.local_envir = frame)
  lines <- file.path(reference$directory, "lines")
  known <- played[played$id %in% reference$available, ]
  writeLines(paste(known$file, known$id, known$steps), lines)
  reference$log <- file.path(reference$directory, "log")
  server <- system.file("server", package = "gym")
  reference$process <- processx::process$new(
    the_session$servers[[client$remote_base]]$python,
    c(normalizePath(test_path("reference_trajectories.py")), reference$directory),
    stdin = lines, stdout = NULL, stderr = reference$log,
    env = c("current", PYTHONPATH = server, PYTHONWARNINGS = "ignore"),
    # Where MuJoCo writes its log.
    wd = reference$directory
  )
  withr::defer(reference$process$kill(), envir = frame)
}

reference_bytes <- function(file) {
  path <- file.path(reference$directory, file)
  failed <- paste0(path, ".failed")
  while (!file.exists(path) && !file.exists(failed) && reference$process$is_alive()) {
    Sys.sleep(0.01)
  }
  if (!file.exists(path)) {
    reason <- if (file.exists(failed)) failed else reference$log
    stop("No reference: ", paste(readLines(reason, warn = FALSE), collapse = " "))
  }
  on.exit(unlink(path))
  readBin(path, "raw", file.size(path))
}

value_bytes <- function(space, value) {
  if (is.list(space$spaces)) {
    unlist(Map(value_bytes, unname(space$spaces), unname(value)))
  } else if (identical(space$dtype, "uint8")) {
    as.raw(row_major(value))
  } else {
    double_bytes(row_major(value))
  }
}

double_bytes <- function(x) writeBin(as.double(x), raw(), endian = "little")

# Plays like the reference and compares on the way, so that the first difference is
# found where it is. Returns the number of steps.
play_beside <- function(env, steps, expected) {
  at <- 0L
  compare <- function(bytes, what) {
    same <- identical(bytes, expected[at + seq_along(bytes)])
    at <<- at + length(bytes)
    if (!same) stop(what, " is not what Python has", call. = FALSE)
  }
  draws <- isTRUE(about_instance(env)$render_mode == "rgb_array")
  space <- env$observation_space
  frame <- function(when) if (draws) compare(as.raw(row_major(env$render())), paste("frame", when))
  compare(value_bytes(space, env$reset()), "first observation")
  frame("of the reset")
  for (step in seq_len(steps)) {
    out <- env$step(env_action_space_sample(env$client, env$instance_id))
    compare(value_bytes(space, out$observation), paste("observation", step))
    compare(double_bytes(c(out$reward, out$terminated, out$truncated)), paste("reward", step))
    if (step %% 10L == 0L) frame(step)
    if (out$done) env$reset()
  }
  expect_identical(at, length(expected))
  step
}

about_instance <- function(env) {
  get_request(env$client, paste0("/v1/envs/", env$instance_id, "/"))
}

this_file <- environment()

test_that("every environment of the registry is in the list", {
  client <- test_client()
  registry <- env_registry(client)
  reference$available <- registry$id[registry$available]
  start_reference(client, this_file)
  expect_identical(setdiff(registry$id, registered$id), character())
})

test_that("what the list says cannot be played cannot be made", {
  client <- test_client()
  refused <- registered$id[!is.na(registered$why_not)]
  for (id in refused) {
    expect_error(env_create(client, id), class = "gym_error_http")
  }
})

for (i in seq_len(nrow(played))) local({
  row <- played[i, ]
  test_that(paste(row$id, "through R is", row$id, "in Python"), {
    client <- test_client()
    if (!row$id %in% reference$available) {
      skip(paste("this server lacks the extra", row$family))
    }
    env <- local_env(row$id, seed = 7, client = client)
    expected <- reference_bytes(row$file)
    expect_identical(play_beside(env, row$steps, expected), row$steps)
    env$close()
  })
})
