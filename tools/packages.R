# The R packages that the Makefile's goals need.
#   Rscript tools/packages.R lacking GOAL...             prints "need NAME" and "want NAME"
#   Rscript tools/packages.R install LIBRARY NAME...     from source or binary, as R is set up
#   Rscript tools/packages.R mirror LIBRARY REPOSITORY   newest versions of all we use, into LIBRARY
# A goal fails without a package that it needs. Without one that it wants, some tests are skipped.

declared <- function(field) {
  text <- read.dcf("DESCRIPTION", fields = field)[1, 1]
  entries <- trimws(strsplit(if (is.na(text)) "" else text, ",")[[1]])
  entries <- entries[nzchar(entries)]
  version <- ifelse(grepl(">=", entries), gsub(".*>=\\s*|\\s*\\).*", "", entries), "0")
  stats::setNames(version, trimws(sub("\\(.*", "", entries)))
}

is_installed <- function(package) {
  minimum <- c(declared("Imports"), declared("Suggests"))[package]
  length(find.package(package, quiet = TRUE)) > 0 &&
    (is.na(minimum) || utils::packageVersion(package) >= minimum)
}

# Not av, which needs 60 packages of apt. ffmpeg, which the server's extra "video" has, writes the
# same files.
too_large <- "av"

goal_packages <- function(goal) {
  imports <- names(declared("Imports"))
  vignettes <- c("knitr", "rmarkdown")
  benchmarks <- "reticulate"
  optional <- setdiff(names(declared("Suggests")), c("testthat", vignettes, benchmarks, too_large))
  switch(goal,
    demo = list(need = imports, want = "magick"),
    bench = list(need = c(imports, benchmarks)),
    test = list(need = c(imports, "testthat"), want = optional),
    check = list(need = c(imports, "testthat", vignettes, "codetools"), want = optional),
    pages = list(need = imports, want = c(vignettes, "magick")),
    site = list(need = c(imports, vignettes, "pkgdown", "dplyr"), want = optional),
    lint = list(need = c("lintr", "codetools", "spelling")),
    coverage = list(need = c(imports, "testthat", "covr"), want = optional),
    document = list(need = c(imports, "roxygen2"))
  )
}

lacking <- function(goals) {
  required <- declared("Depends")[["R"]]
  if (getRversion() < required) {
    stop("R ", required, " or newer is needed, and this is R ", getRversion(), call. = FALSE)
  }
  renew_library(".r-library")
  for (kind in c("need", "want")) {
    packages <- unique(unlist(lapply(lapply(goals, goal_packages), `[[`, kind)))
    writeLines(sprintf("%s %s", kind, Filter(Negate(is_installed), packages)))
  }
}

# Packages compiled for one minor version of R do not load in another.
renew_library <- function(library, made_for = paste(getRversion()[1, 1:2], R.version$platform)) {
  note <- file.path(library, ".made-for")
  if (!file.exists(note) || !identical(readLines(note, n = 1), made_for)) {
    unlink(library, recursive = TRUE)
    dir.create(library)
    writeLines(made_for, note)
  }
}

# Returns a URL that install.packages() understands even if the folder's name has blanks.
folder_url <- function(folder) paste0("file://", normalizePath(folder, winslash = "/"))

chosen_mirror <- function() {
  chosen <- getOption("repos")[["CRAN"]]
  if (chosen == "@CRAN@") utils::getCRANmirrors(local.only = TRUE)$URL[1] else chosen
}

install <- function(library, packages) {
  beside <- "../shared/cran"
  repositories <- c(if (dir.exists(beside)) folder_url(beside), chosen_mirror())
  for (repository in repositories) {
    available <- rownames(utils::available.packages(repos = repository))
    wanted <- intersect(Filter(Negate(is_installed), packages), available)
    if (length(wanted) > 0) {
      utils::install.packages(wanted, lib = library, repos = repository, Ncpus = 2)
    }
  }
}

mirror <- function(library, repository) {
  index <- file.path(repository, "src", "contrib", "PACKAGES")
  renew_library(library, paste(R.version$platform, getRversion(), tools::md5sum(index)))
  url <- folder_url(repository)
  available <- utils::available.packages(repos = url)
  used <- setdiff(c(names(declared("Imports")), names(declared("Suggests"))), too_large)
  used <- intersect(used, rownames(available))
  closure <- unlist(tools::package_dependencies(used, available, recursive = TRUE))
  packages <- intersect(c(used, closure), rownames(available))
  packages <- packages[!dir.exists(file.path(library, packages))]
  if (length(packages) > 0) {
    # Only tests use this library.
    utils::install.packages(
      packages, lib = library, repos = url, Ncpus = 2,
      INSTALL_opts = c("--no-help", "--no-test-load")
    )
  }
  failed <- packages[!dir.exists(file.path(library, packages))]
  if (length(failed) > 0) stop("not installed: ", toString(failed), call. = FALSE)
}

arguments <- commandArgs(trailingOnly = TRUE)
switch(arguments[1],
  lacking = lacking(arguments[-1]),
  install = install(arguments[2], arguments[-(1:2)]),
  mirror = mirror(arguments[2], arguments[3])
)
