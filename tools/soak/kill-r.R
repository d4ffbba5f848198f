# Kills R sessions with -9 at a random moment of a search with a checkpoint, on their own servers.
# Afterwards no process may be left, the file must be whole, and the final result must be that of an
# uninterrupted search.
#
#   tools/in-env Rscript tools/soak/kill-r.R [MOMENTS]      20 by default, some five minutes

library(gym)

moments <- as.integer(c(commandArgs(TRUE), "20")[[1]])
folder <- tempfile("kill-r-")
dir.create(folder)
checkpoint <- file.path(folder, "search.rds")
result <- file.path(folder, "result.rds")

script <- file.path(folder, "search.R")
writeLines(c(
  "library(gym)",
  "args <- commandArgs(TRUE)",
  "env <- gym_make('CartPole-v1', num_envs = 16)",
  "search <- search_random(env, rounds = 60, target = Inf, seed = 1, checkpoint = args[[1]])",
  "changing <- c('elapsed', 'client', 'env', 'template', 'provenance')",
  "search <- search[setdiff(names(search), changing)]",
  "saveRDS(search, args[[2]])"
), script)

# Every process that such a session starts has this mark.
start_session <- function(mark) {
  env <- stats::setNames("1", mark)
  processx::process$new(
    file.path(R.home("bin"), "Rscript"), c(script, checkpoint, result),
    env = c("current", env), stdout = NULL, stderr = NULL, cleanup_tree = FALSE
  )
}

# The mark has the form of those of ps_mark_tree(), which would also mark this session.
new_mark <- function(number) sprintf("PS%08d_%d", number, as.integer(Sys.time()))

marked <- function(mark) {
  # Leave out zombies: they have ended, but the first process of the machine has not noticed it yet.
  Filter(function(one) {
    !identical(tryCatch(ps::ps_status(one), error = function(cnd) "zombie"), "zombie")
  }, ps::ps_find_tree(mark))
}

left_behind <- function(mark, seconds = 30) {
  for (i in seq_len(seconds * 10)) {
    left <- marked(mark)
    if (!length(left)) break
    Sys.sleep(0.1)
  }
  length(left)
}

play_out <- function() {
  began <- proc.time()[["elapsed"]]
  mark <- new_mark(0L)
  session <- start_session(mark)
  session$wait(2000)
  # Both the session and its server must be found. Otherwise a process that is left behind would not
  # be found either.
  if (session$is_alive() && !length(marked(mark))) stop("the marks of processes are not seen")
  session$wait()
  if (session$get_exit_status() != 0L) stop("the session that nobody kills failed")
  proc.time()[["elapsed"]] - began
}

seconds <- play_out()
undisturbed <- readRDS(result)
unlink(c(checkpoint, result))

killed <- left <- unequal <- finished <- damaged <- 0L
while (killed < moments) {
  mark <- new_mark(killed + 1L)
  session <- start_session(mark)
  session$wait(seconds * runif(1) * 1000)
  if (session$is_alive()) {
    # Kill the session alone. R's own way to end a process would also end its server.
    tools::pskill(session$get_pid(), tools::SIGKILL)
    session$wait()
    killed <- killed + 1L
  }
  behind <- left_behind(mark)
  left <- left + behind
  whole <- tryCatch({
    gym:::read_checkpoint(checkpoint, NULL)
    TRUE
  }, error = function(cnd) FALSE)
  damaged <- damaged + !whole
  message(format(Sys.time(), "%H:%M:%S "), killed, " killed, left behind ", behind,
          ", whole file: ", whole)
  if (file.exists(result)) {
    finished <- finished + 1L
    unequal <- unequal + !identical(readRDS(result), undisturbed)
    unlink(c(checkpoint, result))
  }
}
invisible(play_out())
finished <- finished + 1L
unequal <- unequal + !identical(readRDS(result), undisturbed)
cat(sprintf(
  paste0("kill-r: %d kills of R, servers left behind %d, damaged files %d, ",
         "results equal to an undisturbed run %d of %d\n"),
  killed, left, damaged, finished - unequal, finished
))
unlink(folder, recursive = TRUE)
quit("no", status = if (left + damaged + unequal == 0L) 0L else 1L)
