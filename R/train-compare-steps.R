# Compares trainings that stop at a target by the steps that they needed.

compare_by_steps <- function(trainings, level) {
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
  key <- paste(runs$training, runs$env_id, sep = "\r")
  each <- lapply(split(runs, factor(key, unique(key))), function(own) {
    curve <- kaplan_meier(own$steps, own$reached, !own$reached & !own$interrupted, level)
    first_under <- function(values) curve$steps[which(values <= 0.5)[1L]]
    list(
      table = data.frame(
        training = own$training[[1L]], env_id = own$env_id[[1L]], runs = nrow(own),
        reached = sum(own$reached), median = first_under(curve$survival),
        lower = first_under(curve$lower), upper = first_under(curve$upper)
      ),
      profile = data.frame(
        training = own$training[[1L]], env_id = own$env_id[[1L]], steps = curve$steps,
        share = 1 - curve$survival, lower = 1 - curve$upper, upper = 1 - curve$lower
      )
    )
  })
  bind <- function(name) do.call(rbind, unname(lapply(each, `[[`, name)))
  list(by = "steps", table = bind("table"), runs = runs, profile = bind("profile"))
}

#' Estimate the share that has not reached the target after so many steps
#' @param failed Which runs will never reach it, however many steps they get.
#' @return A data frame with a row for 0 steps and for each number at which a run ended: `steps`,
#'   `survival`, and the interval `lower` and `upper`, `NA` if all or none are left.
#' @noRd
kaplan_meier <- function(steps, reached, failed, level) {
  at <- sort(unique(steps))
  left <- vapply(at, function(t) sum(steps >= t | failed), 0)
  ended <- vapply(at, function(t) sum(reached & steps == t), 0)
  survival <- cumprod(1 - ended / left)
  variance <- cumsum(ended / (left * (left - ended)))
  half <- stats::qnorm((1 + level) / 2) * sqrt(variance) / log(survival)
  inside <- survival > 0 & survival < 1
  bound <- function(side) c(NA, ifelse(inside, survival^exp(side * half), NA))
  # log(survival) is below 0.
  data.frame(steps = c(0, at), survival = c(1, survival), lower = bound(-1), upper = bound(1))
}
