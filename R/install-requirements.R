# The lock files of the server's Python packages, which are part of this package and written by
# tools/lock. base.txt lists the server's own packages, EXTRA.txt those of an extra.

server_extras <- c("toy-text", "box2d", "mujoco", "atari", "video", "jax")

lock_file <- function(part = "base") {
  system.file("server", "lock", paste0(part, ".txt"), package = "gym")
}

lock_files <- function(extras) {
  vapply(c("base", extras), lock_file, "", USE.NAMES = FALSE)
}

# Identifies the lock files. Line endings are ignored, because git and zip programs may change them.
lock_hash <- function() {
  lines <- unlist(lapply(lock_files(server_extras), readLines, warn = FALSE))
  substr(hex(openssl::sha256(charToRaw(paste(lines, collapse = "\n")))), 1L, 12L)
}

hex <- function(hash) paste(unclass(hash), collapse = "")

# The value of a "# key: value" at the top of a lock file.
lock_entry <- function(part, key) {
  start <- paste0("# ", key, ": ")
  lines <- readLines(lock_file(part), n = 10L, warn = FALSE)
  substring(lines[startsWith(lines, start)][1L], nchar(start) + 1L)
}

# The approximate size of the packages in MB: of the download, and on the disk.
lock_megabytes <- function(extras) {
  size <- function(key) {
    texts <- vapply(c("base", extras), lock_entry, "", key = key)
    sum(as.numeric(sub(" MB", "", texts, fixed = TRUE)))
  }
  c(download = size("download"), disk = size("disk"))
}

# The name of this system in lock files and bundles.
system_name <- function() {
  info <- Sys.info()
  machine <- lower_case(info[["machine"]])
  machine <- switch(machine, amd64 = , "x86-64" = "x86_64", machine)
  paste0(lower_case(info[["sysname"]]), "-", machine)
}

check_extras <- function(extras, call = rlang::caller_env()) {
  if (!is.character(extras) || anyNA(extras) || !all(extras %in% server_extras)) {
    must <- paste("any of", paste0('"', server_extras, '"', collapse = ", "))
    abort_argument(extras, must, "extras", call)
  }
  for (extra in extras) {
    if (system_name() %in% strsplit(lock_entry(extra, "not for"), ", ", fixed = TRUE)[[1L]]) {
      abort_install(
        c(
          paste0("The extra \"", extra, "\" cannot be installed on this system (", system_name(),
                 ")."),
          i = "Its packages come ready to run for other systems only.",
          i = paste("A server on another machine can have it: `create_GymClient()` takes that",
                    "server's address.")
        ),
        call = call
      )
    }
  }
}
