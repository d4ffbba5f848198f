# The rows of README.md's short table, between its lines <!-- solved -->, from solve-table.csv.gz.

write_readme_rows <- function(table_file = "inst/extdata/solve-table.csv.gz") {
  table <- utils::read.csv(table_file, colClasses = c(kwargs = "character"))
  task <- job_key(table)
  rows <- vapply(split(table, factor(task, job_key(solve_jobs)), drop = TRUE), function(rows) {
    # The last choice of settings; see jobs.R.
    choice <- rows$seed %/% 1000L
    rows <- rows[choice == max(choice), ]
    count <- nrow(rows)
    reached <- if (count > 1L) {
      paste(sum(rows$reached), "of", count, "seeds")
    } else {
      one <- if (rows$reached) "a demonstration:" else "one seed, not reached:"
      paste(one, round(rows$mean_return))
    }
    steps <- format(round(stats::median(rows$steps), -3), big.mark = ",", scientific = FALSE)
    kwargs <- rows$kwargs[[1L]]
    name <- paste0(rows$env_id[[1L]], if (nzchar(kwargs)) paste0(", ", kwargs))
    agent <- toupper(rows$method[[1L]])
    paste("|", name, "|", agent, "|", rows$target[[1L]], "|", reached, "|", steps, "|")
  }, "")
  lines <- readLines("README.md")
  marks <- which(lines == "<!-- solved -->")
  head <- c("| environment | agent | target | reached | steps, median |", "|---|---|---|---|---|")
  writeLines(
    c(lines[seq_len(marks[[1L]])], head, unname(rows), lines[marks[[2L]]:length(lines)]),
    "README.md"
  )
}
