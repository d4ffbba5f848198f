#' Check the installation
#'
#' Look at everything that the package needs: R and its packages, the installed Python environment,
#' the Pythons on the machine, servers, and environment variables. Print the findings on one screen,
#' mark problems and name the call that fixes each. This changes nothing, asks nothing, and takes a
#' few seconds at most. For a bug report you can use it in an R Markdown document.
#'
#' @return Invisibly, the findings: a data frame of class `gym_sitrep` with one row for each finding
#'   and the columns
#'   \describe{
#'   \item{topic}{A string: `"R"`, `"Python"`, `"servers"`.}
#'   \item{what}{What was checked, a string.}
#'   \item{finding}{What was found, a string.}
#'   \item{state}{`"ok"`, `"note"` for something that may be intended, or `"wrong"`.}
#'   \item{fix}{The call that helps, a string, or `NA`.}
#'   }
#'   The token and passwords in addresses are left out.
#' @seealso [gym_server_install()], [gym_server_log()]
#' @export
#' @examples
#' gym_sitrep()
gym_sitrep <- function() {
  found <- sitrep_findings()
  class(found) <- c("gym_sitrep", class(found))
  print(found)
  invisible(found)
}

sitrep_findings <- function() {
  variables <- Sys.getenv()
  variables <- variables[grepl("^GYM_", names(variables)) & nzchar(variables)]
  pythons <- tryCatch(try_pythons(python_candidates()), error = identity)
  url <- Sys.getenv("GYM_SERVER_URL")
  python_runs <- is.data.frame(pythons) && any(pythons$runs, na.rm = TRUE)
  rbind(
    attempt_rows("R", "versions", sitrep_versions()),
    attempt_rows("R", "BLAS", sitrep_blas()),
    attempt_rows("R", "suggested packages", sitrep_suggested()),
    attempt_rows("R", "variables", sitrep_variables(variables)),
    attempt_rows("Python", "environment", sitrep_environment(!python_runs && !nzchar(url))),
    attempt_rows("Python", "uv", sitrep_uv()),
    attempt_rows("Python", "Pythons", sitrep_pythons(pythons)),
    attempt_rows("servers", "this session's", sitrep_own_servers()),
    attempt_rows("servers", "GYM_SERVER_URL", sitrep_named_server(url))
  )
}

finding <- function(topic, what, finding, state = "ok", fix = NA_character_) {
  data.frame(topic, what, finding, state, fix)
}

# Users of gym_sitrep() already have a problem, so an error here becomes a finding.
attempt_rows <- function(topic, what, rows) {
  tryCatch(rows, error = function(cnd) {
    finding(topic, what, paste("could not be determined:", conditionMessage(cnd)), "wrong")
  })
}

#' @export
print.gym_sitrep <- function(x, ...) {
  for (topic in unique(x$topic)) {
    cat(cli::style_bold(topic), "\n", sep = "")
    cat(sitrep_lines(x[x$topic == topic, ]), sep = "\n")
  }
  wrong <- sum(x$state == "wrong")
  cat(
    if (wrong) {
      paste0(count_of(wrong, "thing"), if (wrong == 1) " is" else " are", " wrong, marked ",
             sitrep_mark("wrong"), ".")
    } else {
      "Nothing is wrong."
    },
    "\n", sep = ""
  )
  invisible(x)
}

sitrep_lines <- function(rows) {
  fix <- ifelse(is.na(rows$fix), "", paste0(" ", cli::symbol$arrow_right, " ", rows$fix))
  text <- home_as_tilde(shown_text(paste0(rows$what, ": ", rows$finding, fix)))
  paste(vapply(rows$state, sitrep_mark, ""), gsub("[[:space:]]*\n[[:space:]]*", " ", text))
}

sitrep_mark <- function(state) {
  switch(
    state,
    ok = cli::col_green(cli::symbol$tick),
    note = cli::col_cyan(cli::symbol$info),
    wrong = cli::col_red(cli::symbol$cross)
  )
}

home_as_tilde <- function(text) {
  home <- path.expand("~")
  if (nchar(home) > 1L) gsub(paste0(home, "/"), "~/", text, fixed = TRUE) else text
}
