# Learning curves from log files: our own, Stable-Baselines3's and CleanRL's.

read_curves <- function(path, call) {
  if (!file.exists(path)) {
    gym_abort(paste0("There is no file or folder \"", path, "\"."), class = "gym_error_argument",
              argument = "...", value = path, call = call)
  }
  rows <- if (dir.exists(path)) folder_curves(path) else file_curves(path)
  if (is.null(rows)) {
    gym_abort(
      c(paste0("\"", path, "\" has no log of a training."),
        i = paste("A log is a folder of `train_agent(log = )`, `progress.csv` or `monitor.csv` of",
                  "Stable-Baselines3, or a CSV file of CleanRL's `charts/episodic_return`."),
        i = if (endsWith(path, ".rds")) "A result that `readRDS()` returns is an argument, too."),
      class = "gym_error_argument", argument = "...", value = path, call = call
    )
  }
  # Runs with unknown seeds are numbered.
  unknown <- is.na(rows$seed)
  rows$seed[unknown] <- match(rows$run[unknown], unique(rows$run))
  rows[names(no_curve)]
}

# The rows of a folder or of those below it, `NULL` if there is no log; `run` identifies the run.
folder_curves <- function(path) {
  inside <- function(name) file.path(path, name)
  if (file.exists(inside("config.json")) && file.exists(inside("evaluations.csv"))) {
    return(own_curves(path))
  }
  progress <- if (file.exists(inside("progress.csv"))) file_curves(inside("progress.csv"))
  if (any(progress$kind == "curve")) {
    return(progress)
  }
  monitors <- list.files(path, "monitor[.]csv$", full.names = TRUE)
  if (length(monitors)) {
    return(monitor_curves(monitors, path))
  }
  if (!is.null(progress)) {
    return(progress)
  }
  below <- c(list.files(path, "[.]csv$", full.names = TRUE), list.dirs(path, recursive = FALSE))
  do.call(rbind, lapply(below, function(one) {
    if (dir.exists(one)) folder_curves(one) else file_curves(one)
  }))
}

own_curves <- function(path) {
  config <- jsonlite::read_json(file.path(path, "config.json"))
  rows <- utils::read.csv(file.path(path, "evaluations.csv"))
  run_rows(path, rows, env_id = config$env, seed = config$seed)
}

# Files of saveRDS() contain zeros.
is_text <- function(file) {
  opened <- gzfile(file, "rb")
  on.exit(close(opened))
  !any(readBin(opened, "raw", 1000L) == as.raw(0L))
}

# The first line identifies the kind of file.
file_curves <- function(file) {
  if (!is_text(file)) {
    return(NULL)
  }
  first <- readLines(file, 1L, warn = FALSE)
  if (!length(first)) {
    return(NULL)
  }
  if (startsWith(first, "#")) {
    return(monitor_curves(file, file))
  }
  table <- utils::read.csv(file, check.names = FALSE)
  if ("time/total_timesteps" %in% names(table)) {
    progress_curves(table, file)
  } else {
    cleanrl_curves(table, file)
  }
}

# Stable-Baselines3's logger, whose columns ours has, too.
progress_curves <- function(table, file) {
  evaluated <- any(!is.na(table[["eval/mean_reward"]]))
  value <- table[[if (evaluated) "eval/mean_reward" else "rollout/ep_rew_mean"]]
  rows <- data.frame(
    steps = table[["time/total_timesteps"]], mean_return = value %||% rep(NA_real_, nrow(table)),
    kind = if (evaluated) "curve" else "training"
  )
  run_rows(dirname(file), rows[!is.na(rows$mean_return), ])
}

# Stable-Baselines3's Monitor: a line of JSON, then reward, length and time of each episode.
# Parallel environments have a file each.
monitor_curves <- function(files, path) {
  each <- lapply(files, function(file) {
    about <- jsonlite::fromJSON(sub("^#", "", readLines(file, 1L)))
    rows <- utils::read.csv(file, skip = 1L)
    rows$time <- rows$t + about$t_start
    rows$env_id <- rep(about$env_id %||% NA_character_, nrow(rows))
    rows[c("r", "l", "time", "env_id")]
  })
  episodes <- do.call(rbind, each)
  episodes <- episodes[order(episodes$time), ]
  rows <- data.frame(
    steps = cumsum(as.numeric(episodes$l)), mean_return = episodes$r,
    kind = rep("training", nrow(episodes)), episodes = rep(1L, nrow(episodes))
  )
  run_rows(path, rows, env_id = episodes$env_id[1L])
}

# A table of TensorBoard has one run. One of Weights & Biases has the columns of one run, or a
# column for each, named after it.
cleanrl_curves <- function(table, file) {
  if (all(c("Step", "Value") %in% names(table))) {
    return(run_rows(file, training_rows(table$Step, table$Value)))
  }
  columns <- grep("episodic_return$", names(table), value = TRUE)
  steps <- table[[intersect(c("global_step", "_step", "Step"), names(table))[1L]]]
  if (!length(columns) || is.null(steps)) {
    return(NULL)
  }
  do.call(rbind, lapply(columns, function(column) {
    run <- sub(" - [^ ]*episodic_return$", "", column)
    run_rows(
      if (run == column) file else run, training_rows(steps, table[[column]])
    )
  }))
}

training_rows <- function(steps, value) {
  rows <- data.frame(steps = steps, mean_return = value, kind = "training")
  rows[!is.na(rows$mean_return), ]
}

# A run with all columns. If the log lacks a value, it is taken from the name of the run: CleanRL's
# consists of environment, script, seed and time.
run_rows <- function(run, rows, env_id = NULL, seed = NULL) {
  name <- basename(run)
  pattern <- "^(run-)?(.+)__(.+)__([0-9]+)__[0-9]+.*$"
  if (grepl(pattern, name)) {
    env_id <- env_id %||% sub(pattern, "\\2", name)
    seed <- seed %||% sub(pattern, "\\4", name)
  }
  if (grepl("seed[-_=]?[0-9]", name)) {
    seed <- seed %||% sub(".*seed[-_=]?([0-9]+).*", "\\1", name)
  }
  missing <- setdiff(names(no_curve), names(rows))
  rows[missing] <- lapply(no_curve[missing], function(none) rep(none[NA_integer_], nrow(rows)))
  rows$env_id <- rep(env_id %||% NA_character_, nrow(rows))
  rows$seed <- rep(as.numeric(seed %||% NA), nrow(rows))
  rows[c("steps", "mean_return")] <- lapply(rows[c("steps", "mean_return")], as.numeric)
  cbind(rows[names(no_curve)], run = rep(run, nrow(rows)))
}
