#' Train with Stable-Baselines3
#'
#' Train a policy in Python with [Stable-Baselines3](https://stable-baselines3.readthedocs.io) or
#' [sb3-contrib](https://sb3-contrib.readthedocs.io), and get it back as a policy of this package.
#' Use it for algorithms that this package does not have, such as SAC for robots, and for large
#' networks and GPUs.
#'
#' The training is a process of its own, which uses the server's Python. `gym_server_install(extras
#' = "sb3")` installs Stable-Baselines3 and PyTorch there. (On Linux this takes some gigabytes,
#' because PyTorch includes what a GPU needs.) `learn_sb3()` writes a job to a folder, runs `python
#' -m gym_server.sb3 job.json`, shows the progress and reads the files that the process writes. An
#' interrupt ends the training at its next step and keeps the policy. If R is killed, the process
#' ends, too.
#'
#' # Algorithms and their arguments
#'
#' The algorithms are `"PPO"`, `"A2C"`, `"DQN"`, `"SAC"`, `"TD3"` and `"DDPG"` of Stable-Baselines3,
#' and `"TQC"`, `"TRPO"`, `"QRDQN"`, `"CrossQ"`, `"RecurrentPPO"` and `"MaskablePPO"` of
#' sb3-contrib. Their arguments in `...` have the same names as in Python, such as `learning_rate`,
#' `buffer_size` or `policy_kwargs = list(net_arch = c(400, 300), activation_fn = "ReLU")`. As in
#' rl-baselines3-zoo, `learning_rate = "lin_3e-4"` decreases from 3e-4 to 0, and `noise_type =
#' "normal"` with `noise_std` adds noise to the actions of TD3 and DDPG.
#'
#' For some environments there are presets with the values of
#' [rl-baselines3-zoo](https://github.com/DLR-RM/rl-baselines3-zoo), see [agent_presets()]. If a
#' preset is used, a message says so. Arguments that you give replace its values. Without a preset,
#' the library's own defaults hold.
#'
#' `"MlpPolicy"` is a network of fully connected layers, `"CnnPolicy"` is for pictures, and
#' `"MultiInputPolicy"` is for a Dict. The policies of RecurrentPPO, such as `"MlpLstmPolicy"`,
#' remember earlier observations. MaskablePPO needs an environment that says which actions are
#' valid: in `info["action_mask"]`, as Taxi-v4 does, or by a method `action_masks()`.
#'
#' # Atari
#'
#' With a `"CnnPolicy"`, games such as `"ALE/Pong-v5"` are preprocessed as by AtariWrapper of
#' Stable-Baselines3. An episode starts with up to 30 steps without an action. Each action is taken
#' for 4 frames (or as many as `frameskip` in `env_kwargs` says). An observation is the last four
#' pictures, in grey and of 84 x 84 pixels. For training only, rewards are clipped to -1, 0 and 1,
#' and an episode ends with a life. Evaluations and [rollout()] play whole games with their scores.
#' The element `agent$preprocessing` of the result has these settings, and the probability that an
#' action is repeated (`repeat_action_probability`, 0.25 in the games of version 5). In the history,
#' `mean_length` counts frames.
#'
#' For training the vector environment of `ale-py` steps all `num_envs` games in threads, as many as
#' there are processors. It does not press the fire button after a lost life, and moving things can
#' be a little lighter or darker than with AtariWrapper. If you use wrappers, or arguments of the
#' game that it lacks, such as `mode`, AtariWrapper steps one game after another instead.
#'
#' `vignette("solved")` has the time of a training on a GPU.
#'
#' # The policy
#'
#' A network of fully connected layers becomes a [policy_network()], which acts without Python.
#' [rollout()] plays it in the server's processes. This needs a Discrete or Box action space,
#' observations that are numbers, and one of the activations tanh, ReLU, leaky ReLU and logistic.
#' With `normalize` the network keeps the moments of the observations. Its actions differ from those
#' of `model.predict(deterministic = True)` by less than 1e-5 of their range, because PyTorch
#' calculates in single precision. The network does not have state-dependent exploration
#' (`use_sde`). It takes the most likely actions.
#'
#' Any other policy, such as a convolutional or recurrent one, stays with Stable-Baselines3. It has
#' the class `gym_policy_sb3` and holds its weights as safetensors, so [saveRDS()] keeps it.
#' [rollout()], [evaluate_policy()] and [animate()] play its whole episodes in a Python process,
#' which makes the environment itself and ends afterwards. So they need the environment's id.
#' [predict()] and [act()] start such a process, too, which takes seconds. So ask about many
#' observations at once. Give observations in the form that the policy sees; for Atari these are
#' arrays of 4 x 84 x 84 numbers from 0 to 255. Each observation counts as the first one of an
#' episode. The policy takes the most likely actions.
#'
#' # Going on
#'
#' `checkpoint` is a folder. At each evaluation and at the end, the training writes there the model
#' as a zip file, its replay buffer (up to 4 GB) and its moments. Make the same call again to go on
#' with the remaining steps. With a larger `total_steps` a finished training goes on, too. Schedules
#' refer to the whole training. A training that goes on begins a new episode and draws different
#' random numbers, so its result is not exactly that of an uninterrupted training.
#'
#' @param algorithm The algorithm, a string; see below.
#' @param env The id of an environment of the server, a string.
#' @param total_steps The number of steps of the environment, a whole number. It may be left out if
#'   there is a preset.
#' @param ... Arguments of the algorithm, by their Python names.
#' @param policy The policy's name in Stable-Baselines3, a string. The default is the preset's, or
#'   `"MlpPolicy"`.
#' @param env_kwargs The arguments of the environment, a list with names.
#' @param num_envs The number of sub-environments, a whole number. By default it is the
#'   preset's number, or one without a preset. One process steps them one after another (Atari games
#'   in threads). The network gets all their observations together.
#' @param normalize Normalise observations and rewards by `VecNormalize`? `FALSE`, the default,
#'   `TRUE`, or a list of its arguments, such as `list(norm_reward = FALSE)`. The log and all
#'   evaluations show the original rewards.
#' @param device Where PyTorch computes, a string: `"cpu"`, `"cuda"` or, by default, `"auto"`.
#' @param seed,seeds As for [train_agent()]. Several seeds are trained one after the other. A
#'   `checkpoint` and a `log` have a folder for each, such as `seed-7`.
#' @param target The mean return that the final evaluation should reach, a number. It does not end
#'   the training. `NULL`, the default, uses the environment's target, as in [train_agent()].
#' @param eval_every The number of steps between evaluations for the learning curve, a whole
#'   number. `NULL`, the default, is a tenth of `total_steps`.
#' @param eval_episodes_curve The number of episodes for a point of the learning curve, a whole
#'   number. The default is 10. With 0 there is no learning curve.
#' @param eval_episodes The number of episodes of the final evaluation, a whole number of at
#'   least 2. The default is 100.
#' @param checkpoint The folder that keeps the training, a string, or `NULL`, the default.
#' @param resume Go on with the training in that folder? `TRUE`, the default, or `FALSE`, which
#'   starts again and replaces it.
#' @param log As for [train_agent()].
#' @param progress Show a progress bar? By default in interactive sessions only.
#' @param client The client of the server that plays the final evaluation. The default is the
#'   session's client, [gym_client()].
#' @return The same as from [train_agent()]: an object of class `gym_training`, or with `seeds` of
#'   class [gym_trainings]. An iteration is a row of Stable-Baselines3's `progress.csv`, which has
#'   at most a hundred rows. Its returns are those of the episodes that ended since the last row.
#'   The history also has the columns that Stable-Baselines3 logs as `train/`.
#' @section Errors: `gym_error_argument` for an invalid argument, including those that
#'   Stable-Baselines3 refuses; `gym_error_install` if it is not installed; `gym_error_checkpoint`
#'   for the folder of another training; `gym_error_training` for an error during training, such as
#'   a loss that is NaN. Its field `result` is the training with the last finite weights.
#' @references A. Raffin et al. (2021), Stable-Baselines3: reliable reinforcement learning
#'   implementations, Journal of Machine Learning Research 22(268).
#'
#'   T. Haarnoja et al. (2018), Soft actor-critic, ICML.
#' @seealso [learn_ppo()] and [learn_dqn()], which need no PyTorch; [as_policy()] for models that
#'   somebody else trained
#' @concept SAC TD3 A2C PyTorch
#' @export
#' @examplesIf gym:::can_start_server() && gym:::has_sb3()
#' trained <- learn_sb3(
#'   "SAC", "Pendulum-v1", total_steps = 300, eval_episodes = 10, eval_episodes_curve = 0, seed = 1
#' )
#' trained
#' predict(trained, c(1, 0, 0))
learn_sb3 <- function(algorithm, env, total_steps = NULL, ..., policy = NULL,
                      env_kwargs = list(), num_envs = NULL, normalize = NULL, device = "auto",
                      seed = NULL, seeds = NULL, target = NULL, eval_every = NULL,
                      eval_episodes_curve = 10, eval_episodes = 100, checkpoint = NULL,
                      resume = TRUE, log = NULL, progress = rlang::is_interactive(),
                      client = gym_client()) {
  match_whole_names()
  call <- rlang::current_env()
  check_sb3_env(env, call)
  check_string(algorithm)
  given <- list(...)
  check_dots_named(given, "learning_rate = 1e-3", call)
  check_named_list(env_kwargs)
  settings <- with_sb3_preset(
    list(
      algorithm = algorithm, env = env, env_kwargs = env_kwargs, arguments = given,
      policy = policy, num_envs = num_envs, normalize = normalize, total_steps = total_steps,
      device = device, seed = seed, target = target, eval_every = eval_every,
      eval_episodes_curve = eval_episodes_curve, eval_episodes = eval_episodes
    )
  )
  check_sb3_settings(settings, call)
  for (name in c("progress", "resume")) check_flag(get(name), arg = name, call = call)
  check_string(checkpoint, allow_null = TRUE)
  check_string(log, allow_null = TRUE)
  files <- list(
    checkpoint = if (!is.null(checkpoint)) absolute_path(checkpoint),
    log = if (!is.null(log)) absolute_path(log), resume = resume
  )
  if (!is.null(seeds)) check_training_seeds(plain_numbers(seeds), seed, call)
  python <- sb3_python(call)
  if (is.null(seeds)) {
    return(train_sb3(settings, files, python, progress, client, call))
  }
  started <- now()
  trainings <- list()
  for (seed in plain_numbers(seeds)) {
    settings["seed"] <- list(seed)
    own <- files
    places <- !vapply(own, is.null, NA) & names(own) != "resume"
    own[places] <- folder_of_seed(own[places], seed)
    training <- train_sb3(settings, own, python, progress, client, call)
    trainings <- c(trainings, list(training))
    if (training$interrupted) break
  }
  new_trainings(trainings, settings, now() - started, training$interrupted)
}

# For examples and tests.
has_sb3 <- function() !is.null(tryCatch(sb3_python(NULL), error = function(cnd) NULL))

check_sb3_env <- function(env, call) {
  check_given(env, "It is the id of an environment, such as `\"Pendulum-v1\"`.", call = call)
  if (rlang::is_string(env) && is_made_by_server(env)) {
    return()
  }
  abort_wrong(
    "env", env, call,
    'Stable-Baselines3 trains in environments that Python makes from an id, not in
     {if (rlang::is_string(env)) "an environment in R" else describe_argument(env)}.',
    i = "`learn_ppo()` trains in environments written in R, and with wrappers that are R functions.
         The arguments of an id go into `env_kwargs`."
  )
}

# The user's values replace the preset's. Without either, the library's defaults hold.
with_sb3_preset <- function(settings) {
  env <- settings$env
  preset <- find_preset(settings$algorithm, env, settings$env_kwargs, "sb3-presets.csv")
  if (!is.null(preset)) {
    inform_of_preset(preset, env)
    arguments <- from_json(preset$arguments)
    arguments[names(settings$arguments)] <- settings$arguments
    settings$arguments <- arguments
  }
  budget <- settings$total_steps %||% preset$total_steps
  settings$total_steps <- budget
  default <- list(policy = "MlpPolicy", num_envs = 1, normalize = FALSE,
                  eval_every = max(ceiling((budget %||% 1) / 10), 1))
  for (name in names(default)) {
    settings[[name]] <- settings[[name]] %||% preset[[name]] %||% default[[name]]
  }
  settings$agent <- new_sb3_agent(
    settings$algorithm, settings$arguments, preset[c("env_id", "kwargs", "origin", "source")]
  )
  settings
}

check_sb3_settings <- function(settings, call) {
  of <- function(check, name, ...) check(settings[[name]], ..., arg = name, call = call)
  abort_if(
    is.null(settings$total_steps), "total_steps", NULL, call,
    "Training needs a budget: give `total_steps` of the environment."
  )
  for (name in c("total_steps", "num_envs", "eval_every")) of(check_count, name)
  of(check_count, "eval_episodes_curve", min = 0)
  of(check_count, "eval_episodes", min = 2)
  for (name in c("policy", "device")) of(check_string, name)
  of(check_number, "target", allow_null = TRUE)
  of(check_seed, "seed")
  if (!is.list(settings$normalize)) of(check_flag, "normalize")
}

# Trains with one seed.
train_sb3 <- function(settings, files, python, progress, client, call) {
  folder <- files$checkpoint %||% temporary_file("gym-sb3-")
  if (is.null(files$checkpoint)) on.exit(unlink(folder, recursive = TRUE))
  dir.create(folder, showWarnings = FALSE, recursive = TRUE)
  settings$seed <- settings$seed %||% draw_seed()
  job <- sb3_job(settings, !is.null(files$checkpoint))
  go_on_or_begin(job, folder, files, call)
  settings$seed <- job$seed
  settings$started <- Sys.time()
  if (!is.null(files$log)) {
    dir.create(files$log, showWarnings = FALSE, recursive = TRUE)
    for (table in c("progress.csv", "evaluations.csv")) keep_as_earlier(file.path(files$log, table))
  }
  show <- progress_bar(settings$total_steps, "Step", shown = progress)
  poll <- sb3_poll(folder, files$log, function(last) {
    show(min(last[["time/total_timesteps"]], settings$total_steps),
         paste0("return ", number_text(last[["rollout/ep_rew_mean"]]), ", "))
  })
  unlink(file.path(folder, "policy.safetensors"))
  result <- run_sb3_job(job, folder, python, call, poll)
  if (!file.exists(file.path(folder, "policy.safetensors"))) {
    rlang::cnd_signal(sb3_error(result$error, call))
  }
  training <- sb3_training(settings, folder, result, client, call)
  if (!is.null(files$log)) log_sb3(training, settings, files$log, call)
  if (result$interrupted) {
    cli::cli_inform(
      c("!" = "Interrupted after {result$steps} of {settings$total_steps} steps."),
      class = "gym_message_interrupted"
    )
  }
  if (!is.null(result$error)) {
    abort_with_result(
      sb3_error(result$error, call), "The training", training, count_of(training$steps, "step"),
      "gym_error_training", call,
      if (!is.null(files$checkpoint)) "After a fix, the same call goes on from the checkpoint."
    )
  }
  training
}

# Makes a function that reads the table that the child writes, shows its last row and copies the
# table to the log.
sb3_poll <- function(folder, log, show) {
  table <- file.path(folder, "progress.csv")
  read <- -Inf
  function() {
    changed <- as.numeric(file.mtime(table))
    if (is.na(changed) || changed <= read) {
      return()
    }
    read <<- changed
    # The child may be writing the file right now.
    rows <- tryCatch(sb3_progress(folder), error = function(cnd) NULL)
    if (NROW(rows)) show(rows[nrow(rows), ])
    if (!is.null(log)) file.copy(table, log, overwrite = TRUE)
  }
}

sb3_job <- function(settings, keeps) {
  arguments <- settings$arguments
  c(
    settings[c("policy", "total_steps", "num_envs", "device", "eval_every", "seed", "normalize")],
    sb3_env_job(settings$algorithm, settings$policy, settings$env, settings$env_kwargs),
    list(
      task = "train", eval_episodes = settings$eval_episodes_curve, checkpoint = keeps,
      arguments = if (length(arguments)) arguments else rlang::set_names(list())
    )
  )
}

# Settings that must be the same to resume a training. The budget and the evaluations may differ.
of_sb3_training <- c("algorithm", "policy", "num_envs", "env_kwargs", "arguments", "env_id",
                     "normalize")

go_on_or_begin <- function(job, folder, files, call) {
  begun <- if (!is.null(files$checkpoint) && files$resume) sb3_state(folder, call)
  if (is.null(begun)) {
    unlink(file.path(folder, c("checkpoint", "checkpoint-old", "checkpoint-new")), recursive = TRUE)
  } else {
    before <- read_checkpoint_file(file.path(folder, "job.json"), call)
    now <- from_json(to_json(job))
    differ <- Filter(function(name) !identical(before[[name]], now[[name]]), of_sb3_training)
    if (length(differ)) {
      gym_abort(
        c(paste0("The training in \"", folder, "\" had another value of ", quoted_names(differ),
                 "."),
          i = "Give another folder, or `resume = FALSE` to start again."),
        class = "gym_error_checkpoint", call = call
      )
    }
    cli::cli_inform(
      c(i = "Going on after {begun$num_timesteps} steps."), class = "gym_message_resumed"
    )
  }
  sb3_forget_later(folder)
}

# Writes the log in the form that all trainings have.
log_sb3 <- function(training, settings, folder, call) {
  rows <- function(table) lapply(seq_len(nrow(table)), function(i) as.list(table[i, ]))
  state <- list(
    history = rows(training$history), evaluations = rows(training$evaluations),
    agent = training$agent, iteration = nrow(training$history)
  )
  settings[c("env_id", "kwargs", "provenance")] <- training[c("env_id", "kwargs", "provenance")]
  settings$policy <- training$policy
  training_log(folder, settings, state, call)
}
