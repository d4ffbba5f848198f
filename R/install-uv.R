# Finding uv, <https://docs.astral.sh/uv/>, and bringing it where there is none.

uv_name <- function() if (is_windows()) "uv.exe" else "uv"

# The first uv that runs and is new enough; NULL when there is none.
find_uv <- function(call = rlang::caller_env()) {
  named <- Sys.getenv("GYM_UV")
  if (nzchar(named)) {
    if (!uv_works(path.expand(named))) {
      abort_install(
        c(
          paste0("The variable GYM_UV names ", named, ", which is no uv that can be used."),
          i = paste0("It must be the path of uv ", least_uv, " or newer."),
          i = "`Sys.unsetenv(\"GYM_UV\")` has another looked for."
        ),
        call = call
      )
    }
    return(path.expand(named))
  }
  Find(uv_works, uv_candidates())
}

uv_candidates <- function() {
  reticulate <- Sys.getenv("RETICULATE_UV")
  places <- c(
    if (!reticulate %in% c("", "managed")) path.expand(reticulate),
    unname(Sys.which("uv")),
    path.expand(file.path(if (is_windows()) Sys.getenv("USERPROFILE") else "~",
                          ".local", "bin", uv_name())),
    file.path(tools::R_user_dir("reticulate", "cache"), "uv", "bin", uv_name()),
    brought_uv()
  )
  unique(places[nzchar(places) & file.exists(places)])
}

# --managed-python is older, but not by much.
least_uv <- "0.7.0"

uv_works <- function(uv) {
  said <- tryCatch(
    processx::run(uv, "--version", timeout = 30, error_on_status = FALSE)$stdout,
    error = function(cnd) ""
  )
  version <- regmatches(said, regexpr("[0-9]+[.][0-9]+[.][0-9]+", said))
  startsWith(said, "uv ") && length(version) == 1L && package_version(version) >= least_uv
}

# Where the pinned uv is put.
brought_uv <- function() file.path(install_root(), "uv", uv_name())
uv_release <- list(version = "0.11.12")
