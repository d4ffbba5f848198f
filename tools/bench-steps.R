# Steps a second through env_step(), beside the pattern of the classic client:
# httr for each call, content() and fromJSON() for each answer, and Flask's
# development server, which closes each connection. Both play CartPole-v1 with
# alternating actions, turn by turn in the same run.
#
#   Rscript tools/bench-steps.R [repeats] [classic steps] [steps]

library(gym)

arguments <- as.numeric(commandArgs(trailingOnly = TRUE))
setting <- function(i, default) if (is.na(arguments[i])) default else arguments[i]
repeats <- setting(1, 7)
classic_steps <- setting(2, 200)
steps <- setting(3, 2000)

server <- gym_server_start()
python <- gym:::the_session$servers[[server$remote_base]]$python
development <- processx::process$new(
  python,
  c("-c", paste(
    "from gym_server.app import create_app",
    "create_app().run(host='127.0.0.1', port=0, threaded=True)",
    sep = "\n"
  )),
  stderr = log <- tempfile(), env = gym:::server_environment()
)
repeat {
  line <- if (file.exists(log)) grep("Running on", readLines(log), value = TRUE)
  if (length(line)) break
  if (!development$is_alive()) stop("the development server did not start")
  Sys.sleep(0.1)
}
base <- sub(".*(http://[0-9.:]+).*", "\\1", line[1])

classic_post <- function(route, data) {
  response <- httr::POST(httr::modify_url(base, path = route), body = data, encode = "json")
  jsonlite::fromJSON(
    httr::content(response, as = "text", encoding = "UTF-8"), simplifyVector = FALSE
  )
}

classic_rate <- function(instance_id, steps) {
  route <- paste0("/v1/envs/", instance_id, "/")
  done <- TRUE
  started <- proc.time()[["elapsed"]]
  for (i in seq_len(steps)) {
    if (done) classic_post(paste0(route, "reset/"), list())
    done <- classic_post(
      paste0(route, "step/"), list(instance_id = instance_id, action = i %% 2, render = FALSE)
    )$done
  }
  steps / (proc.time()[["elapsed"]] - started)
}

rate <- function(instance_id, steps) {
  done <- TRUE
  started <- proc.time()[["elapsed"]]
  for (i in seq_len(steps)) {
    if (done) env_reset(server, instance_id)
    done <- env_step(server, instance_id, i %% 2)$done
  }
  steps / (proc.time()[["elapsed"]] - started)
}

classic_id <- classic_post("/v1/envs/", list(env_id = "CartPole-v1"))$instance_id
id <- env_create(server, "CartPole-v1")
rates <- matrix(NA_real_, repeats, 2, dimnames = list(NULL, c("classic", "env_step")))
for (i in seq_len(repeats)) {
  rates[i, "classic"] <- classic_rate(classic_id, classic_steps)
  rates[i, "env_step"] <- rate(id, steps)
  Sys.sleep(0.1)
}
invisible(development$kill())
gym_server_stop(server)

versions <- vapply(c("httr", "curl", "jsonlite"), function(p) format(packageVersion(p)), "")
cat("R ", format(getRversion()), ", ", paste(names(versions), versions, collapse = ", "),
    ", ", repeats, " turns of ", classic_steps, " and ", steps, " steps\n", sep = "")
for (way in colnames(rates)) {
  cat(sprintf("%-9s median %6.0f steps/s (%.0f to %.0f)\n", way, stats::median(rates[, way]),
              min(rates[, way]), max(rates[, way])))
}
cat(sprintf("env_step() is %.1f times the classic pattern (median of the turns' ratios)\n",
            stats::median(rates[, "env_step"] / rates[, "classic"])))
