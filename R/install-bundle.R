# Bundles: what an installation downloads, in a folder that can be carried to a machine without a
# network.
#
#   bundle.dcf   the manifest: for which system, lock, extras and Python it was made
#   wheels/      the packages
#   lock/        the lock files, which list the packages
#   uv/          uv, when it was used
#   python/      the archive of the Python that uv installs, when it could be downloaded

#' Fill a folder for installing without a network
#'
#' Downloads what [gym_server_install()] would download, so that
#' `gym_server_install(offline = dir)` can install it on machines without a network: a
#' classroom's, say. Those need the same kind of system (Windows, macOS or Linux, and the same
#' processor) and the same version of this package.
#'
#' Where uv is found or can be downloaded it is part of the bundle, and so is the Python that it
#' installs. Where that cannot be downloaded the bundle is for the version of the Python that made
#' it, and the other machines need a Python of that version, too: the function says so.
#'
#' @param dir The folder, a string. It is made when it does not exist; an earlier bundle there
#'   is replaced as soon as it is clear how a new one can be made, anything else refused.
#' @param extras The extras that the bundle shall have, as for [gym_server_install()].
#' @return `dir`, invisibly.
#' @section Errors: `gym_error_install` when something could not be downloaded, with what to do;
#'   `gym_error_argument`.
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
  with_install_lock({
    plan <- install_plan(extras, call)
    dir <- empty_bundle(dir, call)
    cli::cli_inform(c(i = "Downloading {describe_packages(extras)} into {.path {dir}}."))
    uv <- if (plan$how == "download") install_uv(call) else if (plan$how == "uv") plan$tool
    base <- bundle_python(dir, uv, call)
    download_wheels(dir, base, extras, call)
    uv_hash <- copy_uv(uv, dir)
  })
  dir.create(file.path(dir, "lock"))
  file.copy(lock_files(extras), file.path(dir, "lock"))
  # Last, as a folder with the manifest is a complete bundle.
  write.dcf(list(
    System = bundle_system(), Lock = lock_hash(), Extras = paste(extras, collapse = " "),
    Python = probe_python(base$python)$version,
    Contains = if (is.null(uv_hash)) "packages" else if (base$managed) "uv and Python" else "uv",
    UvHash = uv_hash %||% "none"
  ), file.path(dir, "bundle.dcf"))
  unlink(file.path(dir, "making"), recursive = TRUE)
  inform_of_bundle(read_bundle(dir, call))
  invisible(dir)
}

bundle_parts <- c("bundle.dcf", "wheels", "lock", "uv", "python", "making")

# An earlier bundle has bundle.dcf, an incomplete one the folder "making". Other folders may have a
# folder "python", too.
check_bundle_place <- function(dir, call) {
  there <- list.files(dir, all.files = TRUE, no.. = TRUE)
  is_bundle <- all(there %in% bundle_parts) && any(c("bundle.dcf", "making") %in% there)
  if (file.exists(dir) && !dir.exists(dir) || length(there) && !is_bundle) {
    gym_abort(
      paste0("`dir` must be an empty folder or an earlier bundle, not \"", dir, "\"."),
      class = "gym_error_argument",
      call = call
    )
  }
}

empty_bundle <- function(dir, call) {
  # Again, as the folder may have changed while this session waited for the install lock.
  check_bundle_place(dir, call)
  # First the folder by which an incomplete bundle is known: removing the rest may be interrupted.
  dir.create(file.path(dir, "making"), recursive = TRUE, showWarnings = FALSE)
  if (!dir.exists(file.path(dir, "making"))) {
    abort_install(paste0("The folder ", dir, " cannot be made."), call = call)
  }
  unlink(file.path(dir, setdiff(bundle_parts, "making")), recursive = TRUE)
  unlink(list.files(file.path(dir, "making"), full.names = TRUE), recursive = TRUE)
  normalizePath(dir, winslash = "/")
}

# The Python that downloads the packages, and for which they are: one that uv installs, whose
# archive becomes a part of the bundle, or one of this machine.
bundle_python <- function(dir, uv, call) {
  if (!is.null(uv)) {
    place <- file.path(dir, "making", "python")
    output <- run_tool(
      uv, c("python", "install", managed_python_version, "--install-dir", place),
      env = c(UV_PYTHON_CACHE_DIR = file.path(dir, "python"), not_registered)
    )
    found <- list.files(place, paste0("^cpython-", managed_python_version), full.names = TRUE)
    if (!failed(output) && length(found)) {
      python <- file.path(found[[1L]], if (is_windows()) "python.exe" else "bin/python3")
      return(list(python = python, managed = TRUE))
    }
  }
  python <- find_base_python(with_venv = TRUE)
  if (is.null(python)) {
    if (is.null(uv)) output <- character()
    abort_tool(
      "There is no Python for which the packages could be downloaded", output, call,
      more = "Python 3.10 to 3.13 with `venv` is needed where uv cannot install one."
    )
  }
  list(python = python, managed = FALSE)
}

download_wheels <- function(dir, base, extras, call) {
  venv <- file.path(dir, "making", "venv")
  output <- run_tool(base$python, c("-I", "-m", "venv", venv))
  if (!failed(output)) {
    python <- file.path(venv, if (is_windows()) "Scripts/python.exe" else "bin/python")
    output <- run_tool(python, c(
      "-I", "-m", "pip", "download", "--require-hashes", "--only-binary", ":all:", "--no-deps",
      "--dest", file.path(dir, "wheels"), as.vector(rbind("-r", lock_files(extras)))
    ))
  }
  if (failed(output)) {
    abort_tool("The server's packages could not be downloaded", output, call)
  }
}

# Copies uv into the bundle. Returns the copy's SHA-256, NULL when there is no copy that works.
copy_uv <- function(uv, dir) {
  if (is.null(uv)) {
    return(NULL)
  }
  place <- file.path(dir, "uv", uv_name())
  dir.create(dirname(place))
  # The uv on the PATH may be a script that calls the real one.
  if (file.copy(uv, place) && uv_works(place)) {
    return(file_sha256(place))
  }
  unlink(dirname(place), recursive = TRUE)
  NULL
}

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

# Packages for musl differ from those for glibc.
bundle_system <- function() {
  paste0(system_name(), if (startsWith(system_name(), "linux") && has_musl()) "-musl")
}

read_bundle <- function(dir, call) {
  dir <- absolute_path(dir)
  fields <- tryCatch(
    read.dcf(file.path(dir, "bundle.dcf"))[1L, ], error = function(cnd) NULL,
    warning = function(cnd) NULL
  )
  if (!all(c("System", "Lock", "Extras", "Python", "Contains", "UvHash") %in% names(fields))) {
    abort_bundle(
      paste0("There is no complete bundle in ", dir, "."),
      "`gym_server_bundle()` makes one; an incomplete one has no file bundle.dcf.", call
    )
  }
  dir <- normalizePath(dir, winslash = "/")
  uv <- file.path(dir, "uv", uv_name())
  list(
    dir = dir, system = fields[["System"]], lock = fields[["Lock"]],
    extras = strsplit(fields[["Extras"]], " ", fixed = TRUE)[[1L]], python = fields[["Python"]],
    uv = if (fields[["UvHash"]] != "none") uv, hash_of_uv = fields[["UvHash"]],
    has_python = fields[["Contains"]] == "uv and Python"
  )
}

abort_bundle <- function(problem, fix, call) {
  abort_install(c(problem, i = fix), call = call)
}

# Plans an installation from a bundle, as install_plan() does. Before the bundle's uv is run,
# copy_bundled_uv() must copy it.
bundle_plan <- function(dir, extras, call) {
  bundle <- read_bundle(dir, call)
  check_bundle(bundle, extras, call)
  plan_from_bundle(bundle, extras, call)
}

plan_from_bundle <- function(bundle, extras, call) {
  # Another uv would install another Python than the one whose archive is in the bundle.
  uv <- if (is.null(bundle$uv)) find_uv(call) else bundled_uv()
  python <- if (is.null(uv) || !bundle$has_python) {
    find_base_python(with_venv = is.null(uv), versions = bundle$python) %||% abort_bundle(
      paste0("The bundle is for Python ", bundle$python, " and contains none."),
      paste0("Install Python ", bundle$python, " on this machine, or make the bundle on one where ",
             "uv can install a Python."),
      call
    )
  }
  list(
    how = if (is.null(uv)) "python" else "uv", tool = if (is.null(uv)) python else uv,
    extras = extras, bundle = bundle, base_python = python,
    megabytes = c(download = 0, disk = lock_megabytes(extras)[["disk"]])
  )
}

check_bundle <- function(bundle, extras, call) {
  if (bundle$system != bundle_system()) {
    abort_bundle(
      paste0("The bundle was made for another system, ", bundle$system, "; this one is ",
             bundle_system(), "."),
      "Make it with `gym_server_bundle()` on a machine of this kind.", call
    )
  }
  if (bundle$lock != lock_hash()) {
    abort_bundle(
      "The bundle was made by another version of this package, which needs other packages.",
      "Install the same version of the package on both machines, and make the bundle anew.", call
    )
  }
  lacking <- setdiff(extras, bundle$extras)
  if (length(lacking)) {
    abort_bundle(
      paste0("The bundle lacks ", paste0("\"", lacking, "\"", collapse = ", "), "."),
      paste0("On the other machine: `gym_server_bundle(dir, extras = ",
             paste(deparse(extras), collapse = ""), ")`."),
      call
    )
  }
}

# A bundle's uv is copied here: programs cannot be run from some sticks and network shares.
bundled_uv <- function() file.path(install_root(), "uv", "bundle", uv_name())

# Copies the bundle's uv, unless that was done before, and runs it only if it has the SHA-256 that
# the manifest names. If it does not run here, another uv is looked for. Returns the plan.
copy_bundled_uv <- function(plan, call) {
  bundle <- plan$bundle
  if (is.null(bundle$uv)) {
    return(plan)
  }
  uv <- bundled_uv()
  if (!has_hash(uv, bundle$hash_of_uv)) {
    dir.create(dirname(uv), recursive = TRUE, showWarnings = FALSE)
    if (!has_hash(bundle$uv, bundle$hash_of_uv)) {
      abort_bundle(
        paste0("The uv in ", bundle$dir, " is not the one that was put there, and was not run."),
        "It was damaged or changed on the way: copy the bundle again, or make it anew.", call
      )
    }
    file.copy(bundle$uv, uv, overwrite = TRUE)
    Sys.chmod(uv, "755")
  }
  if (has_hash(uv, bundle$hash_of_uv) && uv_works(uv)) {
    return(plan)
  }
  bundle$uv <- NULL
  plan_from_bundle(bundle, plan$extras, call)
}

has_hash <- function(path, hash) file.exists(path) && identical(file_sha256(path), hash)
