# Finds uv (<https://docs.astral.sh/uv/>) or downloads it, and runs it.

uv_name <- function() if (is_windows()) "uv.exe" else "uv"

# The oldest version with --managed-python that was tested.
least_uv <- "0.7.0"

#' Find uv
#' @return The path of the first uv that runs and is new enough, or `NULL`.
#' @noRd
find_uv <- function(call = rlang::caller_env(), timeout = 30) {
  named <- Sys.getenv("GYM_UV")
  if (!nzchar(named)) {
    return(Find(function(uv) uv_works(uv, timeout), uv_candidates()))
  }
  uv <- path.expand(named)
  if (file.exists(uv)) uv <- absolute_path(uv)
  if (!uv_works(uv, timeout)) {
    abort_wrong(NULL, named, call, class = "gym_error_install",
                "The variable GYM_UV names {named}, which is not a usable uv.",
                i = "It must be the path of uv {least_uv} or newer.",
                i = "`Sys.unsetenv(\"GYM_UV\")` lets R look for another one.")
  }
  uv
}

uv_candidates <- function() {
  reticulate <- Sys.getenv("RETICULATE_UV")
  home <- if (is_windows()) Sys.getenv("USERPROFILE") else path.expand("~")
  places <- c(
    # For reticulate, "managed" means its own uv.
    if (nzchar(reticulate) && reticulate != "managed") absolute_path(reticulate),
    unname(Sys.which("uv")), file.path(home, ".local", "bin", uv_name()),
    absolute_path(file.path(tools::R_user_dir("reticulate", "cache"), "uv", "bin", uv_name())),
    pinned_uv()
  )
  unique(places[file.exists(places) & !dir.exists(places)])
}

uv_works <- function(uv, timeout = 30) {
  output <- run_quietly(uv, "--version", timeout)$stdout
  version <- regmatches(output, regexpr("[0-9]+[.][0-9]+[.][0-9]+", output))
  startsWith(output, "uv ") && length(version) == 1L && package_version(version) >= least_uv
}

# The release to download if there is no uv, and the SHA-256 of its archives, which uv publishes.
# They come from src/download/checksum/known-checksums.json in github.com/astral-sh/setup-uv.
uv_release <- list(
  version = "0.12.16",
  checksums = c(
    "x86_64-unknown-linux-gnu" =
      "8e5c6e5523dffc2dcf615bd995554c84c9feb4e577808a3fb8698a639d3f8d9c",
    "x86_64-unknown-linux-musl" =
      "a01206ffbd60f3a7ee30949be1863527986f5307494a064042c69ce7e6d44799",
    "aarch64-unknown-linux-gnu" =
      "36d913ee9c647481d64f1a0a0485f85ff2feaee605c341fc22e73398f9212c26",
    "aarch64-unknown-linux-musl" =
      "5beba1f35c0922fd086cce850ce919e55bc4e873c4fcda891343526afdb4c5b3",
    "x86_64-apple-darwin" =
      "a42bcc9ce97eb8b364d7f162233a9c6b8c0ee25388e551d362809795127e0c31",
    "aarch64-apple-darwin" =
      "b6e03fae61704b1aa622f12b792a69483e837b83068e44f4fd34f8a07a8f74a3",
    "x86_64-pc-windows-msvc" =
      "f730454bf09019754e5e5abd71a8aa18683cb739cba0d9c720bac2e7c901160f",
    "aarch64-pc-windows-msvc" =
      "9977129f89c4036edfcb200d2484755571e51fa74517f02e478c1d7bcc353b2e"
  )
)

# The name of this system in uv's releases.
uv_target <- function() {
  parts <- strsplit(system_name(), "-", fixed = TRUE)[[1L]]
  processor <- sub("arm64", "aarch64", parts[[2L]], fixed = TRUE)
  musl <- list.files("/lib", "^ld-musl-")
  paste0(processor, switch(parts[[1L]],
    linux = if (length(musl)) "-unknown-linux-musl" else "-unknown-linux-gnu",
    darwin = "-apple-darwin",
    windows = "-pc-windows-msvc",
    paste0("-", parts[[1L]])
  ))
}

pinned_uv <- function() file.path(install_root(), "uv", uv_release$version, uv_name())

# Downloads uv, and unpacks the archive if its checksum is right. UV_DOWNLOAD_URL is a variable of
# uv's own installer.
fetch_uv <- function(call) {
  fail <- function(...) {
    gym_abort(
      c(..., i = paste(
        "uv can also be installed by hand (<https://docs.astral.sh/uv/>); or install the packages",
        "into a Python 3.10 to 3.13, in a terminal for example by",
        paste0("`", pip_install_server("python"), "`, and set GYM_PYTHON to that Python.")
      )),
      class = "gym_error_install", call = call
    )
  }
  target <- uv_target()
  if (!target %in% names(uv_release$checksums)) {
    fail(paste0("There is no uv to download for this system (", target, ")."))
  }
  # A folder of its own, because another session may download uv, too.
  place <- temporary_file("gym-uv-")
  dir.create(place)
  on.exit(unlink(place, recursive = TRUE))
  archive <- file.path(place, paste0("uv-", target, if (is_windows()) ".zip" else ".tar.gz"))
  base <- Sys.getenv(
    "UV_DOWNLOAD_URL",
    paste0("https://github.com/astral-sh/uv/releases/download/", uv_release$version)
  )
  url <- paste0(sub("/+$", "", base), "/", basename(archive))
  cli::cli_inform(c(i = "Downloading uv {uv_release$version} (about 20 MB)."))
  handle <- curl::new_handle()
  # Give up a download that stays below this many bytes per second for so many seconds.
  curl::handle_setopt(handle, low_speed_limit = 100, low_speed_time = 60)
  certificates <- Sys.getenv("SSL_CERT_FILE")
  if (nzchar(certificates)) curl::handle_setopt(handle, cainfo = certificates)
  tryCatch(
    curl::curl_download(url, archive, handle = handle),
    error = function(cnd) {
      reason <- without_passwords(conditionMessage(cnd))
      fail(paste0("uv could not be downloaded from ", without_passwords(url), "."), x = reason,
           install_advice(reason))
    }
  )
  found <- file_sha256(archive)
  if (found != uv_release$checksums[[target]]) {
    fail(
      "The downloaded uv is not the published one and was deleted.",
      x = paste0("Its SHA-256 is ", found, " and should be ", uv_release$checksums[[target]], "."),
      i = "A proxy may have replaced it: try again, or in another network."
    )
  }
  unpack_uv(archive)
  if (!uv_works(pinned_uv())) {
    fail(
      paste0("The downloaded uv cannot be run from ", dirname(pinned_uv()), "."),
      i = "Is the disk full, or are programs not allowed to run from there?"
    )
  }
  pinned_uv()
}

# Open the file as "rb": otherwise R would decompress it and hash its content.
file_sha256 <- function(path) {
  bytes <- file(path, "rb")
  on.exit(close(bytes))
  hex(openssl::sha256(bytes))
}

unpack_uv <- function(archive) {
  place <- dirname(archive)
  tryCatch(
    if (is_windows()) {
      utils::unzip(archive, exdir = place)
    } else {
      utils::untar(archive, exdir = place, tar = "internal")
    },
    error = identity, warning = identity
  )
  unpacked <- list.files(place, paste0("^", uv_name(), "$"), recursive = TRUE, full.names = TRUE)
  dir.create(dirname(pinned_uv()), recursive = TRUE, showWarnings = FALSE)
  file.copy(unpacked, pinned_uv(), overwrite = TRUE)
  Sys.chmod(pinned_uv(), "755")
}

#' Run uv to its end
#' @return A list: `failed`, and `text`, its output, a string.
#' @noRd
run_uv <- function(uv, arguments) {
  pythons <- Sys.getenv("UV_PYTHON_INSTALL_DIR")
  # Do not run uv in the working directory, where a project may have settings for uv.
  run <- run_quietly(uv, c("--directory", install_root(), arguments), timeout = Inf, env = c(
    "current",
    PYTHONPATH = "", PYTHONHOME = "", VIRTUAL_ENV = "", UV_NO_PROGRESS = "1", NO_COLOR = "1",
    own_library_path(),
    # Keep uv's Pythons beside the environments, so that users can delete all together; on Windows,
    # this is outside the roaming profile. Add no command to the PATH and no entry to the registry.
    UV_PYTHON_INSTALL_DIR = if (nzchar(pythons)) pythons else file.path(install_root(), "python"),
    UV_PYTHON_INSTALL_BIN = "0", UV_PYTHON_INSTALL_REGISTRY = "0"
  ))
  list(failed = !identical(run$status, 0L),
       text = without_passwords(paste0(run$stdout, run$stderr)))
}

# Raises an error with uv's error message, or the last lines of its output, and with advice.
abort_uv <- function(what, output, call, more = NULL) {
  lines <- trimws(strsplit(output$text, "\r?\n")[[1L]])
  lines <- lines[nzchar(lines)]
  begins <- grep("^error\\b", lines, ignore.case = TRUE)
  shown <- if (length(begins)) {
    utils::head(lines[seq(begins[[1L]], length(lines))], 6L)
  } else {
    utils::tail(lines, 6L)
  }
  gym_abort(
    c(
      paste0(what, "."), x = if (length(shown)) paste(shown, collapse = "\n"),
      install_advice(output$text), more,
      i = "Downloaded files are kept; `gym_server_install()` continues from here."
    ),
    class = "gym_error_install", output = lines, call = call
  )
}

# Finds advice for an output of uv, curl or the system: the first entry whose pattern matches.
install_advice <- function(text) {
  advice <- Find(function(entry) grepl(entry[[1L]], text, ignore.case = TRUE), install_advices)
  if (!is.null(advice)) c(i = advice[[2L]])
}

install_advices <- list(
  c(
    "no space left|os error (28|112|122)\\b|errno (28|122)\\b|not enough space|quota exceeded",
    paste("The disk is full. The variables R_USER_CACHE_DIR, TMPDIR and UV_CACHE_DIR set other",
          "folders.")
  ),
  c(
    "hash(es)? mismatch|mismatched hash",
    paste("A downloaded file has the wrong hash and was refused. A proxy or mirror may have",
          "changed it; try again, or in another network.")
  ),
  c(
    "certificate|unknownissuer|ssl: |invalid peer|tls handshake|schannel",
    paste("The network's certificate is not trusted, as behind a company's or university's proxy.",
          "Set SSL_CERT_FILE to the file of that network's certificates, or UV_SYSTEM_CERTS=1",
          "(UV_NATIVE_TLS=1 for an older uv) to use those of the system; `Sys.setenv()` sets them",
          "for this session.")
  ),
  c(
    "\\b407\\b|proxy|tunnel",
    paste("The network's proxy did not let it through. HTTPS_PROXY must be its address, such as",
          "\"http://user:password@proxy.example:8080\"; `Sys.setenv(HTTPS_PROXY = )` sets it for",
          "this session.")
  ),
  c(
    "permission denied|os error (5|13)\\b|access is denied|winerror 5\\b",
    paste("A file or folder cannot be written; a virus scanner may hold it, or another user own",
          "it. The variable R_USER_CACHE_DIR sets another cache folder.")
  ),
  c(
    paste0("dns error|resolve|getaddrinfo|name resolution|timed? ?out|unreachable|connect|",
           "error sending request|failed to (fetch|download)|forbidden|network connectivity"),
    paste("The network is unavailable or blocks these files. Behind a proxy set HTTPS_PROXY to its",
          "address, such as \"http://proxy.example:8080\".",
          "`vignette(\"server\", package = \"gym\")` shows how to install without a network.")
  ),
  c(
    paste0("no solution found|no (usable )?wheels?|not a supported wheel|",
           "doesn't have a (source distribution or )?wheel"),
    paste("A package does not fit this system or this Python. The server takes 64-bit Python 3.10",
          "to 3.13.")
  )
)

# The address of a mirror or a proxy may contain a password.
without_passwords <- function(texts) gsub("://[^/[:space:]]+@", "://<login>@", texts)
