# The findings of gym_sitrep(), topic by topic. Each function returns rows made by finding().

sitrep_versions <- function() {
  packages <- c("httr", "curl", "jsonlite", "processx")
  versions <- vapply(packages, function(package) as.character(utils::packageVersion(package)), "")
  rbind(
    finding("R", "gym", paste0(
      utils::packageVersion("gym"), " on R ", getRversion(), " (", R.version$platform, ")"
    )),
    finding("R", "packages", paste(packages, versions, collapse = ", "))
  )
}

# Measured: updates of PPO with 64 and 256 rows, two hidden layers of 64, took 2.0 and 2.5 times as
# long with the reference.
sitrep_blas <- function(file = extSoftVersion()[["BLAS"]]) {
  if (!is_reference_blas(file)) {
    return(finding("R", "BLAS", file))
  }
  finding("R", "BLAS", paste0(
    if (nzchar(file)) file else "R's own", ": the reference; with OpenBLAS agents with gradients, ",
    "such as agent_ppo(), learn about twice as fast",
    if (file.exists("/etc/debian_version")) " (apt install libopenblas0)"
  ), "note")
}

# Packages that only some functions need.
suggested_packages <- c(
  magick = "animate()", png = "frames of rollouts",
  sigmoid = "the scripts of the tutorial", bit64 = "integers beyond 2^53"
)

sitrep_suggested <- function(packages = suggested_packages) {
  there <- vapply(names(packages), function(package) nzchar(system.file(package = package)), NA)
  if (all(there)) {
    return(finding("R", "suggested packages", "all installed"))
  }
  missing <- packages[!there]
  finding(
    "R", "suggested packages",
    paste("not installed:", paste0(names(missing), " (", missing, ")", collapse = ", ")),
    "note", paste0("install.packages(", deparse1(unname(names(missing))), ")")
  )
}

# Secrets are left out, because people show the report to others.
sitrep_variables <- function(variables) {
  texts <- if (length(variables)) {
    values <- ifelse(names(variables) == token_variable, "<token>", without_passwords(variables))
    paste0(names(variables), "=", values, collapse = ", ")
  }
  finding("R", "variables", texts %||% "none of the package's is set")
}

# `needed`: whether nothing else can run the server, so that a missing environment is a problem.
sitrep_environment <- function(needed) {
  server <- installed_server()
  folders <- install_folders()
  row <- function(text, wrong = needed) {
    finding("Python", "environment", text, if (wrong) "wrong" else "note",
            if (wrong) "gym_server_install()" else NA_character_)
  }
  if (!is.null(server)) {
    extras <- if (length(server$extras)) paste(server$extras, collapse = ", ") else "none"
    finding("Python", "environment", paste0(
      server$folder, " (extras: ", extras, "; ", folder_megabytes(server$folder), " MB)"
    ))
  } else if (!length(folders)) {
    row("not installed")
  } else if (environment_folder() %in% folders) {
    row(paste(environment_folder(), "is damaged, or its installation was not finished"),
        wrong = TRUE)
  } else {
    row(paste(folders[[1L]], "was made for another version of the package"))
  }
}

folder_megabytes <- function(folder) {
  files <- list.files(folder, all.files = TRUE, full.names = TRUE, recursive = TRUE)
  # lib64 is a link to lib, and Python itself may be a link to another.
  files <- files[!grepl("/lib64/", files, fixed = TRUE) & Sys.readlink(files) %in% c("", NA)]
  round(sum(file.size(files), na.rm = TRUE) / 1e6)
}

sitrep_uv <- function() {
  uv <- tryCatch(find_uv(within = 3), gym_error = identity)
  candidates <- uv_candidates()
  if (inherits(uv, "gym_error")) {
    finding("Python", "uv", conditionMessage(uv), "wrong", "Sys.unsetenv(\"GYM_UV\")")
  } else if (is.null(uv) && length(candidates)) {
    finding("Python", "uv", paste(
      paste(candidates, collapse = ", "), "cannot be used (too old, or without an answer)"
    ), "note")
  } else {
    finding("Python", "uv", uv %||% "not found, it would be downloaded if needed")
  }
}

sitrep_pythons <- function(pythons) {
  if (inherits(pythons, "error")) {
    stop(pythons)
  }
  if (!nrow(pythons)) {
    return(finding("Python", "Pythons", "none was found", "note"))
  }
  taken <- which(pythons$runs)[1L]
  named <- !is.null(named_python(NULL))
  shown <- 6L
  own <- installed_server()$python
  rows <- Map(
    function(i, python, version, runs, reason, extras) {
      what <- paste0(python, if (!is.na(version)) paste0(" (", version, ")"))
      if (isTRUE(runs)) {
        runs <- if (i == taken) "runs the server" else "would run it, too"
        finding("Python", what, paste0(runs, " (extras: ", if (nzchar(extras)) extras else "none",
                                       ")"))
      } else if (named && isFALSE(runs)) {
        finding("Python", what, paste("cannot run the server:", reason), "wrong",
                "Sys.unsetenv(\"GYM_PYTHON\")")
      } else if (isFALSE(runs) && python %in% own) {
        finding("Python", what, paste("cannot run the server:", reason), "wrong",
                "gym_server_install()")
      } else {
        problem <- if (is.na(runs)) reason else paste("cannot run it:", reason)
        finding("Python", what, problem, "note")
      }
    },
    seq_len(nrow(pythons)), pythons$python, pythons$version, pythons$runs, pythons$reason,
    pythons$extras
  )
  more <- length(rows) - shown
  do.call(rbind, c(
    utils::head(unname(rows), shown),
    if (more > 0L) list(finding("Python", "Pythons", paste("and", more, "more"), "note"))
  ))
}

# The running servers that this session started.
sitrep_own_servers <- function() {
  servers <- the_session$servers
  servers <- servers[!duplicated(vapply(servers, function(server) server$pid, 0L))]
  rows <- lapply(servers, function(server) {
    status <- server$process$get_exit_status()
    own <- identical(server$url, the_session$client$remote_base)
    what <- paste0(server$url, if (own) " (this session's)")
    if (server$process$is_alive()) {
      sitrep_server(server$url, what, "gym_server_log()")
    } else if (!identical(status, 0L)) {
      finding("servers", what, paste("ended with status", status), if (own) "wrong" else "note",
              if (own) "gym_server_log()" else NA_character_)
    }
  })
  do.call(rbind, unname(rows)) %||%
    finding("servers", "this session's", if (nzchar(Sys.getenv("GYM_SERVER_URL"))) {
      "none, gym_client() uses GYM_SERVER_URL"
    } else {
      "none yet, gym_client() starts one"
    })
}

sitrep_named_server <- function(url) {
  if (!nzchar(url)) {
    return(NULL)
  }
  what <- paste(without_passwords(url), "(GYM_SERVER_URL)")
  unset <- "Sys.unsetenv(\"GYM_SERVER_URL\")"
  if (!is_server_address(url)) {
    return(finding("servers", what, "is not the address of a server", "wrong", unset))
  }
  place <- local_place(sub("/+$", "", url))
  sitrep_server(url, what, if (is.null(place)) unset else start_call(place))
}

# Asks one server what it is.
sitrep_server <- function(url, what, fix) {
  token <- known_token(url)
  probe <- probe_server(url, timeout = 2, token)
  if (!probe$listens) {
    return(finding("servers", what, "does not answer", "wrong", fix))
  }
  if (!is.null(probe$problem)) {
    return(finding("servers", what, "takes connections but gave no answer in 2 seconds", "wrong",
                   fix))
  }
  if (isTRUE(probe$status %in% proxy_statuses)) {
    return(finding("servers", what, paste0(
      "a proxy, and the server behind it does not answer (status ", probe$status, ")"
    ), "wrong"))
  }
  if (!probe$is_gym) {
    called <- if (!is.null(probe$name)) paste0(", it calls itself \"", probe$name, "\"")
    return(finding("servers", what, paste0("no Gym server", called), "wrong",
                   "Sys.unsetenv(\"GYM_SERVER_URL\")"))
  }
  if (probe$asks_token) {
    wants <- if (is.null(token)) "a token" else "another token"
    return(finding("servers", what, paste("asks for", wants), "wrong",
                   paste0("Sys.setenv(", token_variable, " = \"...\")")))
  }
  count <- count_of(probe$instances, "environment")
  health <- tryCatch(get_answer(new_client(url, 2, token = token), "/v1/health/"),
                     gym_error = function(cnd) NULL)
  versions <- health$versions
  finding("servers", what, paste0(
    count,
    if (!is.null(health$pid)) paste0(", pid ", health$pid),
    if (!is.null(versions)) {
      paste0(", server ", versions$gym_server, ", Gymnasium ", versions$gymnasium, ", Python ",
             versions$python)
    } else {
      ", a classic server"
    }
  ))
}
