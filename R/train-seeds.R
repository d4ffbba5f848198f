# One training with each of many seeds.

check_training_seeds <- function(seeds, seed, call) {
  check_seeds(seeds, call)
  if (!is.null(seed)) {
    gym_abort(
      c("`seed` and `seeds` cannot both be given.",
        i = "`seed` makes one training, `seeds` one with each."),
      class = "gym_error_argument", argument = "seed", value = seed, call = call
    )
  }
}

#' Train with each seed
#'
#' An interrupt ends all; so does an error, which carries the trainings so far. The training that it
#' met is the last of them.
#' @param in_env A function that makes the environment and calls a function with it. All trainings
#'   play in the same, unless it remembers earlier episodes.
#' @param files A list of `checkpoint`, `log` and `resume`, as [train_agent()] takes them.
#' @return As [gym_trainings].
#' @noRd
train_seeds <- function(in_env, settings, seeds, files, progress, call) {
  started <- proc.time()[["elapsed"]]
  of_seeds <- lapply(seeds, function(seed) training_of_seed(settings, seed, files, call))
  kept <- sum(!vapply(of_seeds, function(one) is.null(one$file$saved), NA))
  if (kept > 0L) {
    inform_resumed("Going on from the files of {kept} of {length(seeds)} seed{?s}.")
  }
  show <- progress_bar(length(seeds), "Seed", "0 solved, ", shown = progress)
  trainings <- list()
  result <- function(interrupted = FALSE) {
    new_trainings(trainings, settings, proc.time()[["elapsed"]] - started, interrupted)
  }
  keep <- function(training) {
    trainings[[length(trainings) + 1L]] <<- training
    solved <- sum(vapply(trainings, function(training) training$solved, NA))
    if (!training$interrupted) show(length(trainings), paste0(solved, " solved, "))
  }
  train_all <- function(vector_env) {
    if (seeds_go_to_workers(vector_env, settings)) {
      return(train_in_futures(vector_env, of_seeds, keep, call))
    }
    anew <- length(vector_env$remembers) && !is_playable(settings$env)
    with_env <- if (anew) in_env else function(use) use(vector_env)
    for (one in of_seeds) {
      training <- train_seed(one, with_env, call)
      keep(training)
      if (training$interrupted) {
        rlang::interrupt()
      }
    }
  }
  interrupted <- keeping_trainings(
    until_interrupted(
      in_env(train_all, settings$max_steps),
      "Interrupted after {finished} of {total} seed{?s}; what was trained is returned.",
      function() sum(!vapply(trainings, function(training) training$interrupted, NA)),
      length(seeds)
    ),
    function() trainings, keep, result, files, call
  )
  result(interrupted)
}

# An error carries the trainings so far, with the one that was being trained.
keeping_trainings <- function(code, trained, keep, result, files, call) {
  tryCatch(code, error = function(cnd) {
    if (!length(trained()) && !inherits(cnd, "gym_error_training")) {
      rlang::cnd_signal(cnd)
    }
    finished <- count_of(length(trained()), "seed")
    if (inherits(cnd$result, "gym_training")) {
      begun <- cnd$result
      begun$interrupted <- TRUE
      keep(begun)
    }
    abort_with_result(
      if (inherits(cnd, "gym_error_training")) cnd$parent %||% cnd else cnd, "The training",
      result(), finished, "gym_error_training", call,
      if (!is.null(files$checkpoint)) {
        "The same call goes on from the checkpoints when what is wrong is fixed."
      }
    )
  })
}

train_seed <- function(one, with_env, call) {
  quietly_for_seed(with_env(function(vector_env) {
    train_in(vector_env, one$settings, one$file, one$log, progress = FALSE, call)
  }))
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

# What remembers something over episodes does so on the worker as well, which plays a whole
# training.
training_recipe <- function(vector_env, settings) {
  vector_env$remembers <- NULL
  environment_recipe(settings$env, vector_env, settings$kwargs)
}

# Where trainings side by side have workers of their own on this machine, too.
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

# How many workers a plan asks for, also one that is not in use: future would set that one up to
# answer, which ends the workers of the one in use. `NA` where it cannot be told.
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

# A future for each seed. What they return is kept in the order of the seeds.
train_in_futures <- function(vector_env, of_seeds, keep, call) {
  recipe <- training_recipe(vector_env, of_seeds[[1L]]$settings)
  trained <- vector("list", length(of_seeds))
  begun <- kept <- 0L
  next_seed <- function() {
    if (begun == length(of_seeds)) {
      return(NULL)
    }
    begun <<- begun + 1L
    at <- begun
    one <- of_seeds[[at]]
    task <- new_worker_task("training", recipe, server_versions(vector_env$client), one = one)
    list(
      task = task, here = function() run_task(task),
      done = function(training) {
        trained[[at]] <<- training
        while (kept < length(trained) && !is.null(trained[[kept + 1L]])) {
          kept <<- kept + 1L
          keep(trained[[kept]])
        }
      }
    )
  }
  do_tasks(next_seed, function(slowest) Inf, call)
}

#' @exportS3Method
run_task.gym_task_training <- function(task) {
  settings <- task$one$settings
  # The plan uses the cores.
  if (is_made_by_server(settings$env)) settings$num_workers <- settings$num_workers %||% 0L
  call <- quote(train_agent())
  with_env <- function(use) {
    with_training_env(settings, function(vector_env) {
      check_worker_gymnasium(task, vector_env$client)
      use(vector_env)
    }, NULL, gym_client(), call)
  }
  train_seed(task$one, with_env, call)
}

# What a seed has of its own: its settings, its checkpoint, the folder of its log.
training_of_seed <- function(settings, seed, files, call) {
  settings$seed <- seed
  text <- format(seed, scientific = FALSE)
  if (!is.null(files$checkpoint)) {
    end <- regexpr("([.][^./\\\\]+)?$", files$checkpoint)
    files$checkpoint <- paste0(
      substr(files$checkpoint, 1L, end - 1L), "-", text, substring(files$checkpoint, end)
    )
  }
  list(
    settings = settings, file = training_file(settings, files, call),
    log = if (!is.null(files$log)) file.path(files$log, paste0("seed-", text))
  )
}

# Messages come once, for all seeds.
quietly_for_seed <- function(code) {
  withCallingHandlers(
    code,
    gym_message_interrupted = function(cnd) rlang::cnd_muffle(cnd),
    gym_message_resumed = function(cnd) rlang::cnd_muffle(cnd),
    gym_message_remembers = function(cnd) rlang::cnd_muffle(cnd)
  )
}
