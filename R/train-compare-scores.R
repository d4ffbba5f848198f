# Compares scores at a common budget, like Agarwal et al. (2021).

compare_by_scores <- function(trainings, curves, settings, reference, call) {
  if (is.null(curves$env_id)) curves$env_id <- NA_character_
  found <- run_scores(trainings, curves, settings$total_steps, call)
  runs <- found$runs
  ids <- unique(runs$env_id)
  of_each <- lapply(split(runs$env_id, runs$training), function(ids) {
    sort(unique(ids), na.last = TRUE)
  })
  abort_if(
    length(unique(of_each)) > 1L,
    "...", NULL, call, "All agents must have been trained in the same environments.",
    x = '{paste0(names(of_each), ": ", vapply(of_each, toString, ""), collapse = "; ")}'
  )
  if (is.null(reference) && length(ids) > 1L) reference <- default_reference(trainings, call)
  if (!is.null(reference)) {
    at <- match(runs$env_id, reference$env_id)
    span <- reference$high[at] - reference$low[at]
    wrong <- runs$env_id[is.na(at) | !is.finite(span) | span == 0]
    abort_if(
      length(wrong), "reference", reference, call,
      "`reference` must have a row for {wrong[[1L]]} with two different numbers."
    )
    runs$score <- (runs$score - reference$low[at]) / span
  }
  scores <- lapply(split_in_order(runs, runs$training), function(own) {
    split(own$score, factor(own$env_id, ids, exclude = NULL))
  })
  generator <- new_generator(settings$seed)
  drawn <- with_generator(generator, lapply(scores, bootstrap_scores, settings$reps))
  list(
    by = "scores", table = score_table(scores, drawn, settings$level), runs = runs,
    improvement = improvement_table(scores, drawn, settings$level),
    profile = profile_table(scores, drawn, settings$level), reference = reference,
    notes = found$notes, total_steps = found$steps, by_end = found$by_end
  )
}

#' Find the score of each run
#'
#' If all runs have the same budget in steps, the score is the last evaluation. Otherwise it is
#' interpolated linearly on the learning curve.
#' @return A list: `runs`, `steps`, `by_end`, and `notes`, which say how scores were found.
#' @noRd
run_scores <- function(trainings, curves, steps, call) {
  cut_short <- unlist(Map(function(x, label) {
    ended <- Filter(function(one) isTRUE(one$interrupted), each_training(x))
    vapply(ended, function(one) paste(label, one$env_id, one$seed), "")
  }, trainings, names(trainings)))
  curves <- curves[!paste(curves$training, curves$env_id, curves$seed) %in% cut_short, ]
  of_run <- split_in_order(curves, curves$training, curves$env_id, curves$seed)
  if (!length(of_run)) {
    abort_wrong("...", NULL, call, "There is nothing to compare: no policy was evaluated.")
  }
  ends <- vapply(of_run, function(run) max(run$steps), 0)
  budgets <- unique(unlist(lapply(trainings, function(x) {
    lapply(each_training(x), function(one) one$rules$total_steps %||% NA)
  })))
  same <- if (length(trainings)) {
    length(budgets) == 1L && !anyNA(budgets)
  } else {
    length(unique(ends)) == 1L
  }
  by_end <- is.null(steps) && same
  at <- steps %||% if (same && length(trainings)) budgets else min(ends)
  abort_if(
    at > min(ends),
    "total_steps", at, call, "Not all runs have taken {whole_number_text(at)} steps.",
    i = "The shortest ended after {whole_number_text(min(ends))}."
  )
  score <- vapply(of_run, function(run) {
    returns_at(run, if (by_end) max(run$steps) else at)
  }, 0)
  runs <- do.call(rbind, lapply(of_run, function(run) run[1L, c("training", "env_id", "seed")]))
  list(
    runs = data.frame(runs, steps = unname(ends), score = unname(score), row.names = NULL),
    steps = at, by_end = by_end,
    notes = c(
      if (!by_end) paste("scores are those of the learning curves after", number_text(at), "steps"),
      if (length(cut_short)) interrupted_note(length(cut_short))
    )
  )
}

# Normalising ---------------------------------------------------------------------------

# Returns the mean return of a random policy and the environment's threshold.
default_reference <- function(trainings, call) {
  abort_if(
    !length(trainings), "reference", NULL, call,
    "Scores of several environments are compared when they are normalised.",
    i = "Give `reference`, a data frame with the columns env_id, low and high."
  )
  ones <- lapply(trainings, function(x) each_training(x)[[1L]])
  ones <- ones[!duplicated(vapply(ones, function(one) one$env_id, ""))]
  do.call(rbind, unname(lapply(ones, function(one) {
    registered <- if (is.character(one$env)) {
      known <- env_registry(search = one$env)
      known$reward_threshold[known$id == one$env]
    } else {
      one$env$spec$reward_threshold
    }
    high <- training_target(NULL, list(id = one$env_id, reward_threshold = registered))
    abort_if(
      !length(high) || is.na(high), "reference", NULL, call,
      "{one$env_id} has no reward threshold, which is needed to normalise scores.",
      i = "Give `reference`, a data frame with the columns env_id, low and high."
    )
    random <- rlang::exec(
      evaluate_policy, one$env, policy_random(), !!!one$kwargs, max_steps = one$max_steps, seed = 1,
      progress = FALSE
    )
    data.frame(env_id = one$env_id, low = random$mean_return, high = as.numeric(high))
  })))
}

# Statistics ----------------------------------------------------------------------------

# Scores are a list with a vector for each environment. Bootstrap samples are a list with a matrix
# for each, with a column for each sample. The scores themselves are such matrices with one column.
score_statistics <- list(
  mean = function(each) Reduce(`+`, lapply(each, colMeans)) / length(each),
  median = function(each) {
    apply(matrix(vapply(each, colMeans, numeric(ncol(each[[1L]]))), ncol = length(each)), 1L,
          stats::median)
  },
  iqm = function(each) apply(do.call(rbind, each), 2L, mean, trim = 0.25)
)

bootstrap_scores <- function(scores, reps) {
  lapply(scores, function(own) {
    matrix(own[sample.int(length(own), length(own) * reps, replace = TRUE)], ncol = reps)
  })
}

as_columns <- function(scores) lapply(scores, as.matrix)

interval_of <- function(values, level) {
  tail <- (1 - level) / 2
  stats::quantile(values, c(tail, 1 - tail), names = FALSE)
}

score_table <- function(scores, drawn, level) {
  do.call(rbind, lapply(names(scores), function(label) {
    # In one environment the median of the environments' means is the mean.
    shown <- setdiff(names(score_statistics), if (length(scores[[label]]) == 1L) "median")
    statistics <- score_statistics[shown]
    interval <- vapply(statistics, function(of) interval_of(of(drawn[[label]]), level), numeric(2))
    data.frame(
      training = label, runs = sum(lengths(scores[[label]])), statistic = shown,
      value = vapply(statistics, function(of) of(as_columns(scores[[label]])), 0),
      lower = interval[1L, ], upper = interval[2L, ], row.names = NULL
    )
  }))
}

# The probability that a run of one training scores higher than a run of the other. Ties count half.
improvement_probability <- function(x, y) {
  each <- Map(function(x, y) {
    wins <- 0
    for (i in seq_len(nrow(x))) {
      for (j in seq_len(nrow(y))) wins <- wins + (x[i, ] > y[j, ]) + (x[i, ] == y[j, ]) / 2
    }
    wins / (nrow(x) * nrow(y))
  }, x, y)
  Reduce(`+`, each) / length(each)
}

improvement_table <- function(scores, drawn, level) {
  labels <- names(scores)
  pairs <- which(outer(seq_along(labels), seq_along(labels), `<`), arr.ind = TRUE)
  do.call(rbind, lapply(seq_len(nrow(pairs)), function(row) {
    x <- labels[[pairs[row, 1L]]]
    y <- labels[[pairs[row, 2L]]]
    interval <- interval_of(improvement_probability(drawn[[x]], drawn[[y]]), level)
    data.frame(
      training = x, than = y,
      probability = improvement_probability(as_columns(scores[[x]]), as_columns(scores[[y]])),
      lower = interval[[1L]], upper = interval[[2L]]
    )
  }))
}

# The number of scores at which a profile is computed.
profile_places <- 101L

profile_table <- function(scores, drawn, level) {
  range <- range(unlist(scores))
  at <- seq(range[[1L]], range[[2L]], length.out = if (diff(range) > 0) profile_places else 1L)
  do.call(rbind, lapply(names(scores), function(label) {
    all <- unlist(scores[[label]])
    all_drawn <- do.call(rbind, drawn[[label]])
    bounds <- vapply(at, function(score) {
      interval_of(colMeans(all_drawn > score), level)
    }, numeric(2))
    data.frame(
      training = label, score = at, share = vapply(at, function(score) mean(all > score), 0),
      lower = bounds[1L, ], upper = bounds[2L, ]
    )
  }))
}
