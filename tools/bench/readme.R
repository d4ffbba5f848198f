# The figures in README.md, between its two comments that begin with "bench".

write_readme <- function(rows, run, file = "README.md") {
  lines <- readLines(file, encoding = "UTF-8")
  marks <- grep("^<!-- bench", lines)
  stopifnot(length(marks) == 2L)
  before <- lines[seq_len(marks[1L])]
  after <- lines[marks[2L]:length(lines)]
  writeLines(c(before, readme_lines(rows, run), after), file, useBytes = TRUE)
}

readme_lines <- function(rows, run) {
  c(cartpole_lines(rows, run), "", episode_lines(rows))
}

cartpole_lines <- function(rows, run) {
  median_of <- function(...) number(stats::median(values_of(rows, ...)))
  names <- c(own[["vector"]], reticulates(rows), "Python")
  sizes <- intersect(c(0, 32, 1024, 8192), rows$num_envs[rows$part %in% c("single", "vector")])
  columns <- lapply(names, function(name) {
    vapply(sizes, function(n) median_of(if (n) "vector" else "single", name, n), "")
  })
  labels <- sub("^reticulate, ", "reticulate in process, ", names)
  labels[c(1L, length(labels))] <- c("gym, over HTTP", "Python in process")
  what <- ifelse(sizes == 0, "single environment", paste(number(sizes), "sub-environments"))
  what <- sub("^8,190", "8,192", sub("^1,020", "1,024", what))
  seconds <- function(name) median_of("search", name, unit = "s")
  c(
    strwrap(sprintf(paste(
      "Env steps of CartPole a second, medians of %.0f turns each in one run of `make bench` on %s",
      "noisy cores (%s, R %s, Python %s, Gymnasium %s, reticulate %s):"
    ), max(rows$turn[rows$part == "vector"]), run[["cores"]], run[["date"]], run[["R"]],
    run[["Python"]], run[["gymnasium"]], sub(" on .*", "", run[["reticulate"]])), 95),
    "",
    markdown(stats::setNames(c(list(what), columns), c("CartPole-v1", labels)), right = labels),
    "",
    strwrap(sprintf(paste(
      "The pattern of the classic client (httr for each call, Flask's development server) takes",
      "%s steps a second. Fifty rounds of random search take %s s; the tutorial's own way took",
      "%s s in the same run."
    ), median_of("single", "classic pattern"), seconds(own[["search"]]),
    seconds("the tutorial's way")), 95)
  )
}

episode_lines <- function(rows) {
  lines <- Filter(function(line) !grepl("candidates", line$label), rollout_lines(rows))
  ratio <- function(values) number(if (length(values)) stats::median(values) else NA)
  columns <- list(
    environment = vapply(lines, function(line) line$label, ""),
    `gym, rollout()` = vapply(lines, function(line) ratio(line$gym), ""),
    `reticulate in process` = vapply(lines, function(line) ratio(line$reticulate), "")
  )
  c(
    "![Steps a second against Python's own loop](vignettes/bench-environments.png)",
    "",
    strwrap(paste(
      "Whole episodes by `rollout()` with the environment's id and a linear policy (in FrozenLake,",
      "Taxi and Blackjack a random one), on two cores: how many times as many steps a second as",
      "Python's own loop over one environment, which uses one core. With reticulate it is the",
      "faster NumPy:"
    ), 95),
    "",
    markdown(columns, right = names(columns)[-1L])
  )
}
