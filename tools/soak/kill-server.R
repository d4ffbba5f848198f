# Kills a server with -9 at a random moment of a search with a checkpoint. The same call, with
# another server, must have the result of an uninterrupted search.
#
#   tools/in-env Rscript tools/soak/kill-server.R [MOMENTS]      50 by default, some ten minutes

library(gym)

moments <- as.integer(c(commandArgs(TRUE), "50")[[1]])
path <- tempfile(fileext = ".rds")

# A vector environment of few sub-environments, so that a search has dozens of batches.
play <- function(server, ...) {
  env <- gym_make("CartPole-v1", num_envs = 16, client = server)
  search_random(env, rounds = 60, target = Inf, seed = 1, ...)
}

figures <- function(search) {
  search[setdiff(names(search), c("elapsed", "client", "env", "template", "provenance"))]
}

kill_after <- function(server, seconds) {
  pid <- gym:::the_session$servers[[server$remote_base]]$pid
  processx::process$new(
    file.path(R.home("bin"), "Rscript"),
    c("--vanilla", "-e", sprintf("Sys.sleep(%f); tools::pskill(%d, 9L)", seconds, pid))
  )
}

# The number of episodes in the file.
episodes_kept <- function() {
  if (!file.exists(path)) return(0L)
  sum(vapply(gym:::read_checkpoint(path, NULL)$training$episodes, NROW, 0L))
}

server <- gym_server_start()
undisturbed <- play(server)
killed <- equal <- lost <- 0L
while (killed < moments) {
  unlink(path)
  killer <- kill_after(server, undisturbed$elapsed * runif(1))
  search <- tryCatch(play(server, checkpoint = path), gym_error = identity)
  killer$wait()
  server <- gym_server_start()
  if (inherits(search, "gym_search")) {
    # The search had already ended.
    next
  }
  if (!inherits(search, "gym_error_connection")) stop(search)
  killed <- killed + 1L
  # At most the current batch is played again. Some of its rounds may have ended already.
  lost <- lost + (NROW(search$result$episodes) - episodes_kept() > 16L)
  same <- identical(figures(play(server, checkpoint = path)), figures(undisturbed))
  equal <- equal + same
  message(format(Sys.time(), "%H:%M:%S "), killed, " of ", moments, ", with ",
          NROW(search$result$rounds), " rounds played, equal: ", same)
}
cat(sprintf(
  "kill-server: %d kills, results lost %d, equal to an undisturbed run %d of %d\n",
  killed, lost, equal, killed
))
quit("no", status = if (equal == killed && lost == 0L) 0L else 1L)
