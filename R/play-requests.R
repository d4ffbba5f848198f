# Requests episodes from a server and reads its answers.

# The intended time of a request, in seconds. The progress bar moves this often, and an interrupt
# waits at most about this long for the server.
request_seconds <- 0.25

#' Play by requests, two at a time
#' @param play As returned by [new_play()].
#' @noRd
play_requests <- function(play) {
  vector_env <- play$vector_env
  known <- vector_env$known
  play$size <- first_size(play)
  perform_several(
    vector_env$client, rollouts_route,
    next_content = function() {
      piece <- take_piece(play)
      if (!is.null(piece)) c(piece, list(body = episodes_body(play, piece)))
    },
    received = function(piece, response, seconds) {
      if (response$status_code >= 400L) {
        error <- with_answer(response)[c("status_code", "url", "answer", "headers", "type")]
        return(take_played(play, piece, NULL, error))
      }
      played <- read_played(play, piece, response)
      units <- piece$units * length(played$batch$return) / (piece$last - piece$first + 1)
      play$size <- known$size <- next_size(units, seconds, request_seconds)
      take_played(play, piece, played$batch, played$error)
    },
    call = vector_env$call
  )
}

# The number of units of the first piece: half of the last size, because with another policy a unit
# may take longer, but at least an episode for each process (or one group of episodes).
first_size <- function(play) {
  least <- if (is.null(play$episodes$row)) play$vector_env$description$processes else 1L
  max(least, (play$vector_env$known$size %||% 0L) %/% 2L)
}

# The number of units of the next piece, so that it takes about `wanted` seconds.
next_size <- function(units, seconds, wanted) {
  as.integer(max(1, min(8 * units, units * wanted / max(seconds, 0.001), 2^20)))
}

episodes_body <- function(play, piece) {
  at <- piece$first:piece$last
  vector_env <- play$vector_env
  episodes <- lapply(play$episodes, `[`, at)
  candidates <- unique(episodes$candidate)
  if (!identical(candidates, play$sent_candidates)) {
    play$sent <- policy_data(play$policy_of(candidates), vector_env)
    play$sent_candidates <- candidates
  }
  policy <- play$sent$tensors
  tensors <- c(
    list(seed = data_tensor(episodes$seed, "I64")),
    if (length(candidates) > 1L) {
      list(candidate = data_tensor(match(episodes$candidate, candidates) - 1L, "I32"))
    },
    if (!is.null(episodes$row)) list(row = data_tensor(episodes$row, "I32")),
    stats::setNames(
      lapply(policy, data_tensor, dtype = "F64"), paste0("policy/", names(policy), recycle0 = TRUE)
    )
  )
  write_tensors(tensors, c(
    vector_env$description$fields, policy = to_json(play$sent$document),
    max_steps = if (is.finite(play$max_steps)) whole_text(play$max_steps),
    keep = if (length(play$keep)) to_json(as.list(play$keep))
  ))
}

data_tensor <- function(values, dtype) {
  list(
    dtype = dtype, shape = array_shape(values),
    bytes = tensor_types[[dtype]]$write(row_major(values))
  )
}

# Answers ------------------------------------------------------------------------------------

#' Read the answer to a piece
#' @return A list: `batch`, as returned by [play_batch()], and `error`, the error of the next
#'   episode, see [take_played()].
#' @noRd
read_played <- function(play, piece, response) {
  call <- play$vector_env$call
  answer <- read_answer(response, "POST", call)
  error <- answer$error
  if (!is.null(error)) {
    error <- list(status_code = error$status, url = response$url, answer = error$body)
  }
  batch <- read_values(read_batch(play, piece, answer), "Its episodes")
  if (is.null(error) && !length(batch$return)) {
    abort_answer("It has no episodes", call)
  }
  list(batch = batch, error = error)
}

read_batch <- function(play, piece, answer) {
  tensors <- answer$tensors
  n <- length(tensors[["return"]])
  if (n > piece$last - piece$first + 1L) {
    abort_answer(paste("It has", n, "episodes"))
  }
  batch <- lapply(
    play$episodes[c("candidate", "episode", "seed", "sub_env")], `[`, piece$first - 1L + seq_len(n)
  )
  batch[["return"]] <- tensor_of(tensors, "return", n, is.double)
  batch$length <- tensor_of(tensors, "length", n, is.integer)
  for (flag in c("terminated", "truncated")) {
    batch[[flag]] <- tensor_of(tensors, flag, n, is.logical)
  }
  if ("moments" %in% play$keep) batch$moments <- read_moments(tensors, n)
  if ("steps" %in% play$keep && n) batch$steps <- list(read_steps(play, batch$length, answer))
  batch
}

tensor_of <- function(tensors, name, n, is_right) {
  values <- tensors[[name]]
  if (length(values) != n || !is_right(values)) {
    abort_answer(paste0("Its tensor \"", name, "\" is not what it must be"))
  }
  as.vector(values)
}

# The moments of the observations of each episode.
read_moments <- function(tensors, n) {
  count <- tensor_of(tensors, "moments/count", n, is.double)
  rows <- function(name) {
    values <- tensors[[name]]
    if (!is.double(values) || !identical(dim(values)[1L], n)) {
      abort_answer(paste0("Its tensor \"", name, "\" is not what it must be"))
    }
    values
  }
  mean <- rows("moments/mean")
  squares <- rows("moments/squares")
  lapply(seq_len(n), function(i) new_moments(count[[i]], mean[i, ], squares[i, ]))
}

# The steps of some episodes, in the same form as one element of the `steps` of play_batch().
read_steps <- function(play, lengths, answer) {
  vector_env <- play$vector_env
  n <- sum(lengths)
  read <- function(space, name) {
    from_tensors(batch_space(space, n), name, answer)
  }
  observed <- vector_env$observation_space
  tensors <- answer$tensors
  list(
    at = rep(seq_along(lengths), lengths), observation = read(observed, "observation"),
    action = read(vector_env$action_space, "action"),
    reward = tensor_of(tensors, "step/reward", n, is.double),
    terminated = tensor_of(tensors, "step/terminated", n, is.logical),
    truncated = tensor_of(tensors, "step/truncated", n, is.logical),
    next_observation = if ("next_observation" %in% play$keep) read(observed, "next_observation")
  )
}
