# A search keeps what it has played in a file, the checkpoint, from which it can go on after it was
# ended.

#' Prepare to keep a search or a training in a file
#'
#' @param path The file.
#' @param arguments What fixes it, a list, in which the file must agree.
#' @param resume Whether to go on with what the file has.
#' @param what What is kept, `"search"` or `"training"`.
#' @return A list: `path`, `arguments`, `saved`, what the file has, `NULL` where there is none to
#'   go on with, and `mark`, by which the file is known again.
#' @noRd
open_checkpoint <- function(path, arguments, resume, what = "search",
                            call = rlang::caller_env()) {
  # The file that a link leads to is replaced, not the link.
  path <- normalizePath(absolute_path(path), mustWork = FALSE)
  if (dir.exists(path) || !dir.exists(dirname(path))) {
    problem <- if (dir.exists(path)) "is a folder" else "is in a folder that does not exist"
    abort_checkpoint(path, problem, call = call)
  }
  remove_parts(path)
  mark <- file_mark(path)
  saved <- if (resume) read_checkpoint(path, call)
  if (!is.null(saved)) {
    if (!identical(saved$what, what)) {
      abort_checkpoint(path, paste("is that of a", saved$what), call = call)
    }
    check_same_search(path, saved$arguments, arguments, what, call)
  }
  list(path = path, arguments = arguments, saved = saved, mark = mark)
}

# What must be the same in two runs of one search. Policies are compared by what is drawn from them,
# not by the weights that they have.
search_arguments <- function(env, settings) {
  double <- function(x) if (!is.null(x)) as.numeric(x)
  list(
    env = environment_traits(env),
    policy = with_generator(new_generator(1), policy_resample(settings$policy)),
    rounds = settings$rounds, episodes = settings$episodes,
    target = double(settings$target), max_steps = double(settings$max_steps),
    seed = double(settings$seed)
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

# The same search ------------------------------------------------------------------

check_same_search <- function(path, there, here, what, call) {
  differ <- Filter(function(name) !is_same(there[[name]], here[[name]]), names(here))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      texts <- c(argument_text(name, there[[name]]), argument_text(name, here[[name]]))
      if (texts[[1L]] == texts[[2L]]) {
        paste0("`", name, "` is another there", if (name == "policy") ", with other weights", ".")
      } else {
        paste0("`", name, "` is ", texts[[1L]], " there, and ", texts[[2L]], " here.")
      }
    }, "")
    abort_checkpoint(path, paste("is that of another", what), lines, call, argument = differ)
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

# Another server may run the sub-environments in another way, and with it play other episodes.
check_same_server <- function(path, there, now, call) {
  differ <- Filter(function(name) !is_same(there[[name]], now[[name]]), names(now))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      what <- switch(
        name, target = "the environment's reward threshold", env_id = "the environment",
        batch_size = "how many episodes make a batch",
        num_envs = "how many sub-environments there are"
      )
      paste0("There ", what, " is ", describe_value(there[[name]]), ", and ",
             describe_value(now[[name]]), " on this server.")
    }, "")
    abort_checkpoint(path, "is from a server that played otherwise", lines, call)
  }
}

abort_checkpoint <- function(path, problem, lines = NULL, call, ...) {
  gym_abort(
    c(
      paste0("The checkpoint \"", path, "\" ", problem, "."),
      if (length(lines)) stats::setNames(lines, rep("x", length(lines))),
      i = paste(
        "Give another file as `checkpoint`; `resume = FALSE` begins anew and replaces what is",
        "there."
      )
    ),
    class = c("gym_error_checkpoint", "gym_error_argument"),
    path = path, ..., call = call
  )
}

# Resuming -------------------------------------------------------------------------

# Settings that the server decides, beside the arguments.
settings_of_server <- function(vector_env, settings) {
  list(
    target = settings$target, env_id = settings$env_id, num_envs = settings$num_envs,
    batch_size = vector_env$batch_size
  )
}

# Says that a part of the result comes from an earlier run.
inform_resumed <- function(text, .envir = parent.frame()) {
  cli::cli_inform(c(i = text), class = "gym_message_resumed", .envir = .envir)
}
