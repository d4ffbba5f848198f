# Compares trainings that stop at a target by the steps that they needed.

compare_by_steps <- function(trainings, level, call) {
  runs <- do.call(rbind, unname(Map(function(x, label) {
    ones <- each_training(x)
    of_each <- function(f, type) vapply(ones, f, type)
    data.frame(
      training = label, env_id = of_each(function(one) one$env_id, ""),
      seed = of_each(function(one) as.numeric(one$seed), 0),
      steps = of_each(function(one) as.numeric(one$steps), 0),
      reached = of_each(function(one) isTRUE(one$solved), NA),
      interrupted = of_each(function(one) one$interrupted, NA)
    )
  }, trainings, names(trainings))))
  notes <- if (any(runs$interrupted)) interrupted_note(sum(runs$interrupted))
  runs <- runs[!runs$interrupted, names(runs) != "interrupted"]
  if (!nrow(runs)) {
    gym_abort("There is nothing to compare: all runs were interrupted.",
              class = "gym_error_argument", argument = "...", call = call)
  }
  key <- paste(runs$training, runs$env_id, sep = "\r")
  profiles <- lapply(split(runs, factor(key, unique(key))), reached_profile, level)
  list(
    by = "steps", table = do.call(rbind, unname(lapply(profiles, attr, "summary"))), runs = runs,
    profile = do.call(rbind, unname(profiles)), notes = notes
  )
}

interrupted_note <- function(count) paste(count_of(count, "interrupted run"), "left out")

#' Compute the share of runs that have reached the target after so many steps
#' @param runs The runs of one training in one environment.
#' @return A data frame with a row for 0 steps and for each number at which a run ended: `training`,
#'   `env_id`, `steps`, `share`, `lower`, `upper`. Its attribute `summary` is the row of the table.
#' @noRd
reached_profile <- function(runs, level) {
  steps <- c(0, sort(unique(runs$steps)))
  reached <- vapply(steps, function(most) sum(runs$reached & runs$steps <= most), 0L)
  interval <- vapply(reached, wilson_interval, numeric(2), nrow(runs), level)
  first_half <- function(shares) steps[which(shares >= 0.5)[1L]]
  own <- runs[1L, c("training", "env_id")]
  profile <- data.frame(
    own, steps = steps, share = reached / nrow(runs), lower = interval[1L, ],
    upper = interval[2L, ], row.names = NULL
  )
  structure(profile, summary = data.frame(
    own, runs = nrow(runs), reached = sum(runs$reached), median = first_half(profile$share),
    lower = first_half(profile$upper), upper = first_half(profile$lower), row.names = NULL
  ))
}
