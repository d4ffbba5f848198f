# Bundles: everything that an installation downloads, in a folder for machines without a network.
#
#   bundle.dcf   the manifest: the system, lock, extras and Python that it is for
#   SHA256SUMS   all other files with their SHA-256
#   uv           uv itself (uv.exe)
#   cache/       uv's cache, with the packages
#   python/      the archive of the Python that uv installs, if it could be downloaded

#' Fill a folder for installing without a network
#'
#' Download everything that [gym_server_install()] would download into a folder.
#' `gym_server_install(offline = dir)` then installs from it on machines without a network, for
#' example in a classroom. They need the same kind of system (Windows, macOS or Linux, and the same
#' processor) and the same version of this package.
#'
#' The bundle contains uv, the packages in uv's cache, and the archive of the Python that uv
#' installs. If that archive cannot be downloaded, the other machines need a Python of the version
#' that made the bundle. A message says so.
#'
#' @param dir The folder, a string. It is created if it does not exist. An earlier bundle is
#'   replaced when the new one is complete; a folder with other content is an error.
#' @param extras The extras in the bundle, as for [gym_server_install()].
#' @return `dir`, invisibly.
#' @section Errors: `gym_error_install`, with advice, if a download fails; `gym_error_argument`.
#' @seealso [gym_server_install()]
#' @export
#' @examples
#' # Downloads some 100 MB:
#' if (interactive()) gym_server_bundle(file.path(tempdir(), "gym-bundle"), extras = "box2d")
gym_server_bundle <- function(dir, extras = character()) {
  check_string(dir)
  check_extras(extras)
  call <- rlang::current_env()
  dir <- absolute_path(dir)
  check_bundle_place(dir, call)
  extras <- server_extras[server_extras %in% extras]
  folder <- tempfile("bundle-", install_root())
  new <- file.path(folder, "bundle")
  make_folder(new, call)
  on.exit(unlink(folder, recursive = TRUE))
  cli::cli_inform(c(i = "Downloading {describe_packages(extras)} into {.path {dir}}."))
  uv <- find_uv(call) %||% install_uv(call)
  copy_uv(uv, new, call)
  source <- bundling_source(uv, new, folder)
  make_environment(folder, source, extras, call)
  remove_links(file.path(new, "cache"))
  fields <- list(
    System = bundle_system(), Lock = lock_hash(), Extras = paste(extras, collapse = " "),
    Python = probe_python(environment_python(folder))$version,
    Index = paste(index_arguments(source, environment_python(folder)), collapse = " ")
  )
  write_sums(new)
  replace_bundle(new, dir, fields, call)
  inform_of_bundle(read_bundle(dir, extras, call))
  invisible(dir)
}

# uv's environment variables while a bundle is made: downloads go into the bundle.
bundling_source <- function(uv, new, folder) {
  source <- network_source(uv)
  source$env <- c(
    UV_CACHE_DIR = file.path(new, "cache"), UV_NO_CACHE = "false",
    UV_PYTHON_CACHE_DIR = file.path(new, "python"),
    UV_PYTHON_INSTALL_DIR = file.path(folder, "python"), not_registered
  )
  source
}

# uv's environment variables when it installs from a copy of a bundle.
bundle_source <- function(copy, bundle) {
  list(
    uv = file.path(copy, uv_name()),
    python = bundle$python, other_python = bundle$python, only_python = bundle$python,
    arguments = c("--offline", bundle$index),
    env = c(
      UV_CACHE_DIR = file.path(copy, "cache"), UV_NO_CACHE = "false",
      UV_PYTHON_CACHE_DIR = file.path(copy, "python"), managed_python_place(),
      # uv's cache identifies a package by its index, so ignore the indexes in this machine's
      # settings.
      UV_NO_CONFIG = "1", UV_DEFAULT_INDEX = "", UV_INDEX = "", UV_EXTRA_INDEX_URL = ""
    )
  )
}

# The package indexes in this machine's settings, without passwords.
index_arguments <- function(source, python) {
  output <- run_tool(source$uv, c(
    "pip", "compile", "--quiet", "--offline", "--no-header", "--emit-index-url",
    "--python", python, "-"
  ), source$env)
  lines <- grep("^--(extra-)?index-url ", output, value = TRUE)
  sub("^--index-url", "--default-index", sub("://[^/@]*@", "://", lines))
}

# Incomplete bundles have a bundle.dcf, too.
check_bundle_place <- function(dir, call) {
  there <- list.files(dir, all.files = TRUE, no.. = TRUE)
  is_bundle <- all(there %in% bundle_parts()) && "bundle.dcf" %in% there
  if (file.exists(dir) && !dir.exists(dir) || length(there) && !is_bundle) {
    gym_abort(
      paste0("`dir` must be an empty folder or an earlier bundle, not \"", dir, "\"."),
      class = "gym_error_argument",
      call = call
    )
  }
}

bundle_parts <- function() c("bundle.dcf", "SHA256SUMS", uv_name(), "cache", "python")

copy_uv <- function(uv, new, call) {
  copy <- file.path(new, uv_name())
  # The uv on the PATH may be a script that calls the real one.
  if (!file.copy(uv, copy) || !uv_works(copy)) {
    abort_bundle(
      paste0("The uv in ", uv, " does not run from another folder; a bundle needs that."),
      "Set another one by `Sys.setenv(GYM_UV = )`.", call
    )
  }
}

# uv works without the links in its cache, which most USB sticks cannot store.
remove_links <- function(dir) {
  files <- list.files(dir, recursive = TRUE, include.dirs = TRUE, full.names = TRUE)
  links <- files[nzchar(Sys.readlink(files))]
  file.remove(links[!is.na(links)])
}

write_sums <- function(dir) {
  files <- list.files(dir, recursive = TRUE, all.files = TRUE)
  hashes <- vapply(file.path(dir, files), file_sha256, "")
  writeLines(paste0(hashes, "  ", files), file.path(dir, "SHA256SUMS"))
}

# The manifest is written last, so that it marks a complete bundle.
replace_bundle <- function(new, dir, fields, call) {
  # Again, as the folder may have changed during the download.
  check_bundle_place(dir, call)
  dir.create(dir, recursive = TRUE, showWarnings = FALSE)
  manifest <- file.path(dir, "bundle.dcf")
  tryCatch(suppressWarnings(write.dcf(list(Complete = "no"), manifest)), error = function(cnd) {
    abort_bundle(paste0("The folder ", dir, " cannot be written."), "Choose another one.", call)
  })
  unlink(file.path(dir, setdiff(bundle_parts(), "bundle.dcf")), recursive = TRUE)
  copy_bundle(new, dir, call)
  write.dcf(fields, manifest)
}

# Copies the files that a bundle lists and verifies the copies.
copy_bundle <- function(from, to, call) {
  sums <- readLines(file.path(from, "SHA256SUMS"))
  files <- substring(sums, 67L)
  for (folder in unique(dirname(file.path(to, files)))) {
    dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  }
  suppressWarnings(file.copy(file.path(from, files), file.path(to, files)))
  writeLines(sums, file.path(to, "SHA256SUMS"))
  # USB sticks do not store execute permissions.
  Sys.chmod(file.path(to, files), "755")
  right <- mapply(has_hash, file.path(to, files), substr(sums, 1L, 64L))
  if (!all(right)) {
    abort_bundle(
      paste0("The bundle in ", from, " could not be copied to ", to, ", and was not run: ",
             files[!right][[1L]], " is not what SHA256SUMS lists."),
      paste("It was damaged or changed: copy the bundle again, or make a new one.",
            "Or the disk is full: make room."),
      call
    )
  }
}

has_hash <- function(path, hash) file.exists(path) && identical(file_sha256(path), hash)

inform_of_bundle <- function(bundle) {
  files <- list.files(bundle$dir, recursive = TRUE, full.names = TRUE)
  megabytes <- round(sum(file.size(files)) / 1e6)
  needs <- if (!bundle$has_python) {
    paste0("It contains no Python: the other machine needs Python ", bundle$python, ".")
  }
  cli::cli_inform(c(
    v = "The bundle is ready: {megabytes} MB in {.path {bundle$dir}}.",
    "!" = needs,
    i = "On the other machine: {.code gym_server_install(offline = \"{basename(bundle$dir)}\")}"
  ))
}

# Packages for musl and for glibc differ.
bundle_system <- function() {
  paste0(system_name(), if (startsWith(system_name(), "linux") && has_musl()) "-musl")
}

# Reads a bundle's manifest and checks that it can be installed here, without copying anything.
read_bundle <- function(dir, extras, call) {
  dir <- absolute_path(dir)
  fields <- tryCatch(
    read.dcf(file.path(dir, "bundle.dcf"))[1L, ], error = function(cnd) NULL,
    warning = function(cnd) NULL
  )
  if (!all(c("System", "Lock", "Extras", "Python", "Index") %in% names(fields)) ||
        !file.exists(file.path(dir, "SHA256SUMS"))) {
    abort_bundle(
      paste0("There is no complete bundle in ", dir, "."),
      "`gym_server_bundle()` makes one.", call
    )
  }
  words <- function(field) strsplit(fields[[field]], "[[:space:]]+")[[1L]]
  check_bundle(fields, setdiff(extras, words("Extras")), extras, call)
  list(
    dir = dir, python = fields[["Python"]], index = words("Index"),
    has_python = length(list.files(file.path(dir, "python"))) > 0L
  )
}

check_bundle <- function(fields, lacking, extras, call) {
  if (fields[["System"]] != bundle_system()) {
    abort_bundle(
      paste0("The bundle was made for another system, ", fields[["System"]], "; this one is ",
             bundle_system(), "."),
      "Make it with `gym_server_bundle()` on a machine of this kind.", call
    )
  }
  if (fields[["Lock"]] != lock_hash()) {
    abort_bundle(
      "The bundle was made by another version of this package, which needs other packages.",
      "Install the same version of the package on both machines, and make a new bundle.", call
    )
  }
  if (length(lacking)) {
    abort_bundle(
      paste0("The bundle lacks ", paste0("\"", lacking, "\"", collapse = ", "), "."),
      paste0("On the other machine: `gym_server_bundle(dir, extras = ",
             paste(deparse(extras), collapse = ""), ")`."),
      call
    )
  }
}

abort_bundle <- function(problem, fix, call) {
  abort_install(c(problem, i = fix), call = call)
}
