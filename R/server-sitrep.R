#' See how things stand
#'
#' Looks at everything that the package needs to play: R and packages, the installed Python
#' environment, the Pythons that would be tried, servers, and the environment variables that
#' the package reads. Prints it on one screen, marks what is wrong and names the call that
#' fixes it. It changes nothing and asks nothing, and takes a few seconds at most. For a bug
#' report it can stand in an R Markdown document.
#'
#' @return Invisibly, what was found: a data frame of class `gym_sitrep` with one row for
#'   each finding and the columns
#'   \describe{
#'     \item{topic}{What it belongs to, a string: `"R"`, `"Python"`, `"servers"`.}
#'     \item{what}{What was looked at, a string.}
#'     \item{finding}{What was found, a string.}
#'     \item{state}{`"ok"`; `"note"` for what may well be so; `"wrong"`.}
#'     \item{fix}{The call that helps, a string, or `NA`.}
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

# Who calls gym_sitrep() has a problem already: an error in finding something out becomes a finding.
attempt_rows <- function(topic, what, rows) {
  tryCatch(rows, error = function(cnd) {
    finding(topic, what, paste("could not be found out:", conditionMessage(cnd)), "wrong")
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
