# The messages of steps and resets, by a stream or by HTTP, and how to read their answers. Usual
# answers are numbers of one dtype, which R reads in one call.

# With more numbers, the head of a WebSocket frame would be longer than numbers_message() expects.
most_as_float64 <- 8000

# Whether the server can answer in float64: R must be able to represent all values, and the answer
# must fit into a frame that R reads in one call.
takes_numbers <- function(space, num_envs) {
  if (!isTRUE((num_envs %||% 1L) * (count_numbers(space) + 3) <= most_as_float64)) {
    FALSE
  } else if (inherits(space, "gym_space_discrete")) {
    within_integer(unlist(space_bounds(space)))
  } else {
    inherits(space, "gym_space_array") && (is_float(space) || space$dtype %in% small_dtypes)
  }
}

small_dtypes <- c("int8", "int16", "uint8", "uint16")

#' Prepare the messages of a kind of steps
#' @param request The request that [ask_instance()] makes.
#' @param layout From [message_layout()].
#' @param n The number of sub-environments that step, `NULL` for a single environment.
#' @return A list for [ask_stream()], with `write`, a function of an action that returns its bytes,
#'   or `NULL` if `request` must check the action.
#' @noRd
step_message <- function(instance, request, layout, n, render, named, infos, finals) {
  num_envs <- instance$num_envs
  selects <- !identical(n, num_envs)
  message <- if (has_numbers(layout$step)) {
    space <- sent_space(instance$single_observation_space, n)
    count <- prod(space$shape) + 3 * (n %||% 1)
    numbers_message(request, count, step_reader_of_numbers(space, n, named))
  } else {
    arrays_message(request, layout_of_rows(layout$step, n, num_envs))
  }
  write <- array_writer(instance$single_action_space, n)
  message$write <- if (selects) {
    mask <- c(as.raw(seq_len(num_envs) %in% request$which), raw(-num_envs %% 8))
    function(action) if (!is.null(bytes <- write(action))) c(mask, bytes)
  } else {
    write
  }
  flags <- sum(c(1L, 2L, 4L, 8L)[c(!infos, !finals, render, selects)])
  sizes <- vapply(layout$action, function(entry) entry$size, 0)
  size <- sum(sizes) / (num_envs %||% 1) * (n %||% 1) + if (selects) length(mask) else 0
  message$head <- message_head(size, 0L, 0L, flags)
  message$what <- 0L
  message
}

# Converts a layout for all sub-environments to one for `n` of them.
layout_of_rows <- function(layout, n, num_envs) {
  if (identical(n, num_envs)) {
    return(layout)
  }
  lapply(layout, function(entry) {
    entry[c("n", "size")] <- lapply(entry[c("n", "size")], function(x) x / num_envs * n)
    if (!is.null(entry$dim)) entry$dim[[1L]] <- as.integer(n)
    entry
  })
}

reset_message <- function(instance, request, layout, named) {
  n <- instance$num_envs
  message <- if (has_numbers(layout$reset)) {
    space <- sent_space(instance$single_observation_space, n)
    observe <- observation_of_numbers(space, named)
    numbers_message(request, prod(space$shape), function(numbers, json = NULL) {
      list(observation = observe(numbers), info = read_info(json, n))
    })
  } else {
    arrays_message(request, layout$reset)
  }
  # The fields of a reset are always written as JSON.
  c(message, list(write = function(fields) NULL, what = 1L))
}

# Answers of numbers ---------------------------------------------------------------------------

has_numbers <- function(layout) {
  length(layout) && identical(names(layout)[[1L]], "observation") &&
    all(vapply(layout, function(entry) entry$dtype == "F64", NA))
}

# The heads of the frame and of the message are together as long as three numbers.
before_numbers <- 3L

# An answer has at least this many numbers.
fewest_numbers <- 14L

#' Describe answers that are numbers of one dtype
#' @param request As for [step_message()].
#' @param count How many numbers there are.
#' @param read A function of the numbers of a message, including its heads, and of its JSON.
#' @noRd
numbers_message <- function(request, count, read) {
  count <- before_numbers + max(count, fewest_numbers)
  size <- 8L * as.integer(count) - 4L
  first <- as.raw(c(0x82, 0x7e, size %/% 256L, size %% 256L, 0, 0, 200, 0))
  list(
    count = count, read = read, request = request,
    usual = readBin(first, "double", endian = "little"),
    read_bytes = function(content, json) {
      # Four bytes stand for the head of the frame, which is not in `content`.
      numbers <- readBin(c(raw(4L), content), "double", count, endian = "little")
      if (length(numbers) < count) abort_answer("It has fewer numbers than its layout")
      read(numbers, json)
    }
  )
}

#' Make the function that takes an observation, or a batch, from an answer's numbers
#' @noRd
observation_of_numbers <- function(space, named) {
  at <- before_numbers + seq_len(prod(space$shape))
  is_integer <- !is_float(space)
  labels <- if (named && inherits(space, "gym_space_box") && length(space$shape) <= 2L) space$names
  placed <- if (length(space$shape) > 1L) {
    c(list(dim = space$shape), if (!is.null(labels)) list(dimnames = list(NULL, labels)))
  } else if (!is.null(labels)) {
    list(names = labels)
  }
  function(numbers) {
    values <- numbers[at]
    if (is_integer) values <- as.integer(values)
    if (!is.null(placed)) attributes(values) <- placed
    values
  }
}

#' Make the function that reads the result of a step from an answer's numbers
#' @noRd
step_reader_of_numbers <- function(space, n, named) {
  observe <- observation_of_numbers(space, named)
  rows <- n %||% 1L
  reward_at <- before_numbers + prod(space$shape) + seq_len(rows)
  terminated_at <- reward_at + rows
  truncated_at <- terminated_at + rows
  function(numbers, json = NULL) {
    terminated <- numbers[terminated_at] != 0
    truncated <- numbers[truncated_at] != 0
    done <- terminated | truncated
    if (anyNA(done)) abort_answer("A flag is not a number")
    observation <- observe(numbers)
    result <- list(
      observation = observation, reward = numbers[reward_at], done = done,
      info = if (is.null(json)) empty_object else read_info(json, n),
      terminated = terminated, truncated = truncated
    )
    if (!is.null(n)) result$next_observation <- observation
    result
  }
}

# Answers of other arrays ----------------------------------------------------------------------

#' Describe answers that are arrays of several dtypes
#' @noRd
arrays_message <- function(request, layout) {
  layout <- list(entries = layout, data = message_head_size)
  list(
    count = NULL, usual = NULL, request = request,
    read_bytes = function(content, json) {
      info <- json$info %||% empty_object
      request$read(list(tensors = read_entries(content, layout), info = info))
    }
  )
}
