# Find uv, <https://docs.astral.sh/uv/>, or download it.

uv_name <- function() if (is_windows()) "uv.exe" else "uv"

# The oldest version with --managed-python that was tested.
least_uv <- "0.7.0"

#' Find uv
#' @param within The time in which all candidates must answer, in seconds, shared equally. `NULL`
#'   gives each the time that a program may take on a busy machine.
#' @return The path of the first one that runs and is new enough, or `NULL`.
#' @noRd
find_uv <- function(call = rlang::caller_env(), within = NULL) {
  named <- Sys.getenv("GYM_UV")
  if (!nzchar(named)) {
    candidates <- uv_candidates()
    timeout <- if (is.null(within)) 30 else within / max(1L, length(candidates))
    return(Find(function(uv) uv_works(uv, timeout), candidates))
  }
  uv <- path.expand(named)
  if (file.exists(uv)) uv <- absolute_path(uv)
  if (!uv_works(uv, within %||% 30)) {
    abort_install(
      c(
        paste0("The variable GYM_UV names ", named, ", which is not a usable uv."),
        i = paste0("It must be the path of uv ", least_uv, " or newer."),
        i = "After `Sys.unsetenv(\"GYM_UV\")` another one is looked for."
      ),
      call = call
    )
  }
  uv
}

uv_candidates <- function() {
  reticulate <- Sys.getenv("RETICULATE_UV")
  home <- if (is_windows()) Sys.getenv("USERPROFILE") else path.expand("~")
  places <- c(
    # For reticulate, "managed" means its own uv.
    if (nzchar(reticulate) && reticulate != "managed") absolute_path(reticulate),
    unname(Sys.which("uv")),
    file.path(home, ".local", "bin", uv_name()),
    file.path(cache_of("reticulate"), "uv", "bin", uv_name()),
    pinned_uv()
  )
  unique(places[file.exists(places) & !dir.exists(places)])
}

uv_works <- function(uv, timeout = 30) {
  output <- run_quietly(uv, "--version", timeout)$stdout
  version <- regmatches(output, regexpr("[0-9]+[.][0-9]+[.][0-9]+", output))
  startsWith(output, "uv ") && length(version) == 1L && package_version(version) >= least_uv
}

# The release to download if there is no uv, and the SHA-256 of its archives, as published with it.
# Their source is src/download/checksum/known-checksums.json in github.com/astral-sh/setup-uv.
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
  paste0(processor, switch(parts[[1L]],
    linux = if (has_musl()) "-unknown-linux-musl" else "-unknown-linux-gnu",
    darwin = "-apple-darwin",
    windows = "-pc-windows-msvc",
    paste0("-", parts[[1L]])
  ))
}

has_musl <- function() length(list.files("/lib", "^ld-musl-")) > 0L

pinned_uv <- function() file.path(install_root(), "uv", uv_release$version, uv_name())

# Downloads uv and unpacks the archive if its checksum is right. UV_DOWNLOAD_URL is a variable of
# uv's own installer.
install_uv <- function(call) {
  target <- uv_target()
  if (!target %in% names(uv_release$checksums)) {
    abort_install(
      c(paste0("There is no uv to download for this system (", target, ")."), i = without_uv()),
      call = call
    )
  }
  # A folder of its own, because another session may download uv, too.
  place <- tempfile("download-", install_root())
  dir.create(place, recursive = TRUE, showWarnings = FALSE)
  on.exit(unlink(place, recursive = TRUE))
  archive <- file.path(place, paste0("uv-", target, if (is_windows()) ".zip" else ".tar.gz"))
  base <- Sys.getenv(
    "UV_DOWNLOAD_URL",
    paste0("https://github.com/astral-sh/uv/releases/download/", uv_release$version)
  )
  cli::cli_inform(c(i = "Downloading uv {uv_release$version} (about 20 MB)."))
  download_uv(paste0(sub("/+$", "", base), "/", basename(archive)), archive, call)
  check_uv_archive(archive, uv_release$checksums[[target]], call)
  unpack_uv(archive, call)
}

# Advice if uv is not available.
without_uv <- function() {
  paste(
    "Without uv, install the packages into a Python 3.10 to 3.13 by other means, in a terminal",
    "for example by", paste0("`", pip_install_server("python"), "`,"),
    "and set GYM_PYTHON to that Python."
  )
}

# Five times the size of its archive.
most_bytes_of_uv <- 100e6

download_uv <- function(url, archive, call) {
  write_log(paste("> download", url))
  handle <- curl::new_handle()
  set_curl(
    handle, failonerror = TRUE, followlocation = TRUE, connecttimeout = 30,
    # A download ends if it stays below this many bytes per second for so many seconds.
    low_speed_limit = 100, low_speed_time = 60
  )
  certificates <- Sys.getenv("SSL_CERT_FILE")
  if (nzchar(certificates)) {
    set_curl(handle, cainfo = certificates)
  }
  file <- file(archive, "wb")
  on.exit(close(file))
  received <- 0
  keep <- function(bytes) {
    received <<- received + length(bytes)
    if (received > most_bytes_of_uv) {
      stop("The file is larger than ", most_bytes_of_uv / 1e6, " MB.", call. = FALSE)
    }
    writeBin(bytes, file)
  }
  tryCatch(
    # Today's curl also warns, with the address.
    suppressWarnings(curl::curl_fetch_stream(url, keep, handle = handle)),
    error = function(cnd) {
      write_log(conditionMessage(cnd))
      abort_tool(
        paste("uv could not be downloaded from", url), conditionMessage(cnd), call,
        more = c(
          paste("uv can also be installed by hand (<https://docs.astral.sh/uv/>):",
                "`gym_server_install()` then finds it."),
          without_uv()
        )
      )
    }
  )
}

# Open the file as "rb": otherwise R would decompress it and hash its content.
file_sha256 <- function(path) {
  bytes <- file(path, "rb")
  on.exit(close(bytes))
  hex(openssl::sha256(bytes))
}

check_uv_archive <- function(archive, expected, call) {
  found <- file_sha256(archive)
  if (!identical(found, expected)) {
    abort_install(
      c(
        "The downloaded uv is not the published one and was deleted.",
        x = paste0("Its SHA-256 is ", found, " and should be ", expected, "."),
        i = paste("A proxy may have replaced it, or the download broke off:",
                  "try again, or in another network.")
      ),
      call = call
    )
  }
}

unpack_uv <- function(archive, call) {
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
  Sys.chmod(unpacked, "755")
  works <- length(unpacked) && uv_works(unpacked[[1L]])
  if (works) {
    dir.create(dirname(pinned_uv()), recursive = TRUE, showWarnings = FALSE)
    file.rename(unpacked[[1L]], pinned_uv())
  }
  if (!works || !file.exists(pinned_uv())) {
    abort_install(
      c(
        paste("The downloaded uv cannot be run from", dirname(pinned_uv())),
        i = "Is the disk full, or are programs not allowed to run from there?",
        i = without_uv()
      ),
      call = call
    )
  }
  pinned_uv()
}
