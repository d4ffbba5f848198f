# One training with each of many seeds.

check_training_seeds <- function(seeds, seed, call) {
  check_seeds(seeds, call)
  if (!is.null(seed)) {
    abort_wrong(
      "seed", seed, call, "`seed` and `seeds` cannot both be given.",
      i = "`seed` makes one training, `seeds` one with each."
    )
  }
}

#' Train with each seed
#'
#' An interrupt ends all trainings. So does an error, which carries the trainings so far; the last
#' of them is the one that failed.
#' @param in_env A function that makes the environment and calls a function with it. All trainings
#'   share one environment, unless it remembers earlier episodes.
#' @param files As for [new_run()].
#' @return As [gym_trainings].
#' @noRd
train_seeds <- function(in_env, settings, seeds, files, progress, client, call) {
  started <- proc.time()[["elapsed"]]
  runs <- lapply(seeds, function(seed) run_of_seed(settings, seed, files, call))
  kept <- sum(!vapply(runs, function(run) is.null(run$file$saved), NA))
  if (kept > 0L) {
    inform_resumed("Going on from the files of {kept} of {length(seeds)} seed{?s}.")
  }
  show <- progress_bar(length(seeds), "Seed", "0 reached the target, ", shown = progress)
  trainings <- list()
  result <- function(interrupted = FALSE) {
    new_trainings(trainings, settings, proc.time()[["elapsed"]] - started, interrupted)
  }
  keep <- function(training) {
    trainings[[length(trainings) + 1L]] <<- training
    reached <- sum(vapply(trainings, function(training) isTRUE(training$solved), NA))
    if (!training$interrupted) {
      show(length(trainings), paste0(reached, " reached the target, "))
    }
  }
  train_all <- function(vector_env) {
    # Without a target, no seed solves a search.
    if (settings$search && is.null(training_target(settings, vector_env$spec))) {
      abort_wrong(
        "target", NULL, call,
        "{environment_label(vector_env)} has no reward threshold, so a search needs a target.",
        i = "Give the mean return that solves it as `target`."
      )
    }
    if (seeds_go_to_workers(vector_env, settings)) {
      return(train_in_futures(vector_env, runs, keep, call))
    }
    anew <- length(vector_env$remembers) && !is_playable(settings$env)
    with_env <- if (anew) in_env else function(play, max_steps) play(vector_env)
    for (run in runs) {
      training <- train_seed(run, with_env, client, call)
      keep(training)
      if (training$interrupted) {
        rlang::interrupt()
      }
    }
  }
  interrupted <- tryCatch(
    until_interrupted(
      in_env(train_all, settings$max_steps),
      "Interrupted after {finished} of {total} seed{?s}; the finished ones are returned.",
      function() sum(!vapply(trainings, function(training) training$interrupted, NA)),
      length(seeds)
    ),
    # An error carries the trainings so far, including the current one.
    error = function(cnd) {
      in_training <- inherits(cnd, "gym_error_training")
      if (!length(trainings) && !in_training) {
        rlang::cnd_signal(cnd)
      }
      finished <- count_of(length(trainings), "seed")
      if (inherits(cnd$result, "gym_training")) keep(replace(cnd$result, "interrupted", TRUE))
      abort_with_result(
        if (in_training) cnd$parent %||% cnd else cnd, paste("The", settings$what), result(),
        finished, unique(paste0("gym_error_", c(settings$what, "training"))), call,
        if (!is.null(files$checkpoint)) "After a fix, the same call resumes from the checkpoints."
      )
    }
  )
  result(interrupted)
}

# Show each message once for all seeds. The error of a run of a sweep is its result.
train_seed <- function(run, with_env, client, call) {
  if (isTRUE(run$keeps_error)) {
    run$keeps_error <- FALSE
    return(tryCatch(train_seed(run, with_env, client, call), error = identity))
  }
  withCallingHandlers(
    do_run(run, with_env, NULL, client, progress = FALSE, call),
    gym_message_interrupted = rlang::cnd_muffle,
    gym_message_resumed = rlang::cnd_muffle,
    gym_message_remembers = rlang::cnd_muffle
  )
}

# On workers -----------------------------------------------------------------------------

seeds_go_to_workers <- function(vector_env, settings) {
  if (plan_kind() == "none") {
    return(FALSE)
  }
  recipe <- training_recipe(vector_env, settings)
  if (!is.list(recipe)) {
    inform_plays_here(recipe)
  } else if (refers_to_process(settings[c("agent", "policy", "callback")])) {
    inform_plays_here("agent, policy or callback has a connection or a pointer")
  } else {
    inform_of_servers()
    return(TRUE)
  }
  FALSE
}

# An environment that remembers something over episodes does so on the worker, too, which plays a
# whole training.
training_recipe <- function(vector_env, settings) {
  vector_env$remembers <- NULL
  environment_recipe(settings$played$env, vector_env, settings$played$kwargs %||% list())
}

# If parallel trainings have their own workers on this machine, too.
inform_of_servers <- function() {
  plans <- future::plan("list")
  if (length(plans) < 2L || !inherits(plans[[1L]], c("multisession", "multicore"))) {
    return(invisible())
  }
  workers <- vapply(plans[1:2], workers_of_plan, 0)
  cores <- parallel::detectCores()
  if (all(is.finite(workers)) && isTRUE(prod(workers) > cores)) {
    rlang::inform(
      c(i = paste0("The nested plans start up to ", prod(workers), " servers on a machine of ",
                   count_of(cores, "core"), ": ", workers[[1L]], " trainings with ", workers[[2L]],
                   " workers each.")),
      class = "gym_message_servers"
    )
  }
}

# The number of workers of a plan, also of one that is not in use. future would start that plan to
# answer, which ends the workers of the current one. `NA` if it is unknown.
workers_of_plan <- function(plan) {
  if (inherits(plan, "sequential")) {
    return(1)
  }
  workers <- tryCatch(
    {
      workers <- eval(formals(plan)$workers, list(), environment(plan))
      if (is.function(workers)) workers() else workers
    },
    error = function(cnd) NULL
  )
  as.numeric(if (is.null(workers)) NA else if (is.numeric(workers)) workers else length(workers))
}

# A future for each seed. Results are kept in the order of the seeds.
train_in_futures <- function(vector_env, runs, keep, call) {
  recipe <- training_recipe(vector_env, runs[[1L]]$settings)
  versions <- server_versions(vector_env$client)
  task <- function(number) {
    new_worker_task("training", recipe, versions, run = runs[[number]])
  }
  do_in_order(length(runs), task, keep, function(slowest) Inf, call)
}

#' @exportS3Method
run_task.gym_task_training <- function(task) {
  settings <- task$run$settings
  # The plan already uses the cores.
  if (is_made_by_server(settings$env)) settings$num_workers <- settings$num_workers %||% 0L
  call <- quote(train_agent())
  with_env <- function(play, max_steps) {
    with_training_env(settings, function(vector_env) {
      check_worker_gymnasium(task, vector_env$client)
      play(vector_env)
    }, NULL, gym_client(), call)
  }
  train_seed(task$run, with_env, gym_client(), call)
}

# What differs between seeds: the settings, the checkpoint, the folder of the log.
run_of_seed <- function(settings, seed, files, call) {
  settings$seed <- seed
  text <- format(seed, scientific = FALSE)
  if (!is.null(files$checkpoint)) {
    end <- regexpr("([.][^./\\\\]+)?$", files$checkpoint)
    files$checkpoint <- paste0(
      substr(files$checkpoint, 1L, end - 1L), "-", text, substring(files$checkpoint, end)
    )
  }
  if (!is.null(files$log)) files$log <- folder_of_seed(files$log, seed)
  new_run(settings, files, call)
}

folder_of_seed <- function(folder, seed) {
  file.path(folder, paste0("seed-", format(seed, scientific = FALSE)))
}
