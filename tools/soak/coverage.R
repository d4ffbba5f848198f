# Measures how often intervals of evaluate_offline() cover the exact value, and the errors of its
# estimates.
#
#   Rscript tools/soak/coverage.R [DATASETS [SECONDS]]
#
# Draws data sets of 200 episodes from a model whose values solve_mdp() computes, as many as
# requested, or as the time allows. Prints the table of vignettes/which-treatment.Rmd. A * marks
# rows whose intervals should cover by theory. In 99 of 100 studies, all of their shares would lie
# in a certain interval. The script fails if one lies outside of it.

library(gym)
arguments <- as.numeric(commandArgs(TRUE))
asked <- c(arguments, 2000)[[1L]]
until <- Sys.time() + c(arguments[-1L], 7200)[[1L]]
episodes <- 200L
discount <- 0.9

source("tests/testthat/helper-small-model.R")
model <- small_model()

# A single rollout plays the episodes of all data sets.
played <- rollout(
  model, policy_table(log(behaves), temperature = 1), episodes = asked * episodes, seed = 1,
  steps = TRUE
)$steps
data <- split(played, (played$episode - 1L) %/% episodes)

weighted <- c("is", "wis", "pdis", "dr", "wdr")
wrong <- "5 steps, wrong regression"
# Each replicate fits a model, which is slow, so there are fewer replicates.
settings <- list(
  list("to the end", method = "fqe", replicates = 200, expected = "fqe"),
  list("to the end", method = weighted, expected = c("dr", "wdr")),
  list("5 steps", method = "fqe", horizon = 5, replicates = 200, expected = "fqe"),
  list("5 steps", method = weighted, horizon = 5, expected = c("dr", "wdr")),
  list(wrong, method = "fqe", horizon = 5, formula = ~ action, replicates = 50),
  list(wrong, method = c("dr", "wdr"), horizon = 5, formula = ~ action,
       expected = c("dr", "wdr")),
  list("5 steps, estimated behavior", method = c("is", "wis", "dr", "wdr"), horizon = 5,
       behavior = NULL, replicates = 100, expected = c("dr", "wdr")),
  list("5 steps, t", method = c("is", "pdis", "dr"), horizon = 5, interval = "t", expected = "dr")
)

exact_values <- vapply(settings, function(setting) {
  solve_mdp(model, wanted, discount = discount, horizon = setting$horizon)$start_value
}, 0)

estimate <- function(setting, exact, steps, seed) {
  given <- utils::modifyList(
    list(behavior = by_table(behaves), replicates = 400),
    setting[setdiff(names(setting), c("", "expected"))], keep.null = TRUE
  )
  found <- suppressWarnings(do.call(evaluate_offline, c(
    list(steps, by_table(wanted), discount = discount, seed = seed), given
  )))$estimates
  data.frame(setting = setting[[1L]], found, exact = exact,
             expected = found$method %in% setting$expected)
}

found <- list()
for (set in seq_along(data)) {
  if (Sys.time() > until) break
  steps <- steps_data(data[[set]])
  found[[set]] <- do.call(rbind, Map(estimate, settings, exact_values, list(steps), set))
}
sets <- length(found)
found <- do.call(rbind, found)

rows <- lapply(split(found, ~ method + setting, drop = TRUE), function(x) {
  data.frame(
    x[1L, c("setting", "method", "exact", "expected")], bias = mean(x$estimate - x$exact),
    sd = stats::sd(x$estimate), se = mean(x$se),
    below = mean(x$upper < x$exact), above = mean(x$lower > x$exact)
  )
})
table <- do.call(rbind, rows)
table <- table[order(match(table$setting, found$setting), match(table$method, found$method)), ]
table$covered <- 1 - table$below - table$above
# For all these rows together.
cells <- sum(table$expected)
ends <- stats::qbinom(c(0.005 / cells, 1 - 0.005 / cells), sets, 0.95) / sets
outside <- table[table$expected & (table$covered < ends[[1L]] | table$covered > ends[[2L]]), ]

fixed <- function(x, digits) formatC(x, format = "f", digits = digits)
cat(
  "| setting | method | exact | bias | sd | mean `se` | below | above | covered |",
  "|:---|:---|---:|---:|---:|---:|---:|---:|---:|",
  with(table, paste(
    "|", setting, "|", paste0(method, ifelse(expected, "*", "")), "|", fixed(exact, 3), "|",
    fixed(bias, 3), "±", fixed(sd / sqrt(sets), 3), "|", fixed(sd, 3), "|", fixed(se, 3), "|",
    fixed(below, 3), "|", fixed(above, 3), "|", fixed(covered, 3), "±",
    fixed(sqrt(covered * (1 - covered) / sets), 3), "|"
  )),
  sprintf(
    "coverage: %d data sets, %d of %d rows between %.3f and %.3f%s", sets, cells - nrow(outside),
    cells, ends[[1L]], ends[[2L]],
    if (nrow(outside)) paste0("; not ", toString(paste(outside$setting, outside$method))) else ""
  ),
  sep = "\n"
)
quit(status = as.integer(nrow(outside) > 0L))
