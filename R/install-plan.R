# Plan an installation, and ask the user first: which uv, how many megabytes, where.

#' Plan an installation
#'
#' Nothing is changed or downloaded.
#' @param extras All extras that the environment will hold.
#' @param bundle The result of read_bundle(), `NULL` to use the network.
#' @return A list: `extras`; `bundle`; `uv`, the path of the uv found, `NULL` to use the bundle's or
#'   to download it first; `new_python`, whether uv installs one; `megabytes`, the approximate sizes
#'   of the download and on the disk, a numeric vector with the names `download` and `disk`.
#' @noRd
install_plan <- function(extras = character(), bundle = NULL, call = rlang::caller_env()) {
  uv <- if (is.null(bundle)) find_uv(call)
  megabytes <- lock_megabytes(extras)
  has_python <- has_venv(environment_folder(), bundle$python) || has_managed_python()
  installs <- if (is.null(bundle)) is.null(chosen_python()) else bundle$has_python
  new_python <- installs && !has_python
  if (new_python) {
    megabytes <- megabytes + managed_python_megabytes
  }
  if (is.null(bundle) && is.null(uv)) {
    megabytes <- megabytes + uv_megabytes
  }
  list(extras = extras, bundle = bundle, uv = uv, new_python = new_python, megabytes = megabytes)
}

# Approximate sizes on Linux with an Intel processor: the Python that uv installs, and the uv named
# in R/install-uv.R.
managed_python_megabytes <- c(download = 35, disk = 110)
uv_megabytes <- c(download = 20, disk = 40)

has_managed_python <- function() {
  start <- paste0("^cpython-", gsub(".", "[.]", managed_python_version, fixed = TRUE))
  length(list.files(managed_python_folder(), start)) > 0L
}

confirm_install <- function(plan, call = rlang::caller_env()) {
  what <- c(
    "The server that plays the environments needs Python packages on this machine.",
    paste0("What:  ", describe_plan(plan)),
    sprintf("Size:  %s, %.0f MB on the disk", describe_download(plan), plan$megabytes[["disk"]]),
    paste0("Where: ", install_root())
  )
  # No by default: an empty line of a pasted script must not start a download.
  ask_yes_no(paste(c(what, "Install them?"), collapse = "\n"), default = FALSE, call = call)
}

describe_plan <- function(plan) {
  uv <- if (!is.null(plan$bundle)) {
    "with the bundle's uv"
  } else if (is.null(plan$uv)) {
    paste("downloading uv", uv_release$version)
  } else {
    paste("with", plan$uv)
  }
  python <- if (plan$new_python) {
    paste(" and installing Python", plan$bundle$python %||% managed_python_version)
  }
  paste0(describe_packages(plan$extras), ", ", uv, python)
}

describe_packages <- function(extras) {
  paste0("the games of Gymnasium", if (length(extras)) paste0(" (with ", toString(extras), ")"))
}

describe_download <- function(plan) {
  if (!is.null(plan$bundle)) {
    return(paste0("from ", plan$bundle$dir, ", without a network"))
  }
  sprintf("about %.0f MB to download", plan$megabytes[["download"]])
}
