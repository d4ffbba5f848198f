# Many settings of an agent, each with several seeds.

#' Try settings of an agent
#'
#' Train each setting with each seed, on the workers of the plan ([workers]) if there is one, and
#' compare the settings as in [compare_trainings()]. A run that fails does not stop the others.
#'
#' The best of many settings was also lucky, and more so the more settings you try. So its results
#' with `seeds` are too good. With `report_seeds`, which must be other seeds, it is trained once
#' more. Report those results.
#'
#' The best setting is the one with the highest interquartile mean. If trainings stop at a target,
#' it is the setting with which most runs reached the target. If several have the same number, the
#' smallest median of steps decides. There is no best setting if no run reached the target, or if
#' several settings are equal.
#'
#' If the environment has a preset for `agent` ([agent_presets()]), the sweep starts from the
#' preset, as [learn_ppo()] and the like do, and `settings` replace its values. A message says so.
#'
#' With `folder` each run is kept in a file. After an interrupt, a crash or an error, the same call
#' resumes with the missing runs. You may add settings to this call.
#'
#' @param agent The function that makes the agent, such as [agent_ars], without parentheses, or your
#'   own.
#' @param env The environment, as for [train_agent()].
#' @param settings A data frame with a row for each setting, such as the result of [expand.grid()],
#'   with the arguments of `agent` as columns.
#' @param seeds The seeds for tuning, different whole numbers.
#' @param report_seeds `NULL`, the default, or the seeds with which the best setting is trained once
#'   more, all different from `seeds`.
#' @param ... Further arguments of [train_agent()], such as `total_steps` (a single budget) or
#'   `target`, and of the environment. For `plot()` and `autoplot()` none.
#' @param folder `NULL`, the default, or the folder for the runs, which is created if it does not
#'   exist.
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client As for [train_agent()].
#' @param x A sweep.
#' @param row.names,optional Not used.
#' @param main The title of the picture. `NULL`, the default, names the environment.
#' @param xlab,ylab,xlim,ylim,guide As for [plot.gym_rollout()].
#' @return An object of class `gym_sweep`, a list with the elements
#'   \describe{
#'     \item{settings}{The settings, with a column `setting`, their names.}
#'     \item{trainings}{A list with the [gym_trainings] of each setting, `NULL` if no run finished.}
#'     \item{runs}{A data frame with a row for each run: `setting`, `seed` and `error` (the message,
#'       or `NA`).}
#'     \item{comparison}{The result of [compare_trainings()] for the settings, `NULL` if none was
#'       trained.}
#'     \item{best}{The name of the best setting, or `NULL`.}
#'     \item{reported}{Its [gym_trainings] with `report_seeds`, or `NULL`.}
#'     \item{seeds, report_seeds}{As given.}
#'     \item{interrupted}{Whether it was interrupted, a logical.}
#'   }
#'   `as.data.frame()` returns the settings with the columns of the comparison's table, and `error`.
#'   `plot()` draws the learning curves of all settings, a panel for each.
#' @section Errors: `gym_error_argument` for an invalid argument. `gym_error_checkpoint` if the
#'   folder has the runs of another sweep.
#' @export
#' @examplesIf gym:::can_start_server()
#' sweep <- sweep_agent(
#'   agent_ars, "CartPole-v1", expand.grid(step_size = c(0.02, 0.1), noise = c(0.05, 0.1)),
#'   seeds = 1:5, report_seeds = 1001:1005, total_steps = 1000, target = Inf, eval_episodes = 10
#' )
#' sweep
#' plot(sweep)
sweep_agent <- function(agent, env, settings, seeds, report_seeds = NULL, ..., folder = NULL,
                        progress = rlang::is_interactive(), client = gym_client()) {
  match_whole_names()
  call <- rlang::current_env()
  check_sweep(agent, settings, seeds, report_seeds, folder, call)
  settings <- as.data.frame(settings)
  texts <- vapply(seq_len(nrow(settings)), function(row) {
    values <- vapply(settings[row, , drop = FALSE], function(x) {
      x <- x[[1L]]
      if (length(x) == 1L && is.atomic(x)) format(x) else substr(rlang::hash(x), 1L, 8L)
    }, "")
    paste(names(settings), "=", values, collapse = ", ")
  }, "")
  settings$setting <- make.unique(texts, " ")
  dots <- list(...)
  place <- "give it as a column of `settings`, as in `data.frame(%s = )`"
  check_not_of_agent(names(dots), names(formals(agent)), place, call)
  of_training <- names(formals(train_agent))
  kwargs <- dots[setdiff(names(dots), of_training)]
  check_spelling(names(kwargs), of_training, any(of_budget %in% names(dots)), call)
  # The preset that the agent's own trainer, such as learn_ppo(), would use.
  kind <- Filter(function(kind) identical(agent, get(paste0("agent_", kind))),
                 unique(read_presets()$agent))
  preset <- if (length(kind)) find_preset(kind, env, kwargs)
  if (!is.null(preset)) inform_of_preset(preset, env)
  agents <- lapply(seq_len(nrow(settings)), function(row) {
    arguments <- lapply(settings[row, names(settings) != "setting", drop = FALSE], `[[`, 1L)
    own <- replace_arguments(preset_arguments(preset), arguments)
    tryCatch(
      with_preset(rlang::exec(agent, !!!own), preset, c(names(arguments), names(dots))),
      error = identity
    )
  })
  names(agents) <- settings$setting
  failed <- vapply(agents, inherits, NA, "condition")
  if (all(failed)) rlang::cnd_signal(agents[[1L]])
  if (!is.null(folder)) dir.create(folder, showWarnings = FALSE, recursive = TRUE)
  train <- function(agents, seeds) {
    training <- dots[setdiff(names(dots), names(kwargs))]
    training$seeds <- plain_numbers(seeds)
    sweep_runs(agents, env, training, kwargs, preset, folder, progress, client, call)
  }
  tuned <- train(agents[!failed], seeds)
  runs <- rbind(tuned$runs, data.frame(
    setting = rep(names(agents)[failed], each = length(seeds)), seed = rep(seeds, sum(failed)),
    error = rep(vapply(agents[failed], conditionMessage, ""), each = length(seeds))
  ))
  done <- Filter(Negate(is.null), tuned$trainings)
  comparison <- if (length(done)) rlang::exec(compare_trainings, !!!done, seed = 1)
  best <- if (!is.null(comparison)) best_settings(comparison)
  # If settings tie, report no best one.
  if (length(best) != 1L) best <- NULL
  reported <- if (!is.null(report_seeds) && !is.null(best) && !tuned$interrupted) {
    train(agents[best], report_seeds)
  }
  structure(
    list(
      settings = settings, trainings = tuned$trainings[settings$setting],
      runs = rbind(runs, reported$runs), comparison = comparison, best = best,
      reported = reported$trainings[[1L]], seeds = seeds, report_seeds = report_seeds,
      interrupted = tuned$interrupted || isTRUE(reported$interrupted)
    ),
    class = "gym_sweep"
  )
}

check_sweep <- function(agent, settings, seeds, report_seeds, folder, call) {
  if (!is.function(agent)) {
    must <- "the function that makes the agent, such as `agent_ars` without parentheses"
    abort_argument(agent, must, "agent", call)
  }
  abort_if(
    "env" %in% names(formals(agent)), "agent", agent, call,
    "`agent` must be the function that makes the agent, not one that trains it.",
    i = "Give `agent_ars` instead of `search_ars`, `agent_ppo` instead of `learn_ppo`."
  )
  check_given(settings, "`expand.grid(step_size = c(0.02, 0.1))` has a row for each.", call = call)
  if (!is.data.frame(settings) || !nrow(settings) || !length(settings)) {
    abort_argument(settings, "a data frame with a row for each setting", "settings", call)
  }
  known <- names(formals(agent))
  unknown <- setdiff(names(settings), known)
  abort_if(
    length(unknown) && !"..." %in% known, "settings", unknown, call,
    "The agent has no argument `{unknown[[1L]]}`, a column of `settings`.",
    i = did_you_mean(unknown[[1L]], known), i = "It has {quoted_names(known)}."
  )
  check_given(seeds, "They are the seeds for tuning, such as `1:10`.", call = call)
  check_seeds(seeds, call)
  check_string(folder, allow_null = TRUE, arg = "folder", call = call)
  if (!is.null(report_seeds)) {
    check_seeds(report_seeds, call)
    both <- intersect(seeds, report_seeds)
    abort_if(
      length(both), "report_seeds", report_seeds, call,
      "Seed {both[[1L]]} is one of `seeds` and of `report_seeds`.",
      i = "Report seeds that were not used to choose the setting."
    )
  }
}

#' Train agents with several seeds, all at once
#' @param agents A list of agents with the names of their settings.
#' @return A list: `trainings`, those of each agent, `runs`, a table, and `interrupted`.
#' @noRd
sweep_runs <- function(agents, env, training, kwargs, preset, folder, progress, client, call) {
  started <- now()
  jobs <- lapply(names(agents), function(name) {
    own <- complete_arguments(agents[[name]], env, training, preset)
    if (!is.null(folder)) {
      own$checkpoint <- file.path(folder, paste0(gsub("[^A-Za-z0-9.=-]+", "_", name), ".rds"))
    }
    training_settings(own, kwargs, client, call)
  })
  runs <- unlist(lapply(seq_along(jobs), function(at) {
    lapply(training$seeds, function(seed) {
      run <- settings_of_seed(jobs[[at]], seed, call)
      c(run, list(job = at, keeps_error = TRUE))
    })
  }), recursive = FALSE)
  show <- progress_bar(length(runs), "Run", shown = progress)
  results <- list()
  keep <- function(result) {
    results[[length(results) + 1L]] <<- result
    show(length(results))
  }
  train_here <- function() {
    for (run in runs) {
      in_env <- function(play) with_training_env(run, play, client, call)
      result <- train_seed(run, in_env, client, call)
      if (isTRUE(result$interrupted)) rlang::interrupt()
      keep(result)
    }
  }
  train_all <- function(vector_env) {
    workers <- seeds_go_to_workers(vector_env, jobs[[1L]])
    if (workers) train_in_futures(vector_env, runs, keep, call)
    workers
  }
  interrupted <- until_interrupted(
    if (plan_kind() == "none" || !with_training_env(jobs[[1L]], train_all, client, call)) {
      train_here()
    },
    "Interrupted after {finished} of {total} run{?s}; what was finished is returned.",
    function() length(results), length(runs)
  )
  elapsed <- now() - started
  runs <- runs[seq_along(results)]
  job <- vapply(runs, `[[`, 0L, "job")
  errors <- vapply(results, function(result) {
    if (inherits(result, "condition")) conditionMessage(result) else NA_character_
  }, "")
  trainings <- lapply(seq_along(jobs), function(at) {
    whole <- results[job == at & is.na(errors)]
    if (length(whole)) new_trainings(whole, jobs[[at]], elapsed, interrupted)
  })
  list(
    trainings = stats::setNames(trainings, names(agents)), interrupted = interrupted,
    runs = data.frame(
      setting = names(agents)[job], error = errors,
      seed = vapply(runs, function(run) as.numeric(run$seed), 0)
    )[c("setting", "seed", "error")]
  )
}

# The names of the best settings: several if they are equal, none if no run reached the target.
best_settings <- function(comparison) {
  table <- comparison$table
  if (comparison$by == "scores") {
    table <- table[table$statistic == "iqm", ]
    return(table$training[which(table$value == max(table$value, -Inf, na.rm = TRUE))])
  }
  # If fewer than half of the runs have reached the target, the median is NA.
  median <- ifelse(is.na(table$median), Inf, table$median)
  share <- table$reached / table$runs
  first <- order(-share, median)[[1L]]
  best <- share == share[[first]] & median == median[[first]]
  table$training[best & table$reached > 0L]
}

no_best_text <- function(comparison) {
  equal <- if (!is.null(comparison)) best_settings(comparison)
  if (is.null(comparison)) {
    "none, no run was finished"
  } else if (length(equal)) {
    paste0("none, equal are ", paste(equal, collapse = "; "), ". More `seeds` may tell")
  } else {
    "none, no run reached the target"
  }
}

#' @rdname sweep_agent
#' @export
as.data.frame.gym_sweep <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_no_curve(...)
  settings <- x$settings
  tuning <- x$runs[x$runs$seed %in% x$seeds & !is.na(x$runs$error), ]
  settings$error <- tuning$error[match(settings$setting, tuning$setting)]
  table <- x$comparison$table
  if (is.null(table)) {
    return(settings)
  }
  merged <- merge(settings, table, by.x = "setting", by.y = "training", all.x = TRUE, sort = FALSE)
  merged <- merged[order(match(merged$setting, settings$setting)), ]
  row.names(merged) <- NULL
  columns <- c("setting", setdiff(names(x$settings), "setting"), setdiff(names(table), "training"))
  merged[c(columns, "error")]
}

#' @export
print.gym_sweep <- function(x, ...) {
  failed <- x$runs[!is.na(x$runs$error), ]
  print_lines(x, c(
    paste0("Sweep of ", count_of(nrow(x$settings), "setting"),
           if (x$interrupted) ", interrupted: with a `folder` the same call goes on"),
    paste0("Tuning seeds: ", numbers_text(x$seeds),
           if (!is.null(x$best)) ", which chose the setting"),
    if (!is.null(x$comparison)) comparison_lines(x$comparison, pairs = FALSE),
    if (nrow(failed)) {
      paste0(count_of(nrow(failed), "run"), " failed, the first, ", failed$setting[[1L]], ": ",
             sub("\n.*", "", failed$error[[1L]]))
    },
    paste0("Best: ", x$best %||% no_best_text(x$comparison)),
    if (!is.null(x$reported)) {
      c(paste0("Reporting seeds: ", numbers_text(x$report_seeds), ", which chose nothing"),
        paste0("  ", trainings_lines(x$reported)[-(1:2)]))
    } else if (!is.null(x$best)) {
      "No reporting seeds: for the best setting these figures are too good, see `report_seeds`"
    }
  ))
}

# "1 to 5" for seeds in a row, otherwise all of them.
numbers_text <- function(x) {
  row <- length(x) > 2L && all(diff(x) == 1)
  if (row) paste(x[[1L]], "to", x[[length(x)]]) else paste(x, collapse = ", ")
}
