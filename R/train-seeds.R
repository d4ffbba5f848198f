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
  show <- if (progress) progress_bar(length(seeds), "Seed", "0 solved, ") else function(...) NULL
  trainings <- list()
  result <- function(interrupted = FALSE) {
    new_trainings(trainings, settings, proc.time()[["elapsed"]] - started, interrupted)
  }
  keep <- function(training) trainings[[length(trainings) + 1L]] <<- training
  train_all <- function(vector_env) {
    anew <- length(vector_env$remembers) && !is_playable(settings$env)
    with_env <- if (anew) in_env else function(use) use(vector_env)
    for (one in of_seeds) {
      training <- quietly_for_seed(with_env(function(vector_env) {
        train_in(vector_env, one$settings, one$file, one$log, progress = FALSE, call)
      }))
      keep(training)
      if (training$interrupted) {
        rlang::interrupt()
      }
      solved <- sum(vapply(trainings, function(training) training$solved, NA))
      show(length(trainings), paste0(solved, " solved, "))
    }
  }
  interrupted <- tryCatch(
    until_interrupted(
      in_env(train_all, settings$max_steps),
      "Interrupted after {finished} of {total} seed{?s}; what was trained is returned.",
      function() sum(!vapply(trainings, function(training) training$interrupted, NA)),
      length(seeds)
    ),
    error = function(cnd) {
      if (!length(trainings) && !inherits(cnd, "gym_error_training")) {
        rlang::cnd_signal(cnd)
      }
      finished <- count_of(length(trainings), "seed")
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
    }
  )
  result(interrupted)
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
