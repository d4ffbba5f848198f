# The file in which a search keeps what it has played, so that it can go on after whatever
# ended it.

#' Make ready to keep a search in a file
#'
#' @param path The file.
#' @param settings As [search_settings()] returns them, with `env` and `seed`.
#' @param resume Whether to go on with what the file has.
#' @return A list: `path`, `arguments` (what fixes the search, in which the file must agree)
#'   and `saved`, what the file has, `NULL` where there is none to go on with.
#' @noRd
open_checkpoint <- function(path, env, settings, resume, call = rlang::caller_env()) {
  # The working directory may be another when the next block has ended.
  path <- normalizePath(path, mustWork = FALSE)
  if (dir.exists(path) || !dir.exists(dirname(path))) {
    problem <- if (dir.exists(path)) "is a folder" else "is in a folder that does not exist"
    abort_checkpoint(path, problem, call = call)
  }
  remove_parts(path)
  arguments <- search_arguments(env, settings)
  saved <- if (resume) read_checkpoint(path, call)
  if (!is.null(saved)) {
    check_same_search(path, saved$arguments, arguments, call)
  }
  list(path = path, arguments = arguments, saved = saved)
}

# What two runs have in common that are the same search. Of a policy what is drawn counts,
# and not what it was given.
search_arguments <- function(env, settings) {
  double <- function(x) if (!is.null(x)) as.numeric(x)
  list(
    env = environment_traits(env),
    policy = keep_random_state({
      set.seed(1, "Mersenne-Twister", "Inversion", "Rejection")
      policy_resample(settings$policy)
    }),
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
  } else {
    list(
      env_id = env$spec$id, num_envs = env$num_envs,
      vectorization_mode = env$vectorization_mode, autoreset_mode = env$autoreset_mode
    )
  }
}

# The same search ------------------------------------------------------------------

check_same_search <- function(path, there, here, call) {
  differ <- Filter(function(name) !is_same(there[[name]], here[[name]]), names(here))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      texts <- c(argument_text(name, there[[name]]), argument_text(name, here[[name]]))
      if (texts[[1L]] == texts[[2L]]) {
        paste0("`", name, "` is another there.")
      } else {
        paste0("`", name, "` is ", texts[[1L]], " there, and ", texts[[2L]], " here.")
      }
    }, "")
    abort_checkpoint(path, "is that of another search", lines, call, argument = differ)
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
    if (is.numeric(value)) number_text(value) else describe_value(value)
  )
}

# The server may offer other sub-environments than it did, and with them other episodes.
check_same_sub_envs <- function(path, told, now, call) {
  differ <- Filter(function(name) !is_same(told[[name]], now[[name]]), names(now))
  if (length(differ)) {
    lines <- vapply(differ, function(name) {
      what <- switch(
        name, target = "the environment's reward threshold", env_id = "the environment",
        block = "how many episodes are played at once",
        num_envs = "how many sub-environments share a seed"
      )
      paste0("There ", what, " is ", describe_value(told[[name]]), ", and ",
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
        "Give another file as `checkpoint`; with `resume = FALSE` the search begins anew and",
        "replaces what is there."
      )
    ),
    class = c("gym_error_checkpoint", "gym_error_argument"),
    path = path, ..., call = call
  )
}

# Going on -------------------------------------------------------------------------

#' Go on with a search where its file has it
#'
#' R's generator too.
#' @noRd
resume_rounds <- function(record, saved, vector_env, settings, path, call) {
  check_same_sub_envs(path, saved$told, told_by_sub_envs(vector_env, settings), call)
  restore_rounds(record, saved)
  finished <- count_finished(record)
  inform_resumed("Going on from {.path {path}}, with {finished} of {settings$rounds} round{?s}.")
  # NULL in a session that had drawn nothing, of a search that had not begun.
  if (!is.null(saved$generator)) {
    restore_random_state(saved$generator)
  }
}

# What the environment itself adds to the arguments.
told_by_sub_envs <- function(vector_env, settings) {
  list(
    target = settings$target, env_id = settings$env_id, num_envs = settings$num_envs,
    block = vector_env$block
  )
}

#' Put a search back to where its file has it
#' @param record As [new_rounds()] returns it.
#' @return The record, with what was played.
#' @noRd
restore_rounds <- function(record, saved) {
  kept <- saved$record
  for (name in c("wanted", "begun", "policies", "returns", "means", "open")) {
    record[[name]] <- kept[[name]]
  }
  record$blocks <- list(list2env(kept$episodes, parent = emptyenv()))
  finished <- count_finished(record)
  if (finished > 0) {
    record$on_round(finished, max(-Inf, record$means[seq_len(finished)], na.rm = TRUE))
  }
  record
}

# So that nobody takes what an earlier run has left for what this one has played.
inform_resumed <- function(text, .envir = parent.frame()) {
  cli::cli_inform(c(i = text), class = "gym_message_resumed", .envir = .envir)
}

#' Make the result of a search whose file says that it had ended
#' @noRd
finished_search <- function(saved, settings, client, path) {
  inform_resumed(
    "This search had ended: {.path {path}} has its result. {.code resume = FALSE} plays it anew."
  )
  told <- saved$told
  settings[names(told)] <- told
  settings["client"] <- list(client)
  settings$policy <- saved$template
  if (is.null(settings$seed)) {
    # As the search left it.
    restore_random_state(saved$generator)
  }
  record <- new_rounds(settings$rounds, settings$episodes, settings$target, function(...) NULL)
  restore_rounds(record, saved)
  new_search(record, settings, proc.time()[["elapsed"]] - saved$elapsed)
}

# Writing --------------------------------------------------------------------------

# So that writing takes a tenth of the time at most, where a block is a single episode.
rest_per_writing <- 9

#' Keep a search in its file from now on
#'
#' After each block of episodes the file is written anew. What it holds grows, and where a
#' block is a single episode, writing might take longer than playing: then some blocks pass
#' without, and would be played again.
#' @param record As [new_rounds()] returns it.
#' @param started When the search began, less what it took before.
#' @noRd
keep_rounds <- function(record, checkpoint, vector_env, settings, started, call) {
  write <- function(record) {
    state <- list(
      arguments = checkpoint$arguments, told = told_by_sub_envs(vector_env, settings),
      template = settings$policy, record = kept_record(record),
      generator = globalenv()$.Random.seed, elapsed = proc.time()[["elapsed"]] - started,
      finished = record$begun >= record$wanted
    )
    write_checkpoint(checkpoint$path, state)
  }
  if (is.null(checkpoint$saved)) {
    tryCatch(
      write(record),
      error = function(cnd) {
        abort_checkpoint(checkpoint$path, "cannot be written", conditionMessage(cnd), call)
      }
    )
  }
  rest_until <- -Inf
  failed <- FALSE
  record$after_block <- function(record) {
    began <- proc.time()[["elapsed"]]
    if (vector_env$block == 1L && began < rest_until && record$begun < record$wanted) {
      return()
    }
    tryCatch(
      write(record),
      error = function(cnd) {
        # A full disk must not end what has played for hours.
        if (!failed) warn_not_kept(checkpoint$path, cnd)
        failed <<- TRUE
      }
    )
    ended <- proc.time()[["elapsed"]]
    rest_until <<- ended + rest_per_writing * (ended - began)
  }
}

warn_not_kept <- function(path, cnd) {
  rlang::warn(
    c(paste0("The checkpoint \"", path, "\" cannot be written; the search goes on without."),
      x = conditionMessage(cnd)),
    class = "gym_warning_checkpoint"
  )
}

# Between blocks: no episode is under way. Of the policies those are kept that the result
# or the next block needs.
kept_record <- function(record) {
  finished <- count_finished(record)
  policies <- record$policies
  needless <- setdiff(seq_len(finished), which.max(record$means[seq_len(finished)]))
  policies[needless] <- list(NULL)
  columns <- c("seed", "sub_env", "return", "length", "terminated", "truncated")
  episodes <- lapply(stats::setNames(nm = columns), function(name) {
    unlist(lapply(record$blocks, function(block) block[[name]]))
  })
  list(
    wanted = record$wanted, begun = record$begun, policies = policies,
    returns = record$returns, means = record$means, open = record$open, episodes = episodes
  )
}
