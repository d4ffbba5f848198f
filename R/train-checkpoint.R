# A training keeps its state in a file, the checkpoint, from which it can be resumed.
# train-checkpoint-file.R reads and writes the file.

kept_of_training <- c(
  "agent", "iteration", "steps", "history", "evaluations", "episodes", "final", "solved", "ended"
)

#' Read the checkpoint of a training and prepare to update it
#'
#' @param path The file.
#' @param arguments The arguments that must be the same as in the file, a list.
#' @param resume Whether to resume from the file.
#' @param what What is kept, `"search"` or `"training"`.
#' @return A list: `path`, `arguments`, `saved`, the content of the file, `NULL` if there is nothing
#'   to resume, and `mark`, which identifies this version of the file.
#' @noRd
open_checkpoint <- function(path, arguments, resume, what, call) {
  # Replace the target of a link, not the link.
  path <- normalizePath(absolute_path(path), mustWork = FALSE)
  if (dir.exists(path) || !dir.exists(dirname(path))) {
    if (dir.exists(path)) abort_checkpoint(path, "is a folder", call = call)
    folder <- paste0("`dir.create(\"", dirname(path), "\")` makes the folder.")
    abort_checkpoint(path, "is in a folder that does not exist", hint = folder, call = call)
  }
  # A process that was killed while writing leaves a part behind. Another process may still be
  # writing a part that is younger than ten minutes.
  files <- list.files(dirname(path), "[.]part$", full.names = TRUE)
  parts <- files[startsWith(basename(files), paste0(basename(path), "-"))]
  unlink(parts[difftime(Sys.time(), file.mtime(parts), units = "mins") > 10])
  mark <- file_mark(path)
  saved <- if (resume) read_checkpoint(path, call)
  if (!is.null(saved)) {
    if (!identical(saved$what, what)) {
      abort_checkpoint(path, paste("belongs to a", saved$what), call = call)
    }
    check_same(path, saved$arguments, arguments, paste("belongs to another", what), function(name) {
      there <- argument_text(name, saved$arguments[[name]])
      here <- argument_text(name, arguments[[name]])
      if (there == here) {
        paste0("`", name, "` is a different one in the file",
               if (name == "policy") ", with other weights", ".")
      } else {
        paste0("`", name, "` is ", there, " in the file, and ", here, " here.")
      }
    }, call)
  }
  list(path = path, arguments = arguments, saved = saved, mark = mark)
}

#' Resume from a training's file, and keep the training in it from now on
#'
#' The file grows, so writing may take longer than playing if iterations are short. Then the file is
#' not written after each iteration. A resumed training plays the iterations since the last write
#' again.
#' @return A function that is called after each iteration, and at the end with `last = TRUE`.
#' @noRd
training_checkpoint <- function(state, settings, call) {
  file <- settings$file
  # These settings, which the server determines, must be the same, too.
  server <- settings[c(
    if (settings$search) "target", "env_id", "num_envs", "batch_size", "from_model"
  )]
  if (!is.null(file$saved)) {
    # A server that runs the sub-environments in another way plays other episodes.
    names <- c(
      target = "the environment's reward threshold", env_id = "the environment",
      batch_size = "the number of episodes in a batch",
      num_envs = "the number of sub-environments",
      from_model = "whether it learns from the model"
    )
    there <- file$saved$server
    check_same(file$path, there, server, "is from a server with other settings", function(name) {
      paste0("In the file, ", names[[name]], " is ", describe_value(there[[name]]), ", and ",
             describe_value(server[[name]]), " on this server.")
    }, call, are_arguments = FALSE)
    resume_training(state, file$saved)
    # With a larger budget the final evaluation comes later.
    state$final <- NULL
    state$evaluations <- Filter(function(row) row$kind != "final", state$evaluations)
    # With a higher target it goes on.
    stopping <- Filter(function(row) row$kind == "stopping", state$evaluations)
    if (state$solved && !settings$search &&
          !reaches(stopping[[length(stopping)]]$mean_return, settings$target)) {
      state$solved <- state$ended <- FALSE
    }
    played <- played_text(settings, state)
    inform_resumed("Going on from {.path {file$path}}, after {played}.")
  }
  state$path <- file$path
  checkpoint_writer(file, function() {
    list(
      what = settings$what, arguments = file$arguments, server = server,
      given_target = settings$given_target, target = settings$target,
      policy = settings$policy, seed = settings$seed, provenance = settings$provenance,
      training = mget(kept_of_training, state), streams = saved_streams(state$streams),
      evaluation_streams = saved_streams(state$evaluation_streams),
      elapsed = now() - state$started
    )
  }, settings$what, call)
}

resume_training <- function(state, saved) {
  list2env(saved$training, state)
  state$streams <- restore_streams(saved$streams)
  state$evaluation_streams <- restore_streams(saved$evaluation_streams)
  state$started <- state$started - saved$elapsed
}

#' Make the result of a training that has already ended
#' @param client The client for the result of a search.
#' @return A training; `NULL` if there is something left to play.
#' @noRd
finished_training <- function(settings, client) {
  path <- settings$file$path
  saved <- settings$file$saved
  if (!is_same(saved$given_target, settings$target)) {
    return(NULL)
  }
  settings["target"] <- list(saved$target)
  settings[names(saved$server)] <- saved$server
  settings[c("policy", "provenance")] <- saved[c("policy", "provenance")]
  state <- rlang::env(started = now())
  resume_training(state, saved)
  search <- settings$search
  if (!is_over(settings, state) || !search && is.null(state$final)) {
    return(NULL)
  }
  if (search && is_made_by_server(settings$env)) {
    settings$client <- client
  } else if (is_playable(settings$env)) {
    settings$client <- settings$env$client
  }
  inform_resumed(paste(
    "This", settings$what, "has already ended: {.path {path}} has its result.",
    "{.code resume = FALSE} plays it again."
  ))
  training_result(settings, state)
}

# Says that a part of the result comes from an earlier run.
inform_resumed <- function(text, .envir = parent.frame()) {
  cli::cli_inform(c(i = text), class = "gym_message_resumed", .envir = .envir)
}

#' @export
print.gym_checkpoint <- function(x, ...) {
  if (!identical(x$format, checkpoint_format)) {
    line <- paste0("<checkpoint by gym ", x$version, ", which this version cannot read>")
    return(print_lines(x, line))
  }
  saved <- unserialize(x$state)
  training <- saved$training
  print_lines(x, c(
    paste0("<checkpoint of a ", saved$what, " in ", saved$server$env_id, " by ",
           format(training$agent), ">"),
    paste0("Seed ", whole_number_text(saved$seed), ", ",
           count_of(training$iteration, if (saved$what == "search") "round" else "iteration"), ", ",
           count_of(training$steps, "step"), if (training$ended) ", ended"),
    "The call that wrote the file resumes from it: give the file as `checkpoint`.",
    "Its result is a training; this object has none of its elements."
  ))
}

# The same training --------------------------------------------------------------------

# The arguments that must be the same in two runs of one training. The budget and the target may
# differ, except in a search: they determine how rounds are divided into batches, and which count.
training_arguments <- function(settings) {
  numbers <- c(
    "episodes", if (settings$search) "target", "max_steps", "eval_every", "eval_episodes",
    "eval_episodes_curve", "seed"
  )
  agent <- settings$agent
  # It makes no difference where an agent's settings come from. The memory of an agent that goes on
  # is large, so its hash is compared.
  agent$preset <- NULL
  if (inherits(agent$memory, "gym_memory")) agent$memory <- rlang::hash(agent$memory)
  policy <- settings$policy
  # An agent that draws all weights ignores those of the policy, so the distribution is compared.
  if (inherits(agent, "gym_agent_random")) {
    policy <- with_generator(new_generator(1), policy_resample(policy))
  }
  # The training's seed determines weights that are not drawn yet.
  policy$weights_seed <- NULL
  c(
    list(
      env = c(environment_traits(settings$env), kwargs = list(settings$kwargs)),
      agent = agent, policy = policy
    ),
    if (settings$search) list(rounds = settings$iterations),
    settings["evaluate"],
    lapply(settings[numbers], function(x) if (!is.null(x)) as.numeric(x))
  )
}

environment_traits <- function(env) {
  if (is.character(env)) {
    list(env_id = env)
  } else if (inherits(env, "gym_wrapped")) {
    list(env_id = env$env_id, wrappers = env$wrappers)
  } else if (inherits(env, "gym_model")) {
    list(env_id = env$spec$id, model = rlang::hash(list(env$transitions, env$start)))
  } else {
    list(
      env_id = env$spec$id, num_envs = env$num_envs,
      own_implementation = identical(env$vectorization_mode, "vector_entry_point"),
      autoreset_mode = env$autoreset_mode
    )
  }
}

# `line_of(name)` describes how the two values of `name` differ.
check_same <- function(path, there, here, problem, line_of, call, are_arguments = TRUE) {
  differ <- Filter(function(name) !is_same(there[[name]], here[[name]]), names(here))
  if (length(differ)) {
    lines <- vapply(differ, line_of, "")
    abort_checkpoint(path, problem, lines, call, argument = if (are_arguments) differ)
  }
}

is_same <- function(x, y) {
  identical(x, y, ignore.bytecode = TRUE, ignore.environment = TRUE, ignore.srcref = TRUE)
}

argument_text <- function(name, value) {
  switch(
    name,
    env = paste0(value$env_id, if (!is.null(value$num_envs)) {
      paste0(" with ", count_of(value$num_envs, "sub-environment"))
    }),
    policy = policy_text(value),
    agent = format(value),
    if (is.numeric(value)) number_text(value) else describe_value(value)
  )
}

other_file_hint <- paste(
  "Give another file as `checkpoint`, or start again with `resume = FALSE`, which",
  "replaces the file."
)

abort_checkpoint <- function(path, problem, lines = NULL, call, ..., hint = other_file_hint) {
  gym_abort(
    c(
      paste0("The checkpoint \"", path, "\" ", problem, "."),
      if (length(lines)) stats::setNames(lines, rep("x", length(lines))),
      i = hint
    ),
    class = c("gym_error_checkpoint", "gym_error_argument"),
    path = path, ..., call = call
  )
}
