# The bench's table, as Markdown that also reads well on a terminal.

number <- function(x) {
  ifelse(is.na(x), "", trimws(formatC(signif(x, 3), format = "fg", big.mark = ",", digits = 3)))
}

what_text <- function(summary) {
  plural <- ifelse(summary$num_envs == 1, "", "s")
  words <- c(
    single = "single", wire = "single", search = "random search", fresh = "search in a fresh R",
    memory = "memory", candidates = "candidates of a search", beside = "rollouts"
  )
  text <- ifelse(
    summary$num_envs > 0, sprintf("%.0f sub-environment%s", summary$num_envs, plural),
    words[summary$part]
  )
  by_id <- c("env_rollouts", "gradients", "tables", "data", "stream")
  ifelse(summary$part %in% by_id, summary$env_id, text)
}

# The parts of a run. Each group has its own table.
table_groups <- list(
  CartPole = c("single", "vector", "r_env", "search", "fresh", "memory"),
  environments = c("env_rollouts", "candidates", "beside"),
  step = "wire",
  gradients = "gradients",
  tables = "tables",
  data = "data",
  stream = "stream"
)

# A table for each group that was measured, with an empty line after it.
all_tables <- function(rows) {
  unlist(lapply(table_groups, function(parts) {
    measured <- rows[rows$part %in% parts, ]
    if (nrow(measured)) c(table_lines(measured), "")
  }), use.names = FALSE)
}

table_lines <- function(rows) {
  summary <- summarise(rows)
  range <- ifelse(summary$turns > 1, paste(number(summary$low), "to", number(summary$high)), "")
  markdown(list(
    what = what_text(summary), contender = calls_as_code(summary$contender),
    median = number(summary$median), range = range, unit = summary$unit,
    `gym is ... times as fast` = number(summary$ratio), called = code(summary$called)
  ), right = c("median", "range", "gym is ... times as fast"))
}

goal_lines <- function(rows) {
  goals <- check_goals(rows)
  if (is.null(goals)) {
    return("No goals are held against these parts.")
  }
  markdown(list(
    goal = calls_as_code(goals$goal), measured = number(goals$measured),
    reached = ifelse(goals$reached, "reached", "NOT reached")
  ), right = "measured")
}

# Markdown would read text between two dollar signs as mathematics.
calls_as_code <- function(text) gsub("([a-z_]+[$]?[a-z_]*\\(\\))", "`\\1`", text)

code <- function(text) ifelse(nzchar(text), paste0("`", text, "`"), "")

markdown <- function(columns, right) {
  cells <- Map(function(name, column) {
    format(c(name, column), justify = if (name %in% right) "right" else "left")
  }, names(columns), columns)
  rule <- Map(function(name, column) {
    dashes <- strrep("-", nchar(column[[1L]]) + 1L)
    if (name %in% right) paste0(dashes, ":") else paste0(":", dashes)
  }, names(columns), cells)
  line <- function(cells) paste0("|", paste(cells, collapse = "|"), "|")
  rows <- do.call(Map, c(list(function(...) line(paste0(" ", c(...), " "))), unname(cells)))
  c(rows[[1L]], line(unlist(rule)), unlist(rows[-1L], use.names = FALSE))
}

run_lines <- function(run) {
  strwrap(paste0(paste(names(run), run, collapse = "; "), "."), 100)
}
