#!/usr/bin/env bash
# cli's pluralize() needs the package glue, which cli only suggests; the same text in cli_text() does
# not.
#
# Versions: cli 3.6.6, R 4.2. CRAN= names another repository.
# Expected: where cli is installed, both format "2 files", or the documentation names glue.
# Seen: cli_text() prints it. pluralize() is an error, there is no package called 'glue', also with
#   another function as its argument .transformer, whose default is one of glue.
# Reason: pluralize() calls glue::glue(). cli_text() has a copy of what it needs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
mkdir library
export R_LIBS="$folder/library" R_LIBS_USER="$folder/none" R_LIBS_SITE="$folder/none"
cat >install.R <<'EOF'
base <- Sys.getenv("CRAN", "https://cloud.r-project.org")
# A version that is not the newest is in the archive.
places <- paste0(base, "/src/contrib/", c("", "Archive/cli/"), "cli_3.6.6.tar.gz")
for (place in places) {
  if (requireNamespace("cli", quietly = TRUE)) break
  try(suppressWarnings(utils::download.file(place, "cli.tar.gz", quiet = TRUE)), silent = TRUE)
  if (file.exists("cli.tar.gz")) utils::install.packages("cli.tar.gz", repos = NULL, quiet = TRUE)
}
EOF
cat >pluralize.R <<'EOF'
stopifnot(packageVersion("cli") == "3.6.6")
n <- 2
cli::cli_text("{n} file{?s}")
cat(tryCatch(cli::pluralize("{n} file{?s}"), error = conditionMessage), "\n")
own <- function(code, envir) eval(parse(text = code), envir)
cat(tryCatch(cli::pluralize("{n} file{?s}", .transformer = own), error = conditionMessage), "\n")
EOF
Rscript --no-init-file install.R >install.log 2>&1 || { cat install.log; exit 1; }
said=$(Rscript --no-init-file pluralize.R 2>&1)
printf '%s\n' "$said"
mapfile -t lines <<<"$said"
[[ "${lines[0]}" == "2 files" && "${lines[1]}" == *"no package called"*glue* &&
  "${lines[2]}" == *"no package called"*glue* ]] || {
  echo "This has changed."
  exit 1
}
