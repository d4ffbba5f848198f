# The benchmark. With CartPole and alternating actions it measures steps a second of single and
# vector environments through gym, reticulate, the classic pattern and Python itself, the seconds of
# searches, and memory. It also measures whole episodes of ten environments by rollout(), and what
# R's own calls add to a step. The contenders take turns in one run.
#
#   make bench              half an hour; writes bench.csv, bench.md, bench.png and
#                           bench-environments.png into vignettes/articles/
#   make bench QUICK=1      the same with few turns, into pictures/
#
# tools/in-env Rscript tools/bench.R [quick] [single] [vector] [r_env] [search] [env_rollouts]
#   [beside] [wire] [memory] [tables] [data] runs parts.
#
#   make bench PARTS=stream      compares another build of this package with this one; see
#                                tools/bench/stream.R on how to name it
#
#   make bench PARTS=gradients   PPO against Stable-Baselines3, hours; writes
#                                bench-gradients.csv and bench-gradients.md there.
#                                Only this part needs torch; see tools/bench/gradients.R, also for
#                                how it is measured bit by bit

library(gym)
for (file in c("turns", "workers", "cpu", "classic", "contenders", "r-env", "search", "tasks",
               "rollouts", "beside", "wire", "stream", "gradients", "tables", "data", "results",
               "goals",
               "table", "figure", "figure-environments")) {
  source(file.path("tools", "bench", paste0(file, ".R")))
}
source("vignettes/pictures.R")

progress <- function(...) message(format(Sys.time(), "%H:%M:%S "), ...)

# `searches`: how often search_random() plays the rounds that the tutorial's script plays once.
settings <- function(quick) {
  if (quick) {
    list(turns = 3L, seconds = 0.3, num_envs = c(1, 32, 1024, 8192), searches = 1L, rounds = 5,
         fresh = 1L, steps = 1e5, rollout_turns = 2L,
         step_turns = 10L, turn_steps = 80, gradient_turns = c("CartPole-v1" = 3L),
         gradient_seeds = c("CartPole-v1" = 3L))
  } else {
    list(turns = 7L, seconds = 0.7, num_envs = c(1, 32, 256, 1024, 4096, 8192), searches = 5L,
         rounds = 50, fresh = 5L, steps = 1e6, rollout_turns = 3L,
         step_turns = 40L, turn_steps = 160,
         gradient_turns = c("CartPole-v1" = 7L, "LunarLander-v3" = 5L),
         gradient_seeds = c("CartPole-v1" = 10L, "LunarLander-v3" = 10L))
  }
}

bench <- function(parts, quick) {
  python <- Sys.getenv("GYM_PYTHON")
  scale <- settings(quick)
  setup <- set_up(python, parts)
  on.exit(tear_down(setup))
  started <- now()
  contenders <- c(
    if ("single" %in% parts) single_contenders(setup),
    if ("vector" %in% parts) {
      unlist(lapply(scale$num_envs, function(n) vector_contenders(setup, n)), recursive = FALSE)
    }
  )
  rows <- rbind(
    if (length(contenders)) play_turns(contenders, scale$turns, scale$seconds),
    if ("r_env" %in% parts) compare_r_envs(scale$turns),
    if ("search" %in% parts) compare_searches(setup, scale$searches, scale$rounds),
    if ("search" %in% parts) fresh_searches(scale$fresh),
    if ("env_rollouts" %in% parts) compare_rollouts(python, scale$rollout_turns, quick),
    if ("beside" %in% parts) compare_beside(python, scale$rollout_turns, quick),
    if ("wire" %in% parts) compare_steps(python, scale$step_turns, scale$turn_steps),
    if ("stream" %in% parts) compare_builds(3L * scale$turns),
    if ("gradients" %in% parts) {
      compare_gradients(python, utils::modifyList(scale, gradient_scale))
    },
    if ("tables" %in% parts) compare_tables(python, scale$rollout_turns, scale$fresh),
    if ("data" %in% parts) compare_data(python, scale$rollout_turns),
    if ("memory" %in% parts) measure_memory(scale$steps)
  )
  list(rows = rows, run = c(describe_run(setup, parts), took = paste(round(now() - started), "s")))
}

set_up <- function(python, parts) {
  if (all(parts %in% c("gradients", "tables", "data", "stream"))) {
    return(list(python = start_python(python)))
  }
  numpy_1 <- Filter(dir.exists, file.path(dirname(dirname(python)), "numpy-1"))
  list(
    client = gym_server_start(python = python, token = FALSE),
    development = start_development_server(python),
    python = start_python(python),
    reticulate = lapply(c(list(NULL), numpy_1), start_reticulate, python = python)
  )
}

tear_down <- function(setup) {
  workers <- c(list(setup$development, setup$python), setup$reticulate)
  for (worker in Filter(Negate(is.null), workers)) end_worker(worker)
  if (!is.null(setup$client)) gym_server_stop(setup$client)
}

measure_memory <- function(steps) {
  progress("memory")
  lines <- processx::run(
    file.path(R.home("bin"), "Rscript"), c("--no-init-file", "tools/bench/memory.R", steps)
  )$stdout
  lines <- strsplit(strsplit(trimws(lines), "\n")[[1L]], ": ")
  do.call(rbind, lapply(lines, function(line) {
    measured("memory", 0, line[[1L]], "", 1L, as.numeric(line[[2L]]), "MB")
  }))
}

describe_run <- function(setup, parts) {
  server <- ask(setup$python, "versions")
  ours <- c("gym", "httr", "curl", "jsonlite")
  reticulates <- lapply(setup$reticulate, ask, "versions")
  c(
    date = format(Sys.Date()),
    cores = server$cores, system = server$system,
    R = format(getRversion()),
    vapply(ours, function(package) format(utils::packageVersion(package)), ""),
    libcurl = curl::curl_version()$version,
    unlist(server[setdiff(names(server), c("cores", "system"))]),
    if (length(reticulates)) {
      c(reticulate = paste(vapply(reticulates, function(its) {
        paste0(its$reticulate, " on Python ", its$Python, " with gymnasium ", its$Gymnasium,
               ", NumPy ", its$NumPy)
      }, ""), collapse = " and "))
    },
    if ("gradients" %in% parts) c(BLAS = name_of_blas(), sb3_versions())
  )
}

report <- function(result, csv, text, figure, environments) {
  write_results(result$rows, result$run, csv)
  lines <- c(all_tables(result$rows), goal_lines(result$rows), "", run_lines(result$run))
  writeLines(lines, text)
  cat(lines, sep = "\n")
  made <- character()
  if (all(c("single", "vector") %in% result$rows$part)) {
    draw_figure(result$rows, result$run, figure)
    made <- figure
  }
  if (all(c("env_rollouts", "wire") %in% result$rows$part)) {
    draw_environments(result$rows, result$run, environments)
    made <- c(made, environments)
  }
  if (requireNamespace("magick", quietly = TRUE)) fewer_colours(made)
}

arguments <- commandArgs(trailingOnly = TRUE)
quick <- "quick" %in% arguments
all_parts <- c("single", "vector", "r_env", "search", "env_rollouts", "beside", "wire",
               "memory", "tables", "data")
parts <- intersect(c(all_parts, "stream", "gradients"), arguments)
whole <- !quick && !length(parts)
if (!length(parts)) parts <- all_parts
if ("gradients" %in% parts) gradient_scale <- chosen_scale(arguments)
kept <- if (!quick && identical(parts, "gradients")) "bench-gradients" else if (whole) "bench"
folder <- if (is.null(kept)) "pictures" else "vignettes/articles"
dir.create(folder, showWarnings = FALSE)
at <- function(ending) file.path(folder, paste0(if (is.null(kept)) "bench" else kept, ending))
result <- bench(parts, quick)
if (identical(kept, "bench-gradients")) result$rows <- with_earlier(result$rows, at(".csv"))
report(
  result, csv = at(".csv"), text = at(".md"), figure = at(".png"),
  environments = at("-environments.png")
)
