# Run uv and Python. Their output goes into a log; a failure becomes an error with advice.

abort_install <- function(message, ..., call = rlang::caller_env()) {
  gym_abort(message, class = "gym_error_install", ..., call = call)
}

# The environment variables of a tool, without settings of other Pythons and without the library
# folders that R adds.
tool_environment <- function(more = character()) {
  own <- c(
    PYTHONPATH = "", PYTHONHOME = "", VIRTUAL_ENV = "",
    UV_NO_PROGRESS = "1", NO_COLOR = "1",
    own_library_path()
  )
  c("current", own[setdiff(names(own), names(more))], more)
}

install_log <- function() file.path(install_root(), "install.log")

#' Run a tool to its end
#' @param arguments A character vector.
#' @param env More environment variables.
#' @return Its output, a character vector of lines, with the attribute `status`.
#' @noRd
run_tool <- function(command, arguments, env = character()) {
  write_log(paste(c(">", command, arguments), collapse = " "))
  run <- with_own_tree_id(tryCatch(
    processx::run(
      command, arguments,
      error_on_status = FALSE, stderr_to_stdout = TRUE, env = tool_environment(env),
      # Not the working directory, where a project may have settings for uv.
      wd = install_root(), cleanup_tree = TRUE, windows_hide_window = TRUE,
      stdout_line_callback = function(line, process) write_log(line),
      # Shows that the program is busy.
      spinner = cli::is_dynamic_tty()
    ),
    error = function(cnd) {
      write_log(conditionMessage(cnd))
      list(stdout = conditionMessage(cnd), status = -1L)
    }
  ))
  structure(strsplit(run$stdout, "\r?\n")[[1L]], status = run$status)
}

failed <- function(output) !identical(attr(output, "status"), 0L)

# The address of a mirror or a proxy may contain a password.
without_passwords <- function(texts) gsub("://[^/[:space:]]+@", "://<login>@", texts)

# Errors are ignored: on a full disk, the installation's own error says more.
write_log <- function(lines) {
  lines <- without_passwords(lines)
  try(suppressWarnings(cat(paste0(lines, "\n"), file = install_log(), append = TRUE, sep = "")),
      silent = TRUE)
}

abort_tool <- function(what, output, call, more = NULL) {
  output <- without_passwords(output)
  lines <- error_lines(output)
  abort_install(
    c(
      paste0(without_passwords(what), "."),
      x = if (length(lines)) paste(lines, collapse = "\n"),
      rlang::set_names(c(install_advice(output), more), "i"),
      i = paste0("The full output is in ", install_log(), "."),
      i = "The finished part is kept; `gym_server_install()` continues from here."
    ),
    output = output,
    call = call
  )
}

# The lines of an error message, or the last lines if there is none.
error_lines <- function(output) {
  lines <- trimws(output[nzchar(trimws(output))])
  begins <- grep("^error\\b", lines, ignore.case = TRUE)
  if (length(begins)) {
    return(utils::head(lines[seq(begins[[1L]], length(lines))], 6L))
  }
  utils::tail(lines, 6L)
}

# Advice on a failure, recognised by the messages of uv and the system. The first entry of
# `failures` that matches is used.
install_advice <- function(output) {
  text <- paste(output, collapse = "\n")
  for (kind in failures) {
    if (grepl(kind$words, text, ignore.case = TRUE)) {
      return(kind$advice)
    }
  }
  character()
}

failures <- list(
  list(
    words = paste0(
      "no space left|os error (28|112|122)\\b|errno (28|122)\\b|not enough space|quota exceeded"
    ),
    advice = c(
      "The disk is full. The package needs space in its cache folder and in the temporary one.",
      "The variables R_USER_CACHE_DIR, TMPDIR and UV_CACHE_DIR set other folders."
    )
  ),
  list(
    words = "hash(es)? mismatch|mismatched hash",
    advice = c(
      "A downloaded file has the wrong hash and was refused.",
      "A proxy or mirror may have changed it; try again, or in another network."
    )
  ),
  list(
    words = "certificate|unknownissuer|ssl: |invalid peer|tls handshake|schannel",
    advice = c(
      paste("The network's certificate is not trusted, as behind a company's or university's",
            "proxy."),
      paste("Set SSL_CERT_FILE to the file of that network's certificates, or UV_SYSTEM_CERTS=1",
            "(UV_NATIVE_TLS=1 for an older uv) to use those of the system; `Sys.setenv()` sets",
            "them for this session.")
    )
  ),
  list(
    words = "\\b407\\b|proxy|tunnel",
    advice = paste(
      "The network's proxy did not let it through. HTTPS_PROXY must be its address, such as",
      "\"http://user:password@proxy.example:8080\"; `Sys.setenv(HTTPS_PROXY = )` sets it for",
      "this session."
    )
  ),
  list(
    words = "permission denied|os error (5|13)\\b|access is denied|winerror 5\\b",
    advice = c(
      "A file or folder cannot be written; a virus scanner may hold it, or another user own it.",
      "The environment variable R_USER_CACHE_DIR sets another cache folder."
    )
  ),
  list(
    words = paste0(
      "dns error|resolve|getaddrinfo|name resolution|timed? ?out|unreachable|connection|",
      "connect error|connect to|error sending request|failed to (fetch|download)|forbidden"
    ),
    advice = c(
      "The network is unavailable or blocks these files.",
      "Behind a proxy set HTTPS_PROXY to its address, such as \"http://proxy.example:8080\".",
      paste("Without a network, `gym_server_install(offline = )` installs from a folder that",
            "`gym_server_bundle()` filled on another machine.")
    )
  ),
  list(
    words = paste0(
      "no solution found|no (usable )?wheels?|not a supported wheel|",
      "doesn't have a (source distribution or )?wheel"
    ),
    advice = c(
      "The lock file has a package that does not fit this Python or this system.",
      "The server takes 64-bit Python 3.10 to 3.13; `gym_sitrep()` shows what was found."
    )
  )
)
