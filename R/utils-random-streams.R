# Random numbers: a seed gives streams of their own, and the session's generator stays as it was.
# A stream is a `.Random.seed` of R's generator "L'Ecuyer-CMRG", whose streams are far apart, as
# ?parallel::nextRNGStream describes them. All kinds are fixed, so that what is drawn does not
# depend on the session's RNGkind().

# Draws a seed from the session's generator.
draw_seed <- function() sample.int(.Machine$integer.max, 1L)

# Seeds for environments, which take whole numbers from 0. All are drawn at once: the first k of
# them do not depend on how many there are.
draw_environment_seeds <- function(n) sample.int(.Machine$integer.max, n, replace = TRUE)

# The first stream of a seed. set.seed() takes no seed beyond 2^31 - 1. Of a larger one it makes two
# streams, of its lower 31 bits and of the others, negative and less 1 so that they are no smaller
# seed's; the generator joins two smaller ones, of three numbers each, and gets one of each stream.
seed_stream <- function(seed) {
  # First, as a seed that is drawn in the call must move the session's generator. set.seed() would
  # take the bits of bit64's numbers for another one.
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

#' Make a random generator beside the session's
#'
#' @param seed A whole number.
#' @param stream A stream to begin with, instead of the first one of the seed.
#' @return An environment with `state`, which [with_generator()] moves on.
#' @noRd
new_generator <- function(seed, stream = seed_stream(seed)) {
  generator <- new.env(parent = emptyenv())
  generator$state <- stream
  generator
}

#' Run code that draws from a generator beside the session's
#'
#' The generator goes on from where it was, and the session's is afterwards as it was.
#' @noRd
with_generator <- function(generator, code) keep_random_state(draw_from(generator, code))

draw_from <- function(generator, code) {
  assign(".Random.seed", generator$state, envir = globalenv())
  on.exit(generator$state <- globalenv()$.Random.seed)
  code
}

#' Run code and put R's generator back as it was
#' @noRd
keep_random_state <- function(code) {
  state <- globalenv()$.Random.seed
  if (is.null(state)) {
    # R remembers the kinds elsewhere, too.
    kinds <- RNGkind()
    on.exit(forget_random_state(kinds))
  } else {
    on.exit(assign(".Random.seed", state, envir = globalenv()))
  }
  code
}

# A session that has drawn nothing yet has no .Random.seed, and must have none afterwards: else its
# first draw would depend on the seed that was used here.
forget_random_state <- function(kinds) {
  suppressWarnings(RNGkind(kinds[[1L]], kinds[[2L]], kinds[[3L]]))
  rm(list = intersect(".Random.seed", ls(globalenv(), all.names = TRUE)), envir = globalenv())
}

#' Make the streams that everything is drawn from when episodes are played
#'
#' @return An environment: `agent`, a generator for what an agent draws; `seeds`, a generator for
#'   the seeds of episodes; `next_stream`, the stream of the batch that begins next.
#' @noRd
new_streams <- function(seed) {
  first <- seed_stream(seed)
  second <- parallel::nextRNGStream(first)
  rlang::env(
    agent = new_generator(stream = first), seeds = new_generator(stream = second),
    next_stream = parallel::nextRNGStream(second)
  )
}

# Takes the stream of a batch.
take_stream <- function(streams) {
  stream <- streams$next_stream
  streams$next_stream <- parallel::nextRNGStream(stream)
  stream
}

# The streams as a list that can be kept in a file.
saved_streams <- function(streams) {
  list(
    agent = streams$agent$state, seeds = streams$seeds$state, next_stream = streams$next_stream
  )
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
#' R takes as long for a single number as for fifty, so more are drawn than asked for.
#' @return A list of functions: `draw()`, and `renew()`, after which none that was drawn before is
#'   used: then what comes depends on R's generator alone.
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
