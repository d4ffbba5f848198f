# Seconds of a random search: the same number of rounds by the tutorial's script and by
# search_random(), and one search that starts with a new R session.

# The tutorial's script takes minutes, so it is played once, in as many pieces as search_random()
# has turns. One piece comes before each turn.
compare_searches <- function(setup, turns, rounds) {
  id <- classic_create(setup$development$url, "CartPole-v0")
  set.seed(1)
  pieces <- diff(round(seq(0, rounds, length.out = turns + 1L)))
  rows <- NULL
  classic <- c(seconds = 0, steps = 0)
  for (turn in seq_len(turns)) {
    progress("the tutorial's way, piece ", turn, " of ", turns)
    started <- now()
    steps <- classic_rounds(setup$development$url, id, pieces[turn])
    classic <- classic + c(now() - started, steps)
    started <- now()
    search <- search_random(
      "CartPole-v0", rounds = rounds, episodes = 5, target = Inf, seed = turn,
      progress = FALSE, client = setup$client
    )
    gym <- c(now() - started, sum(search$rounds$steps))
    rows <- rbind(rows, search_rows("gym, search_random()", turn, rounds, gym))
  }
  rbind(rows, search_rows("the tutorial's way", 1L, rounds, classic))
}

search_rows <- function(name, turn, rounds, took) {
  called <- paste(rounds, "rounds of 5 episodes")
  rbind(
    measured("search", 0, name, called, turn, took[[1L]], "s"),
    measured("search", 0, name, called, turn, took[[2L]], "steps")
  )
}

# From the start of the process: library(gym), the server's start, the search.
fresh_searches <- function(turns) {
  do.call(rbind, lapply(seq_len(turns), function(turn) {
    progress("search in a fresh R, turn ", turn, " of ", turns)
    script <- sprintf("library(gym); print(search_random('CartPole-v0', seed = %d))", turn)
    started <- now()
    processx::run(file.path(R.home("bin"), "Rscript"), c("--no-init-file", "-e", script))
    measured("fresh", 0, "gym, search_random()", "Rscript", turn, now() - started, "s")
  }))
}
