# What processes have used of the processor, and what R calculates with. Only on Linux, which shows
# times in /proc.

# The seconds that all threads of some processes have run.
cpu_seconds <- function(pids) {
  files <- Sys.glob(file.path("/proc", pids, "task", "*", "schedstat"))
  times <- vapply(files, function(file) {
    # A thread may end meanwhile.
    line <- tryCatch(readLines(file), error = function(cnd) "0", warning = function(cnd) "0")
    as.numeric(strsplit(line, " ")[[1L]][[1L]])
  }, 0)
  sum(times) / 1e9
}

# The processes that a process has started, and those that these have.
descendants <- function(pid) {
  table <- utils::read.table(text = system2("ps", c("-eo", "pid=,ppid="), stdout = TRUE))
  found <- pid
  repeat {
    more <- setdiff(table[[1L]][table[[2L]] %in% found], found)
    if (!length(more)) {
      return(setdiff(found, pid))
    }
    found <- c(found, more)
  }
}

server_pid <- function(client) gym:::get_answer(client, "/v1/health/")$pid

# Debian's OpenBLAS is a libblas.so.3, too, in a folder that says so.
name_of_blas <- function(file = extSoftVersion()[["BLAS"]]) {
  folder <- basename(dirname(file))
  paste(c(if (grepl("blas", folder)) folder, basename(file)), collapse = ": ")
}
