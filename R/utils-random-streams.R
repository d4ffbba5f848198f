# Random numbers come from streams of a seed, and the session's generator is left as it was. A
# stream is a `.Random.seed` of R's generator "L'Ecuyer-CMRG", whose streams are far apart, see
# ?parallel::nextRNGStream. The kinds of generators are fixed, so the session's RNGkind() has no
# effect.

draw_seed <- function() sample.int(.Machine$integer.max, 1L)

# Draws seeds for environments, which accept whole numbers from 0. All are drawn in one call: the
# first k of them do not depend on `n`.
draw_environment_seeds <- function(n) sample.int(.Machine$integer.max, n, replace = TRUE)

# The first stream of a seed. set.seed() does not accept a seed beyond 2^31 - 1, so a larger seed is
# split in two: its lower 31 bits, and a negative number made of the other bits. The signs differ,
# so no smaller seed gives the same two streams. The generator consists of two generators with three
# numbers each, and takes one of each stream.
seed_stream <- function(seed) {
  # Evaluate `seed` first: if the call draws it, this must change the session's generator. Convert
  # it, because set.seed() would misread the bits of bit64's numbers.
  seed <- as.numeric(seed)
  stream_of <- function(seed) {
    set.seed(seed, "L'Ecuyer-CMRG", "Inversion", "Rejection")
    globalenv()$.Random.seed
  }
  keep_random_state(
    if (seed <= .Machine$integer.max) {
      stream_of(seed)
    } else {
      c(stream_of(seed %% 2^31)[1:4], stream_of(-(seed %/% 2^31) - 1)[5:7])
    }
  )
}

#' Make a separate random generator
#'
#' @param seed A whole number.
#' @param stream A stream to start with, instead of the first one of the seed.
#' @return An environment with `state`, which [with_generator()] updates.
#' @noRd
new_generator <- function(seed, stream = seed_stream(seed)) {
  generator <- new.env(parent = emptyenv())
  generator$state <- stream
  generator
}

#' Run code that draws from a separate generator
#'
#' The separate generator continues where it was. Afterwards the session's generator is restored.
#' @noRd
with_generator <- function(generator, code) {
  keep_random_state({
    assign(".Random.seed", generator$state, envir = globalenv())
    tryCatch(code, finally = generator$state <- globalenv()$.Random.seed)
  })
}

#' Run code and restore R's generator
#' @noRd
keep_random_state <- function(code) {
  state <- globalenv()$.Random.seed
  if (is.null(state)) {
    # A new session has no .Random.seed, and must have none afterwards. Otherwise its first random
    # number would depend on the seed used here. RNGkind() must be restored separately.
    kinds <- RNGkind()
    on.exit({
      suppressWarnings(RNGkind(kinds[[1L]], kinds[[2L]], kinds[[3L]]))
      rm(list = intersect(".Random.seed", ls(globalenv(), all.names = TRUE)), envir = globalenv())
    })
  } else {
    on.exit(assign(".Random.seed", state, envir = globalenv()))
  }
  code
}

#' Make the streams for all random numbers in play
#'
#' @return An environment: `agent`, a generator for the agent's random numbers; `seeds`, a generator
#'   for the seeds of episodes; `next_stream`, the stream of the next batch.
#' @noRd
new_streams <- function(seed) {
  first <- seed_stream(seed)
  second <- parallel::nextRNGStream(first)
  restore_streams(list(
    agent = first, seeds = second, next_stream = parallel::nextRNGStream(second)
  ))
}

# Takes the stream of a batch.
take_stream <- function(streams) {
  stream <- streams$next_stream
  streams$next_stream <- parallel::nextRNGStream(stream)
  stream
}

# The streams as a list that can be saved.
saved_streams <- function(streams) {
  list(agent = streams$agent$state, seeds = streams$seeds$state, next_stream = streams$next_stream)
}

restore_streams <- function(saved) {
  rlang::env(
    agent = new_generator(stream = saved$agent), seeds = new_generator(stream = saved$seeds),
    next_stream = saved$next_stream
  )
}

# One at a time ---------------------------------------------------------------------------

#' Draw numbers from 0 to 1, one at a time
#'
#' R takes as long for a single number as for fifty, so this function draws many in advance.
#' @return A list of functions: `draw()`, and `renew()`, which discards the numbers drawn in
#'   advance; the next ones then depend only on R's generator.
#' @noRd
uniform_draws <- function() {
  drawn <- numeric()
  at <- 0L
  count <- 0L
  list(
    draw = function() {
      if (at == count) {
        count <<- min(1024L, max(32L, 2L * count))
        drawn <<- stats::runif(count)
        at <<- 0L
      }
      at <<- at + 1L
      drawn[[at]]
    },
    renew = function() at <<- count <<- 0L
  )
}
