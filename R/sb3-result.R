# Makes a result of this package from the files of a training by Stable-Baselines3.

# Reads the rows of progress.csv, including those from before the training was resumed.
sb3_progress <- function(folder) {
  files <- file.path(folder, c("earlier.csv", "progress.csv"))
  tables <- lapply(files[file.exists(files)], function(file) {
    # The file is empty until there is a row.
    if (!file.size(file)) {
      return(NULL)
    }
    utils::read.csv(file, check.names = FALSE, na.strings = c("", "nan", "NA"))
  })
  tables <- Filter(NROW, tables)
  names <- unique(unlist(lapply(tables, names)))
  rows <- lapply(tables, function(table) {
    table[setdiff(names, names(table))] <- NA_real_
    table[names]
  })
  do.call(rbind, rows)
}

# Removes rows and evaluations from after the checkpoint, because the training will write them again
# when it goes on.
sb3_forget_later <- function(folder) {
  state <- sb3_state(folder)
  rows <- utils::head(sb3_progress(folder), state$rows %||% 0)
  evaluations <- Filter(function(line) from_json(line)$iteration <= (state$rows %||% 0),
                        sb3_evaluation_lines(folder))
  unlink(file.path(folder, c("progress.csv", "earlier.csv", "evaluations.jsonl")))
  if (NROW(rows)) {
    replace_content(file.path(folder, "earlier.csv"), as_lines(csv_lines(rows)))
    replace_content(file.path(folder, "evaluations.jsonl"), as_lines(evaluations))
  }
}

sb3_state <- function(folder, call = rlang::caller_env()) {
  files <- file.path(folder, c("checkpoint", "checkpoint-old"), "state.json")
  file <- files[file.exists(files)]
  if (length(file)) read_checkpoint_file(file[[1L]], call)
}

read_checkpoint_file <- function(file, call) {
  tryCatch(read_json_file(file), error = function(cnd) {
    gym_abort(
      c(paste0("The checkpoint is damaged: ", file, " is no JSON document."),
        i = "Put the file back, or give `resume = FALSE` to start again."),
      class = "gym_error_checkpoint", call = call, parent = cnd
    )
  })
}

sb3_evaluation_lines <- function(folder) {
  file <- file.path(folder, "evaluations.jsonl")
  if (file.exists(file)) readLines(file, warn = FALSE) else character()
}

sb3_history <- function(table) {
  if (!NROW(table)) {
    return(no_iterations)
  }
  own <- c(
    steps = "time/total_timesteps", min_return = "rollout/ep_rew_min",
    median_return = "rollout/ep_rew_median", mean_return = "rollout/ep_rew_mean",
    max_return = "rollout/ep_rew_max", mean_length = "rollout/ep_len_mean",
    evaluation = "eval/mean_reward", elapsed = "time/time_elapsed"
  )
  history <- lapply(own, function(name) as.numeric(table[[name]] %||% rep(NA, nrow(table))))
  trained <- grep("^train/", names(table), value = TRUE)
  logged <- stats::setNames(lapply(table[trained], as.numeric), sub("^train/", "", trained))
  list2DF(c(list(iteration = seq_len(nrow(table))), history, logged))
}

sb3_evaluations <- function(folder) {
  rows <- lapply(sb3_evaluation_lines(folder), function(line) {
    played <- from_json(line)
    episodes <- data.frame(return = as.numeric(unlist(played$returns)),
                           length = as.integer(unlist(played$lengths)))
    evaluation <- evaluate_episodes(episodes, policy_random())
    evaluation_row(as.integer(played$iteration), "curve", evaluation)
  })
  do.call(rbind, c(list(no_evaluations), rows))
}

#' Make the result of a training
#' @param settings The settings of the training, see [learn_sb3()].
#' @param result As returned by [run_sb3_job()].
#' @noRd
sb3_training <- function(settings, folder, result, client, call) {
  history <- sb3_history(sb3_progress(folder))
  evaluations <- sb3_evaluations(folder)
  whole <- !result$interrupted && is.null(result$error)
  bind <- function(vector_env) {
    policy <- policy_bind(sb3_policy(folder), vector_env, call = call)
    final <- if (whole) sb3_final(vector_env, policy, settings, nrow(history), call)
    list(policy = policy, final = final, spec = vector_env$spec,
         provenance = new_provenance(vector_env, settings, settings$started))
  }
  bound <- rlang::inject(with_vector_env(
    settings$env, settings$eval_episodes, bind, client = client, call = call,
    !!!settings$env_kwargs
  ))
  bound$provenance$server <- c(bound$provenance$server, unlist(result$versions))
  bound$provenance$way <- paste0("by Stable-Baselines3 on ", result$device)
  agent <- settings$agent
  agent$policy <- bound$policy
  agent$preprocessing <- result$preprocessing
  logged <- setdiff(names(history), names(no_iterations))
  agent$log <- unlist(history[nrow(history), logged, drop = FALSE]) %||% numeric()
  target <- training_target(settings, bound$spec)
  judged <- whole && !is.null(target) && is.finite(target)
  structure(
    list(
      policy = greedy_policy(bound$policy), agent = agent,
      solved = if (judged) reaches(bound$final$mean_return, target) else NA,
      stopped_early = FALSE, history = history, evaluations = rbind(evaluations, bound$final),
      final = bound$final, target = target, env_id = settings$env, env = settings$env,
      kwargs = settings$env_kwargs, seed = settings$seed, steps = as.numeric(result$steps),
      elapsed = max(history$elapsed, 0), interrupted = result$interrupted, max_steps = NULL,
      rules = settings[intersect(kept_rules, names(settings))], provenance = bound$provenance
    ),
    class = "gym_training"
  )
}

# The final evaluation: the policy plays episodes with seeds that no training has seen.
sb3_final <- function(vector_env, policy, settings, iteration, call) {
  own <- new_generator(stream = parallel::nextRNGSubStream(seed_stream(settings$seed)))
  seed <- with_generator(own, draw_seed())
  evaluation <- naming_own_call(rlang::inject(evaluate_policy(
    settings$env, greedy_policy(policy), settings$eval_episodes, seed = seed,
    !!!settings$env_kwargs, progress = FALSE, client = vector_env$client
  )), c("evaluate_policy", "rollout"), call)
  evaluation_row(iteration, "final", evaluation)
}

# The agent of such a training: the user's settings and the policy.
new_sb3_agent <- function(algorithm, arguments, preset) {
  structure(
    list(algorithm = algorithm, arguments = arguments, preset = preset),
    class = c("gym_agent_sb3", "gym_agent")
  )
}

#' @export
format.gym_agent_sb3 <- function(x, ...) {
  given <- vapply(x$arguments, function(value) {
    if (is_number(value)) number_text(value) else describe_value(value)
  }, "")
  paste0(x$algorithm, " of Stable-Baselines3",
         if (length(given)) paste0(": ", toString(paste(names(given), given))))
}

#' @export
agent_log.gym_agent_sb3 <- function(agent) agent$log %||% numeric()

# It learns from the steps of one policy.
#' @export
agent_needs.gym_agent_sb3 <- function(agent) "trajectories"
