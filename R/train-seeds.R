# One training with each of many seeds.

check_training_seeds <- function(seeds, seed, call) {
  check_seeds(seeds, call)
  abort_if(
    !is.null(seed), "seed", seed, call, "`seed` and `seeds` cannot both be given.",
    i = "`seed` makes one training, `seeds` one with each."
  )
}

#' Train with each seed
#'
#' An interrupt ends all trainings. So does an error, which carries the trainings so far; the last
#' of them is the one that failed. All trainings share one environment, unless it remembers earlier
#' episodes.
#' @return As [gym_trainings].
#' @noRd
train_seeds <- function(settings, seeds, progress, client, call) {
  started <- now()
  runs <- lapply(seeds, function(seed) settings_of_seed(settings, seed, call))
  kept <- sum(!vapply(runs, function(run) is.null(run$file$saved), NA))
  if (kept > 0L) {
    inform_resumed("Going on from the files of {kept} of {length(seeds)} seed{?s}.")
  }
  show <- progress_bar(length(seeds), "Seed", "0 reached the target, ", shown = progress)
  trainings <- list()
  result <- function(interrupted = FALSE) {
    new_trainings(trainings, settings, now() - started, interrupted)
  }
  keep <- function(training) {
    trainings[[length(trainings) + 1L]] <<- training
    reached <- sum(vapply(trainings, function(training) isTRUE(training$solved), NA))
    if (!training$interrupted) {
      show(length(trainings), paste0(reached, " reached the target, "))
    }
  }
  train_all <- function(vector_env) {
    # Without a target, a search could not be solved with any seed.
    abort_if(
      settings$search && is.null(training_target(settings, vector_env$spec)), "target", NULL, call,
      "{environment_label(vector_env)} has no reward threshold, so a search needs a target.",
      i = "Give the mean return that solves it as `target`."
    )
    if (seeds_go_to_workers(vector_env, settings)) {
      return(train_in_futures(vector_env, runs, keep, call))
    }
    anew <- length(vector_env$remembers) && !is_playable(settings$env)
    in_env <- function(play) {
      if (anew) with_training_env(settings, play, client, call, NULL) else play(vector_env)
    }
    for (run in runs) {
      training <- train_seed(run, in_env, client, call)
      keep(training)
      if (training$interrupted) {
        rlang::interrupt()
      }
    }
  }
  interrupted <- tryCatch(
    until_interrupted(
      with_training_env(settings, train_all, client, call),
      "Interrupted after {finished} of {total} seed{?s}; the finished ones are returned.",
      function() sum(!vapply(trainings, function(training) training$interrupted, NA)),
      length(seeds)
    ),
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
        if (!is.null(settings$checkpoint)) {
          "After a fix, the same call resumes from the checkpoints."
        }
      )
    }
  )
  result(interrupted)
}

# Show each message once for all seeds. The error of a run of a sweep is its result.
train_seed <- function(run, in_env, client, call) {
  if (isTRUE(run$keeps_error)) {
    run$keeps_error <- FALSE
    return(tryCatch(train_seed(run, in_env, client, call), error = identity))
  }
  withCallingHandlers(
    do_run(run, in_env, client, progress = FALSE, call),
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
  # If there is no recipe, this is a string that says why.
  obstacle <- if (!is.list(recipe)) {
    recipe
  } else if (refers_to_process(settings[c("agent", "policy", "callback")])) {
    "agent, policy or callback has a connection or a pointer"
  }
  if (!is.null(obstacle)) inform_plays_here(obstacle)
  is.null(obstacle)
}

# A worker plays a whole training, so an environment that remembers earlier episodes can do so
# there, too.
training_recipe <- function(vector_env, settings) {
  vector_env$remembers <- NULL
  environment_recipe(settings$played$env, vector_env, settings$played$kwargs %||% list())
}

# Trains each seed in a future of its own. Results are kept in the order of the seeds.
train_in_futures <- function(vector_env, runs, keep, call) {
  recipe <- training_recipe(vector_env, runs[[1L]])
  versions <- server_versions(vector_env$client)
  task <- function(number) {
    new_worker_task("training", recipe, versions, run = runs[[number]])
  }
  do_in_order(length(runs), task, keep, function(slowest) Inf, call)
}

#' @exportS3Method
run_task.gym_task_training <- function(task) {
  settings <- task$run
  # The plan's workers already use the cores.
  if (is_made_by_server(settings$env)) settings$num_workers <- settings$num_workers %||% 0L
  call <- quote(train_agent())
  in_env <- function(play) {
    with_training_env(settings, function(vector_env) {
      check_worker_gymnasium(task, vector_env$client)
      play(vector_env)
    }, gym_client(), call, NULL)
  }
  train_seed(task$run, in_env, gym_client(), call)
}

# Sets what differs between seeds: the seed, the checkpoint, the folder of the log.
settings_of_seed <- function(settings, seed, call) {
  settings$seed <- seed
  if (!is.null(settings$checkpoint)) {
    file <- settings$checkpoint
    end <- regexpr("([.][^./\\\\]+)?$", file)
    settings$checkpoint <- paste0(
      substr(file, 1L, end - 1L), "-", format(seed, scientific = FALSE), substring(file, end)
    )
  }
  if (!is.null(settings$log)) settings$log <- folder_of_seed(settings$log, seed)
  with_checkpoint(settings, call)
}

folder_of_seed <- function(folder, seed) {
  file.path(folder, paste0("seed-", format(seed, scientific = FALSE)))
}

# Their result ---------------------------------------------------------------------------

#' Trainings with several seeds
#'
#' One training says little about an agent: another seed may fail. `train_agent(seeds = )` trains
#' once with each of many seeds and returns all trainings, failures included.
#'
#' A training has `reached` the target if its final evaluation has, which plays episodes that no
#' training has seen. The interval of this share is Wilson's, which also works if all or none have
#' reached it. A training has `stopped_early` if an evaluation during training reached the target.
#' At that time the policy was also lucky, so its final evaluation may miss the target. A training
#' that used up its budget may have reached it.
#'
#' @param x,object Trainings, as returned by `train_agent(seeds = )`.
#' @param row.names,optional,... Not used.
#' @return An object of class `gym_trainings`, a list with the elements
#'   \describe{
#'     \item{trainings}{A list of the trainings, objects of class `gym_training`, named by their
#'       seeds.}
#'     \item{agent, env_id, target}{The agent as given, the environment's id, a string, and the
#'       target, a number or `NULL`.}
#'     \item{elapsed}{The total time in seconds, a double.}
#'     \item{interrupted}{Whether it was interrupted, a logical. The last training may then have
#'       ended early.}
#'     \item{provenance}{The result of [provenance()], with all seeds.}
#'   }
#'   `as.data.frame()` returns a row for each seed: `seed` (whole number), `stopped_early`
#'   (logical), `iterations` (integer), `steps` (double), `mean_return`, `se`, `lower`, `upper` (of
#'   the final evaluation, doubles), `reached` (logical: has this mean return, or a round of a
#'   search, reached the target? `NA` without a target, and with `target = Inf`), `elapsed`
#'   (seconds, a double), `interrupted` (logical).
#'
#'   `coef()` returns the weights of the policies, a matrix with a row for each seed.
#' @references E. B. Wilson (1927), Probable inference, the law of succession, and statistical
#'   inference, Journal of the American Statistical Association 22, 209-212.
#' @seealso [train_agent()], [plot()][plot.gym_trainings()]
#' @name gym_trainings
#' @examplesIf gym:::can_start_server()
#' trained <- train_agent(agent_ars(), "CartPole-v1", iterations = 20, seeds = 1:3)
#' trained
#' as.data.frame(trained)
#' trained$trainings[["2"]]
NULL

new_trainings <- function(trainings, settings, elapsed, interrupted) {
  first <- if (length(trainings)) trainings[[1L]]
  origin <- first$provenance
  origin$seed <- vapply(trainings, function(training) as.numeric(training$seed), 0)
  structure(
    list(
      trainings = stats::setNames(trainings, format(origin$seed, scientific = FALSE, trim = TRUE)),
      agent = settings$agent, env_id = first$env_id, target = first$target, elapsed = elapsed,
      interrupted = interrupted, provenance = if (!is.null(first)) origin
    ),
    class = "gym_trainings"
  )
}

#' @rdname gym_trainings
#' @export
as.data.frame.gym_trainings <- function(x, row.names = NULL, optional = FALSE, ...) {
  check_no_curve(...)
  final <- function(training, name) as.numeric(training$final[[name]] %||% NA_real_)
  column <- function(f, type) unname(vapply(x$trainings, f, type))
  of_final <- function(name) column(function(training) final(training, name), 0)
  data.frame(
    seed = narrow_whole(column(function(training) as.numeric(training$seed), 0)),
    stopped_early = column(function(training) training$stopped_early, NA),
    iterations = column(function(training) NROW(training$history), 0L),
    steps = column(function(training) training$steps, 0),
    mean_return = of_final("mean_return"), se = of_final("se"), lower = of_final("lower"),
    upper = of_final("upper"), reached = column(function(training) training$solved, NA),
    elapsed = column(function(training) training$elapsed, 0),
    interrupted = column(function(training) training$interrupted, NA)
  )
}

#' @rdname gym_trainings
#' @export
coef.gym_trainings <- function(object, ...) {
  check_dots_empty(...)
  do.call(rbind, lapply(object$trainings, function(training) stats::coef(training$policy)))
}

#' @rdname gym_trainings
#' @export
summary.gym_trainings <- function(object, ...) object

#' Compute Wilson's score interval of a share
#' @noRd
wilson_interval <- function(successes, n, level = 0.95) {
  if (n == 0 || is.na(successes)) {
    return(c(NA_real_, NA_real_))
  }
  z <- stats::qnorm((1 + level) / 2)
  share <- successes / n
  middle <- (share + z^2 / (2 * n)) / (1 + z^2 / n)
  half <- z / (1 + z^2 / n) * sqrt(share * (1 - share) / n + z^2 / (4 * n^2))
  # At 0 and 1 rounding would leave the bound slightly off.
  c(if (successes == 0) 0 else middle - half, if (successes == n) 1 else middle + half)
}

#' @export
print.gym_trainings <- function(x, ...) print_lines(x, trainings_lines(x))

trainings_lines <- function(x) {
  table <- as.data.frame(x)
  if (!nrow(table)) {
    return("Ended before the first training was finished")
  }
  done <- table[!table$interrupted, ]
  returns <- done$mean_return[!is.na(done$mean_return)]
  c(
    paste0("Training in ", env_text(x), " by ", format(x$agent)),
    paste0("Policy: ", policy_text(x$trainings[[1L]]$policy)),
    if (nrow(done) && has_target(x)) {
      interval <- wilson_interval(sum(done$reached), nrow(done))
      c(
        paste0("Reached the target ", number_text(x$target), " with ", sum(done$reached), " of ",
               count_of(nrow(done), "seed"), " (",
               interval_text(interval[[1L]], interval[[2L]], text = percent_text), ")"),
        paste0("Stopped early: ", sum(done$stopped_early), " of ", nrow(done))
      )
    },
    if (length(returns)) {
      paste0("Final mean returns: median ", number_text(stats::median(returns)), ", from ",
             number_text(min(returns)), " to ", number_text(max(returns)))
    },
    paste0(if (any(table$interrupted)) "Interrupted after " else "Played ",
           count_of(nrow(done), "seed"), ", ", count_of(sum(table$steps), "step"),
           elapsed_text(x$elapsed))
  )
}
