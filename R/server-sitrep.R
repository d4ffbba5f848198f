#' Check the installation
#'
#' Look at everything that the package needs: R and its packages, the installed Python environment,
#' the Pythons on the machine, servers, and environment variables. Print the findings on one screen,
#' mark problems, and name the call that fixes each. This changes nothing and asks nothing. Add the
#' output to a bug report; it also works in an R Markdown document.
#'
#' @return Invisibly, the findings: a data frame of class `gym_sitrep` with one row for each finding
#'   and the columns
#'   \describe{
#'   \item{topic}{A string: `"R"`, `"Python"`, `"servers"`.}
#'   \item{what}{What was checked, a string.}
#'   \item{finding}{What was found, a string.}
#'   \item{state}{`"ok"`, `"note"` for something that may be intended, or `"wrong"`.}
#'   \item{fix}{The call that helps, a string, or `NA`.}
#'   } The findings contain neither the token nor passwords in addresses.
#' @seealso [gym_server_install()], [gym_server_log()]
#' @export
#' @examples
#' gym_sitrep()
gym_sitrep <- function() {
  url <- Sys.getenv("GYM_SERVER_URL")
  found <- rbind(
    sitrep_r(), attempt_rows("Python", "environment", sitrep_environment()),
    attempt_rows("Python", "uv", finding("Python", "uv", find_uv(timeout = 3) %||%
      "not found, it would be downloaded if needed")),
    attempt_rows("Python", "Pythons", sitrep_pythons(needed = !nzchar(url))),
    attempt_rows("servers", "this session's", sitrep_own_servers(url)),
    if (nzchar(url)) {
      place <- if (is_server_address(url)) local_place(sub("/+$", "", url))
      fix <- if (is.null(place)) "Sys.unsetenv(\"GYM_SERVER_URL\")" else start_call(place)
      what <- paste(without_passwords(url), "(GYM_SERVER_URL)")
      attempt_rows("servers", "GYM_SERVER_URL", sitrep_server(url, what, fix))
    }
  )
  class(found) <- c("gym_sitrep", class(found))
  print(found)
  invisible(found)
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

# Packages that only some functions need.
suggested_packages <- c(
  magick = "animate()", png = "frames of rollouts", sigmoid = "the scripts of the tutorial"
)

sitrep_r <- function() {
  versions <- vapply(c("httr", "curl", "jsonlite", "processx"), function(package) {
    paste(package, utils::packageVersion(package))
  }, "")
  missing <- Filter(function(package) !nzchar(system.file(package = package)),
                    names(suggested_packages))
  variables <- Sys.getenv()
  variables <- variables[grepl("^GYM_", names(variables)) & nzchar(variables)]
  # Hide secrets, because people show the report to others.
  variables[names(variables) == token_variable] <- "<token>"
  rbind(
    finding("R", "gym", paste0(
      utils::packageVersion("gym"), " on R ", getRversion(), " (", R.version$platform, ")"
    )),
    finding("R", "packages", toString(versions)), sitrep_blas(),
    if (length(missing)) {
      finding("R", "suggested packages", paste("not installed:", toString(
        paste0(missing, " (", suggested_packages[missing], ")")
      )), "note", paste0("install.packages(", deparse1(missing), ")"))
    },
    if (length(variables)) {
      finding("R", "variables", toString(
        paste0(names(variables), "=", without_passwords(variables))
      ))
    }
  )
}

# The basis of "twice as fast": PPO's updates with 64 and 256 rows, and two hidden layers of 64
# units, took 2.0 and 2.5 times as long with the reference BLAS.
sitrep_blas <- function(file = extSoftVersion()[["BLAS"]]) {
  if (is_reference_blas(file)) {
    finding("R", "BLAS", paste0(
      if (nzchar(file)) file else "R's own", ": the reference; with OpenBLAS agents with ",
      "gradients, such as agent_ppo(), learn about twice as fast",
      if (file.exists("/etc/debian_version")) " (apt install libopenblas0)"
    ), "note")
  } else {
    finding("R", "BLAS", file)
  }
}

sitrep_environment <- function() {
  there <- installed_server()
  folder <- environment_folder()
  if (!is.null(there)) {
    extras <- if (length(there$extras)) toString(there$extras) else "none"
    finding("Python", "environment", paste0(there$folder, " (extras: ", extras, ")"))
  } else if (dir.exists(folder)) {
    found <- paste(folder, "is damaged, or its installation was not finished")
    finding("Python", "environment", found, "wrong", "gym_server_install()")
  } else {
    finding("Python", "environment", "not installed", "note")
  }
}

# Lists Pythons up to the first one that runs the server. `needed`: whether it is wrong if there is
# none.
sitrep_pythons <- function(needed) {
  rows <- NULL
  for (python in python_candidates()) {
    problem <- python_problem(python, timeout = 30)
    if (is.null(problem)) {
      return(rbind(rows, finding("Python", python, "runs the server")))
    }
    fix <- if (!is.null(named_python(NULL))) {
      "Sys.unsetenv(\"GYM_PYTHON\")"
    } else if (is_installed_python(python)) {
      "gym_server_install()"
    }
    rows <- rbind(rows, finding("Python", python, paste("cannot run the server:", problem),
                                if (is.null(fix)) "note" else "wrong", fix %||% NA_character_))
  }
  wrong <- needed && !any(rows$state == "wrong")
  rbind(rows, finding("Python", "Python", "none runs the server", if (wrong) "wrong" else "note",
                      if (wrong) "gym_server_install()" else NA_character_))
}

# The running servers that this session started.
sitrep_own_servers <- function(named) {
  servers <- the_session$servers
  servers <- servers[!duplicated(vapply(servers, function(server) server$pid, 0L))]
  rows <- lapply(servers, function(server) {
    own <- identical(server$url, the_session$client$remote_base)
    what <- paste0(server$url, if (own) " (this session's)")
    if (server$process$is_alive()) {
      sitrep_server(server$url, what, "gym_server_log()")
    } else if (!is.null(reason <- server$why_ended())) {
      finding("servers", what, paste("has ended:", reason), if (own) "wrong" else "note",
              if (own) "gym_server_log()" else NA_character_)
    }
  })
  do.call(rbind, unname(rows)) %||% finding("servers", "this session's", paste(
    "none,", if (nzchar(named)) "gym_client() uses GYM_SERVER_URL" else "gym_client() starts one"
  ))
}

# Asks a server for its versions. An error becomes a finding.
sitrep_server <- function(url, what, fix) {
  if (!is_server_address(url)) {
    return(finding("servers", what, "is not the address of a server", "wrong", fix))
  }
  client <- new_client(url, 2, token = known_token(url))
  tryCatch(
    {
      count <- count_of(length(get_answer(client, "/v1/envs/")$all_envs), "environment")
      health <- get_answer(client, "/v1/health/")
      finding("servers", what, paste0(
        count, ", pid ", health$pid, ", server ", health$versions$gym_server, ", Gymnasium ",
        health$versions$gymnasium, ", Python ", health$versions$python
      ))
    },
    gym_error = function(cnd) {
      finding("servers", what, without_passwords(conditionMessage(cnd)), "wrong", fix)
    }
  )
}

#' @export
print.gym_sitrep <- function(x, ...) {
  fix <- ifelse(is.na(x$fix), "", paste0(" ", cli::symbol$arrow_right, " ", x$fix))
  text <- shown_text(paste0(x$what, ": ", x$finding, fix))
  home <- path.expand("~")
  if (nchar(home) > 1L) text <- gsub(paste0(home, "/"), "~/", text, fixed = TRUE)
  text <- gsub("[[:space:]]*\n[[:space:]]*", " ", text)
  lines <- paste(vapply(x$state, sitrep_mark, ""), text)
  for (topic in unique(x$topic)) cat(cli::style_bold(topic), lines[x$topic == topic], sep = "\n")
  wrong <- sum(x$state == "wrong")
  are <- paste(count_of(wrong, "thing"), if (wrong == 1) "is" else "are")
  cat(if (wrong) paste0(are, " wrong, marked ", sitrep_mark("wrong"), ".") else "Nothing is wrong.",
      "\n", sep = "")
  invisible(x)
}

sitrep_mark <- function(state) {
  switch(
    state, ok = cli::col_green(cli::symbol$tick), note = cli::col_cyan(cli::symbol$info),
    wrong = cli::col_red(cli::symbol$cross)
  )
}
