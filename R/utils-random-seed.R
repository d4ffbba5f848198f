# R's random generator: code that draws from it, and code that leaves it as it was.

#' Run code under a seed of its own
#'
#' With a seed, code draws what it would draw after `set.seed(seed)`, and the
#' session's generator is afterwards as it was. Without one, code draws from the
#' session's generator like everything else.
#' @param code Evaluated after the seed is set, so promises that it forces draw
#'   under the seed too.
#' @noRd
with_random_seed <- function(seed, code) {
  if (is.null(seed)) {
    return(code)
  }
  keep_random_state({
    set.seed(seed)
    code
  })
}

#' Run code and put R's generator back as it was
#' @noRd
keep_random_state <- function(code) {
  state <- globalenv()$.Random.seed
  on.exit(restore_random_state(state))
  code
}

# A session that has drawn nothing yet has no .Random.seed, and must have none
# afterwards: else its first draw would depend on the seed that was used here.
restore_random_state <- function(state) {
  if (is.null(state)) {
    rm(list = intersect(".Random.seed", ls(globalenv(), all.names = TRUE)), envir = globalenv())
  } else {
    assign(".Random.seed", state, envir = globalenv())
  }
}

# Seeds for environments, which take whole numbers from 0. All are drawn at once: the first k of
# them do not depend on how many there are.
draw_environment_seeds <- function(n) {
  sample.int(.Machine$integer.max, n, replace = TRUE)
}
