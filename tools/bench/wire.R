# Measures what R's own calls add to a step: the microseconds of a step of CartPole through
# env$step(), and of a curl handle that only exchanges the same bytes.

wire_names <- c(
  gym = "gym, env$step()", parsed = "bare handle, read and checked", bare = "bare handle"
)

compare_steps <- function(python, turns, steps) {
  client <- gym_server_start(python = python, token = FALSE)
  recorder <- start_recorder(python, client)
  on.exit({
    end_worker(recorder)
    gym_server_stop(client)
  })
  contenders <- c(
    single_step_contenders(client, recorder),
    unlist(lapply(c(32L, 1024L, 8192L), function(num_envs) {
      vector_step_contenders(client, recorder, num_envs)
    }), recursive = FALSE)
  )
  for (contender in contenders) contender$play(steps)
  do.call(rbind, lapply(seq_len(turns), function(turn) {
    if (turn %% 10L == 1L) progress("steps one by one, turn ", turn, " of ", turns)
    order <- if (turn %% 2L) contenders else rev(contenders)
    do.call(rbind, lapply(order, function(one) {
      measured("wire", one$num_envs, one$name, one$called, turn, one$play(steps), "microseconds")
    }))
  }))
}

single_step_contenders <- function(client, recorder) {
  env <- gym_make("CartPole-v1", seed = 1, client = client)
  bare <- bare_step(client, recorder, NULL)
  list(
    step_contender(0, "gym", "env$step(a)", play_env_steps(env, 1L)),
    step_contender(0, "parsed", "curl_fetch_memory(), readBin()", function(steps) {
      play_bare_steps(bare, steps, read_step)
    }),
    step_contender(0, "bare", "curl_fetch_memory()", function(steps) {
      play_bare_steps(bare, steps, check_status)
    })
  )
}

vector_step_contenders <- function(client, recorder, num_envs) {
  env <- gym_make("CartPole-v1", num_envs = num_envs, seed = 1, client = client)
  bare <- bare_step(client, recorder, num_envs)
  list(
    step_contender(num_envs, "gym", paste("env$step(a),", env$vectorization_mode),
                   play_env_steps(env, num_envs)),
    step_contender(num_envs, "bare", "curl_fetch_memory()", function(steps) {
      play_bare_steps(bare, steps, check_status)
    })
  )
}

step_contender <- function(num_envs, name, called, play) {
  list(num_envs = num_envs, name = wire_names[[name]], called = called, play = play)
}

# The clock -----------------------------------------------------------------------

# With alternating actions, no pole falls for this many steps after a reset. The time of resets is
# not counted.
steps_to_reset <- 8L

# The microseconds of a step. `prepare()` is not timed. `step(i)` takes the ith step after it.
time_steps <- function(steps, prepare, step) {
  took <- 0
  blocks <- ceiling(steps / steps_to_reset)
  for (block in seq_len(blocks)) {
    prepare()
    started <- Sys.time()
    for (i in seq_len(steps_to_reset)) step(i)
    took <- took + as.numeric(Sys.time() - started, units = "secs")
  }
  1e6 * took / (blocks * steps_to_reset)
}

play_env_steps <- function(env, num_envs) {
  actions <- alternating(num_envs)
  env$reset(seed = 1)
  function(steps) {
    time_steps(steps, function() env$reset(seed = 1), function(i) env$step(actions[[1L + i %% 2L]]))
  }
}

# The bare handle -------------------------------------------------------------------

start_recorder <- function(python, client) {
  port <- sub(".*:([0-9]+).*", "\\1", client$remote_base)
  start_worker(python, c("tools/bench/recorder.py", port))
}

# Makes an environment, takes steps with both actions through the recorder, and returns what is
# needed to send such steps directly to the server.
bare_step <- function(client, recorder, num_envs) {
  # With a header of httr, steps go by HTTP.
  by_way <- create_GymClient(
    sprintf("http://127.0.0.1:%d", ask(recorder, "port")), config = httr::add_headers(By = "HTTP")
  )
  env <- gym_make("CartPole-v1", num_envs = num_envs, seed = 1, client = by_way)
  env$reset(seed = 1)
  requests <- lapply(alternating(max(num_envs, 1L)), function(actions) {
    env$step(actions)
    ask(recorder, "last")
  })
  # Use the benchmark's own key.
  path <- sub("^POST (\\S+)[?]key=[^&]*(\\S+) .*", "\\1?key=bench\\2", requests[[1L]]$head)
  bare <- new.env()
  bare$env <- env
  bare$url <- paste0(client$remote_base, path)
  bare$messages <- lapply(requests, function(one) jsonlite::base64_dec(one$body))
  bare$number <- 1e5
  bare$size <- -1
  bare$handle <- curl::new_handle(
    post = TRUE, buffersize = 2^18, readfunction = function(nbytes, ...) next_chunk(bare, nbytes)
  )
  curl::handle_setheaders(bare$handle, .list = recorded_headers(requests[[1L]]$head))
  bare
}

# Setting a body on a handle takes as long as half a request. So curl reads it from a function, and
# only its size is set if it changes.
exchange <- function(bare, body) {
  if (length(body) != bare$size) {
    bare$size <- length(body)
    curl::handle_setopt(bare$handle, postfieldsize_large = bare$size)
  }
  bare$body <- body
  bare$sent <- 0
  curl::curl_fetch_memory(bare$url, bare$handle)
}

next_chunk <- function(bare, nbytes) {
  if (bare$sent == 0 && length(bare$body) <= nbytes) {
    bare$sent <- length(bare$body)
    return(bare$body)
  }
  chunk <- bare$body[bare$sent + seq_len(min(nbytes, length(bare$body) - bare$sent))]
  bare$sent <- bare$sent + length(chunk)
  chunk
}

# The headers that curl does not write by itself.
recorded_headers <- function(head) {
  lines <- strsplit(trimws(head), "\r\n", fixed = TRUE)[[1L]][-1L]
  headers <- stats::setNames(as.list(sub("^[^:]*: *", "", lines)), sub(":.*", "", lines))
  own <- c("host", "content-length", "expect")
  c(headers[!tolower(names(headers)) %in% own], Expect = "")
}

# A message with a number of the bench's own.
numbered_message <- function(message, number) {
  message[9:16] <- writeBin(number, raw(), endian = "little")
  message
}

# The bodies are made before the clock starts.
play_bare_steps <- function(bare, steps, read) {
  bodies <- NULL
  time_steps(
    steps,
    function() {
      bare$env$reset(seed = 1)
      bodies <<- lapply(seq_len(steps_to_reset), function(i) {
        numbered_message(bare$messages[[1L + i %% 2L]], bare$number + i)
      })
      bare$number <- bare$number + steps_to_reset
    },
    function(i) read(exchange(bare, bodies[[i]]))
  )
}

check_status <- function(response) {
  if (response$status_code != 200L) {
    stop("The server refused the bare handle's step: ", rawToChar(response$content))
  }
}

# Reads the answer as a careful client of a few lines would.
read_step <- function(response) {
  check_status(response)
  numbers <- readBin(c(raw(4L), response$content), "double", 17L, endian = "little")
  stopifnot(length(numbers) == 17L, numbers[9:10] %in% 0:1)
  list(
    observation = numbers[4:7], reward = numbers[[8L]], terminated = numbers[[9L]] == 1,
    truncated = numbers[[10L]] == 1, done = any(numbers[9:10] == 1), info = list()
  )
}
