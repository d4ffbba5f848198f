# Makes the table of solved environments, inst/extdata/solve-table.csv.gz (a row for each training),
# and solve-curves.csv.gz (the evaluations of each). It trains in every environment of
# tools/solve/jobs.R with the settings of agent_presets(), with seeds that were not used to choose
# settings.
#
#   tools/in-env Rscript --no-init-file tools/solve-table.R [processes=2] [only=ENV_ID,...]
#     [methods=METHOD,...] [seeds=N]
#
# It takes hours. `seeds` trains only the first seeds of each job. You can stop it at any time:
# trainings that are already in the tables are not repeated. To repeat one, delete its rows from
# both first.
source("tools/processes.R")
source("tools/solve/jobs.R")

only <- strsplit(option("only", paste(unique(solve_jobs$env_id), collapse = ",")), ",")[[1L]]
most_seeds <- as.integer(option("seeds", max(solve_jobs$seeds)))
methods <- strsplit(option("methods", paste(unique(solve_jobs$method), collapse = ",")), ",")[[1L]]

table_file <- "inst/extdata/solve-table.csv.gz"
curve_file <- "inst/extdata/solve-curves.csv.gz"
key <- function(rows) paste(job_key(rows), rows$seed)
read_rows <- function(file) {
  if (file.exists(file)) {
    utils::read.csv(file, na.strings = "NA", colClasses = c(kwargs = "character"))
  }
}

# Adds rows in the order of the jobs and seeds.
add_rows <- function(file, rows) {
  all <- rbind(read_rows(file), rows)
  of_job <- match(job_key(all), job_key(solve_jobs))
  all <- all[order(of_job, all$seed, method = "radix"), ]
  to <- if (endsWith(file, ".gz")) gzfile(file, compression = 9L) else base::file(file)
  open(to, "w")
  on.exit(close(to))
  utils::write.csv(all, to, row.names = FALSE)
}

todo <- do.call(rbind, lapply(seq_len(nrow(solve_jobs)), function(row) {
  job <- solve_jobs[row, ]
  data.frame(
    row = row, env_id = job$env_id, kwargs = job$kwargs, method = job$method,
    seed = first_seed(job) + seq_len(min(job$seeds, most_seeds)) - 1L
  )
}))
todo <- todo[todo$env_id %in% only & todo$method %in% methods, ]
todo <- todo[!key(todo) %in% key(read_rows(table_file)), ]
cat(nrow(todo), "trainings left\n")

run_side_by_side(
  "tools/solve/train.R", Map(c, todo$row, todo$seed), as.integer(option("processes", "2")),
  function(made, task) {
    add_rows(table_file, made$table)
    add_rows(curve_file, made$curve)
    cat(sprintf(
      "%s: %.1f after %.0f steps, %.0f s\n", key(made$table), made$table$mean_return,
      made$table$steps, made$table$seconds
    ))
  }
)
