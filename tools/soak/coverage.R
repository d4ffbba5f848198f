# How often intervals of evaluate_offline() cover the exact value, and how far estimates are off.
#
#   Rscript tools/soak/coverage.R DATASETS [REPLICATES [FOLDER]]
#
# Data sets of 200 episodes are drawn from a model whose values solve_mdp() knows. A row of the
# table is a method in a setting. `expected` marks rows whose theory says that the interval covers:
# it fails if one of these lies outside of the interval in which the shares of all of them would lie
# in 99 of 100 studies. FOLDER gets coverage.csv, the table.

library(gym)
arguments <- commandArgs(TRUE)
sets <- as.integer(c(arguments, "2000")[[1L]])
replicates <- if (length(arguments) > 1L) as.integer(arguments[[2L]]) else 400L
episodes <- 200L
discount <- 0.9

source("tests/testthat/helper-small-model.R")
model <- small_model()

# One rollout plays the episodes of all data sets.
played <- rollout(
  model, policy_table(log(behaves), temperature = 1), episodes = sets * episodes, seed = 1,
  steps = TRUE
)$steps
set <- (played$episode - 1L) %/% episodes + 1L
data <- lapply(split(played, set), steps_data)

all <- c("fqe", "is", "wis", "pdis", "dr", "wdr")
settings <- list(
  `to the end` = list(expected = c("fqe", "dr", "wdr")),
  `5 steps` = list(horizon = 5, expected = c("fqe", "dr", "wdr")),
  `5 steps, wrong regression` = list(
    horizon = 5, formula = ~ action, expected = c("dr", "wdr")
  ),
  `5 steps, estimated behavior` = list(
    horizon = 5, behavior = NULL, expected = c("dr", "wdr"), method = c("is", "wis", "dr", "wdr"),
    replicates = min(replicates, 200L)
  ),
  `5 steps, t` = list(
    horizon = 5, interval = "t", method = c("is", "pdis", "dr"), expected = "dr"
  )
)

study <- function(name) {
  setting <- settings[[name]]
  exact <- solve_mdp(model, wanted, discount = discount, horizon = setting$horizon)$start_value
  given <- utils::modifyList(
    list(behavior = by_table(behaves), method = all, replicates = replicates),
    setting[setdiff(names(setting), "expected")], keep.null = TRUE
  )
  found <- lapply(seq_along(data), function(i) {
    suppressWarnings(do.call(evaluate_offline, c(
      list(data[[i]], by_table(wanted), discount = discount, seed = i), given
    )))$estimates
  })
  found <- do.call(rbind, found)
  rows <- lapply(split(found, factor(found$method, all)), function(x) {
    if (!nrow(x)) return(NULL)
    data.frame(
      setting = name, method = x$method[[1L]], exact = exact, bias = mean(x$estimate) - exact,
      bias_se = stats::sd(x$estimate) / sqrt(sets), sd = stats::sd(x$estimate),
      mean_se = mean(x$se), covered = mean(x$lower <= exact & exact <= x$upper),
      expected = x$method[[1L]] %in% setting$expected
    )
  })
  do.call(rbind, rows)
}

table <- do.call(rbind, lapply(names(settings), study))
cells <- sum(table$expected)
# For all these rows together.
ends <- stats::qbinom(c(0.005 / cells, 1 - 0.005 / cells), sets, 0.95) / sets
table$inside <- table$covered >= ends[[1L]] & table$covered <= ends[[2L]]
row.names(table) <- NULL
print(data.frame(
  lapply(table, function(x) if (is.numeric(x)) signif(x, 3L) else x), check.names = FALSE
), row.names = FALSE)
if (length(arguments) > 2L) {
  utils::write.csv(table, file.path(arguments[[3L]], "coverage.csv"), row.names = FALSE)
}
outside <- table[table$expected & !table$inside, ]
cat(sprintf(
  "coverage: %d data sets, %d of %d rows between %.3f and %.3f%s\n", sets,
  cells - nrow(outside), cells, ends[[1L]], ends[[2L]],
  if (nrow(outside)) paste0("; not ", toString(paste(outside$setting, outside$method))) else ""
))
quit(status = as.integer(nrow(outside) > 0L))
