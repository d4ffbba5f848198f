# An R session in a terminal, where somebody sits and answers. Its value has `say(line)` and
# `await(pattern)`, which waits for what R writes next and returns it up to there.
local_console <- function(envvars = character(), frame = parent.frame()) {
  skip_on_os("windows")
  console <- tryCatch(
    processx::process$new(
      file.path(R.home("bin"), "R"), c("--quiet", "--vanilla", "--no-readline"),
      pty = TRUE, pty_options = list(echo = FALSE),
      # testthat's own variable tells rlang that nobody sits there.
      env = c(
        "current", R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep), TESTTHAT = "",
        GYM_INSTALL = "", GYM_SERVER_URL = "", NO_COLOR = "1", envvars
      )
    ),
    error = function(cnd) skip(paste("no terminal can be had here:", conditionMessage(cnd)))
  )
  withr::defer(console$kill(), envir = frame)
  heard <- ""
  await <- function(pattern, seconds = 60) {
    deadline <- Sys.time() + seconds
    repeat {
      place <- regexpr(pattern, heard)
      if (place > 0L) {
        end <- place + attr(place, "match.length") - 1L
        passage <- substr(heard, 1L, end)
        heard <<- substring(heard, end + 1L)
        return(passage)
      }
      if (Sys.time() > deadline || !console$is_alive()) {
        stop("Waited for ", pattern, "; heard: ", heard)
      }
      console$poll_io(1000)
      heard <<- paste0(heard, gsub("\r|\033\\[[?0-9;]*[a-zA-Z]", "", console$read_output()))
    }
  }
  say <- function(line) console$write_input(paste0(line, "\n"))
  await("> ")
  list(say = say, await = await, process = console)
}
