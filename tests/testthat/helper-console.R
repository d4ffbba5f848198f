# Starts an interactive R session in a terminal. Returns `say(line)`, and `await(pattern)`, which
# waits until R writes the pattern and returns the output up to there.
local_console <- function(envvars = character(), frame = parent.frame()) {
  skip_on_os("windows")
  console <- tryCatch(
    processx::process$new(
      file.path(R.home("bin"), "R"), c("--quiet", "--vanilla", "--no-readline"),
      pty = TRUE, pty_options = list(echo = FALSE),
      # With testthat's variable, rlang would think that the session is not interactive.
      env = c(
        "current", R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep), TESTTHAT = "",
        GYM_INSTALL = "", GYM_SERVER_URL = "", NO_COLOR = "1", envvars
      )
    ),
    error = function(cnd) skip(paste("no terminal can be had here:", conditionMessage(cnd)))
  )
  withr::defer(console$kill(), envir = frame)
  output <- ""
  await <- function(pattern, seconds = 60) {
    deadline <- Sys.time() + seconds
    repeat {
      place <- regexpr(pattern, output)
      if (place > 0L) {
        end <- place + attr(place, "match.length") - 1L
        passage <- substr(output, 1L, end)
        output <<- substring(output, end + 1L)
        return(passage)
      }
      if (Sys.time() > deadline || !console$is_alive()) {
        stop("Waited for ", pattern, "; output: ", output)
      }
      console$poll_io(1000)
      output <<- paste0(output, gsub("\r|\033\\[[?0-9;]*[a-zA-Z]", "", console$read_output()))
    }
  }
  say <- function(line) console$write_input(paste0(line, "\n"))
  await("> ")
  list(say = say, await = await, process = console)
}
