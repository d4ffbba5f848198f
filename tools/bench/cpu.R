# The CPU time of processes, and R's library of linear algebra. Needs Linux, which shows times in
# /proc.

# The CPU seconds of all threads of some processes.
cpu_seconds <- function(pids) {
  files <- Sys.glob(file.path("/proc", pids, "task", "*", "schedstat"))
  times <- vapply(files, function(file) {
    # A thread may end meanwhile.
    line <- tryCatch(readLines(file), error = function(cnd) "0", warning = function(cnd) "0")
    as.numeric(strsplit(line, " ")[[1L]][[1L]])
  }, 0)
  sum(times) / 1e9
}

# The processes that a process has started, and those that they have started.
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

# Debian's OpenBLAS is also called libblas.so.3, in a folder with its own name.
name_of_blas <- function(file = extSoftVersion()[["BLAS"]]) {
  folder <- basename(dirname(file))
  paste(c(if (grepl("blas", folder)) folder, basename(file)), collapse = ": ")
}
