# Makes the table of learners, inst/extdata/learn-table.csv, with a row for each training. It trains
# in every environment of tools/learn/jobs.R, with seeds that were not used to choose settings.
#
#   tools/in-env Rscript --no-init-file tools/learn-table.R [processes=2] [only=ENV_ID,...]
#
# It takes about half an hour. You can stop it at any time: trainings that are already in the table
# are not repeated. To repeat one, delete its row first.
source("tools/processes.R")
source("tools/learn/jobs.R")

table_file <- "inst/extdata/learn-table.csv"
read_rows <- function() if (file.exists(table_file)) utils::read.csv(table_file)
key <- function(rows) paste(rows$env_id, rows$seed)
only <- strsplit(option("only", paste(names(learn_jobs), collapse = ",")), ",")[[1L]]

todo <- do.call(rbind, lapply(learn_jobs[only], function(job) {
  data.frame(env_id = job$env_id, seed = 1000L + seq_len(job$seeds))
}))
todo <- todo[!key(todo) %in% key(read_rows()), ]
cat(nrow(todo), "trainings left\n")

run_side_by_side(
  "tools/learn/train.R", Map(c, todo$env_id, todo$seed), as.integer(option("processes", "2")),
  function(row, task) {
    all <- rbind(read_rows(), row)
    all <- all[order(match(all$env_id, names(learn_jobs)), all$seed), ]
    utils::write.csv(all, table_file, row.names = FALSE)
    cat(sprintf("%s %d: %.4f, %.0f s\n", row$env_id, row$seed, row$value, row$seconds))
  }
)
