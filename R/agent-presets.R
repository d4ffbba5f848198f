# Settings that solve an environment, written down beside each other, and the functions that make an
# agent and train it in one call.

#' Settings that solve environments
#'
#' [search_ars()], [search_cem()], [learn_ppo()], [learn_reinforce()] and [learn_dqn()] take these
#' settings where the environment is named by its id and has a row here, and say so. Arguments that
#' are given take the place of the preset's.
#'
#' @param env_id The id of an environment, a string, for its presets alone; `NULL`, the default, for
#'   all.
#' @return A data frame with a row for each preset: `env_id` (a string), `kwargs` (the environment's
#'   own arguments that it is for, as JSON, empty for none), `agent` (`"ars"`, `"cem"`, `"ppo"`,
#'   `"reinforce"` or `"dqn"`), the agent's arguments (see [agent_ars()] and the others; `NA` where
#'   it has no such one, or keeps its default), of the policy of a search `hidden` (how many hidden
#'   neurons a network has, which are tanh and see normalised observations, `NA` for a linear
#'   policy) and `bias` (a logical), of the others `normalize` (whether their network sees
#'   normalised observations), of the training `episodes`,
#'   `total_steps` (its budget), and where they come from: `origin` is `"paper"`, with the `source`, or `"ours"`. `tried` is how
#'   many settings were tried (an integer), with the seeds 1 to 99, before these were chosen;
#'   `vignette("solved")` reports other seeds. Where `linear` is `TRUE`, `learning_rate` and `clip`
#'   go from their numbers to 0 in `total_steps`; `epsilon` goes from 1 to its number in
#'   `epsilon_steps`.
#' @section Errors: `gym_error_argument` when `env_id` is no string.
#' @export
#' @examples
#' agent_presets()[c("env_id", "agent", "directions", "step_size", "noise", "origin")]
agent_presets <- function(env_id = NULL) {
  check_string(env_id, allow_null = TRUE)
  file <- system.file("extdata", "agent-presets.csv", package = "gym", mustWork = TRUE)
  presets <- utils::read.csv(file, stringsAsFactors = FALSE)
  for (name in c("kwargs", "source")) {
    presets[[name]][is.na(presets[[name]])] <- ""
  }
  if (!is.null(env_id)) {
    presets <- presets[presets$env_id == env_id, ]
  }
  row.names(presets) <- NULL
  presets
}

# The preset of an agent for an environment with these arguments, a list; `NULL` where there is
# none.
find_preset <- function(agent, env, kwargs) {
  if (!is.character(env)) {
    return(NULL)
  }
  presets <- agent_presets(env)
  presets <- presets[presets$agent == agent, ]
  for (row in seq_len(nrow(presets))) {
    preset <- as.list(presets[row, ])
    own <- if (nzchar(preset$kwargs)) from_json(preset$kwargs) else list()
    if (identical(sorted_by_name(own), sorted_by_name(kwargs))) {
      return(preset_settings(preset))
    }
  }
  NULL
}

# What a row of the table has.
preset_settings <- function(row) {
  Filter(function(value) !is.na(value) && !identical(value, ""), as.list(row))
}

# What a preset gives the function that makes its agent.
preset_arguments <- function(preset) {
  if (isTRUE(preset$linear)) {
    falling <- intersect(c("learning_rate", "clip"), names(preset))
    preset[falling] <- lapply(preset[falling], schedule_linear, 0, preset$total_steps)
  }
  if (!is.null(preset$epsilon_steps)) {
    preset$epsilon <- schedule_linear(1, preset$epsilon, preset$epsilon_steps)
  }
  preset[intersect(names(formals(preset_maker(preset))), names(preset))]
}

preset_maker <- function(preset) get(paste0("agent_", preset$agent), mode = "function")

# The agent of a row of the table.
preset_agent <- function(row) {
  preset <- preset_settings(row)
  rlang::exec(preset_maker(preset), !!!preset_arguments(preset))
}

# An empty list may have names or none.
sorted_by_name <- function(values) if (length(values)) values[order(names(values))] else list()

#' Make an agent and train it
#'
#' @param make The function that makes the agent, its name.
#' @param frame The frame of the user's call, which has the agent's arguments, `env` and some of
#'   [train_agent()]. What is `NULL` was not given.
#' @param ... Further arguments of [train_agent()], and the environment's own.
#' @noRd
make_and_train <- function(make, frame, ...) {
  check_no_steps(...names(), frame)
  given <- lapply(rlang::set_names(ls(frame)), function(name) eval(as.name(name), frame))
  env <- given$env
  given <- Filter(Negate(is.null), given[names(given) != "env"])
  dots <- list(...)
  check_environment(env, "env", frame)
  of_agent <- names(formals(make))
  of_training <- names(formals(train_agent))
  kwargs <- dots[!names(dots) %in% of_training]
  preset <- find_preset(sub("agent_", "", make), env, kwargs)
  own <- intersect(of_agent, names(given))
  arguments <- if (!is.null(preset)) preset_arguments(preset) else list()
  # A part of the candidates that was meant for another number of them, or another version.
  if (any(c("directions", "version") %in% own)) arguments$top <- NULL
  if ("population" %in% own) arguments$elite <- NULL
  arguments[own] <- given[own]
  agent <- naming_own_call(rlang::exec(make, !!!arguments), make, frame)
  training <- c(given[setdiff(names(given), own)], dots[names(dots) %in% of_training])
  # A budget of the user's own is the only one.
  budget <- any(c("iterations", "total_steps") %in% names(training))
  check_spelling(names(kwargs), c(of_agent, of_training), budget || !is.null(preset), frame)
  if (is.null(preset) && !budget) {
    abort_no_budget(preset_hints(env, kwargs), frame)
  }
  if (!is.null(preset)) {
    from_preset <- setdiff(c("episodes", if (!budget) "total_steps"), names(training))
    training[from_preset] <- preset[from_preset]
    training$policy <- training$policy %||% preset_policy(preset, agent)
    inform_of_preset(preset, env)
    agent$preset <- preset[intersect(c("env_id", "kwargs", "origin", "source"), names(preset))]
    agent$preset$changed <- intersect(names(given), c(names(preset), "policy", "iterations"))
  }
  naming_own_call(
    rlang::exec("train_agent", agent, env, !!!training, !!!kwargs), "train_agent", frame
  )
}

preset_hints <- function(env, kwargs) {
  presets <- if (is.character(env)) agent_presets(env)
  known <- paste0("\"", presets$agent, "\"", ifelse(nzchar(presets$kwargs), " with ", ""),
                  presets$kwargs, collapse = ", ")
  c(
    i = if (NROW(presets)) {
      paste0("The presets of ", env, " have one, but are for other arguments or another agent: ",
             known, ".")
    },
    i = if (length(kwargs)) {
      paste0("These were taken for the environment's own: ",
             paste0("`", names(kwargs), "`", collapse = ", "), ".")
    }
  )
}

preset_policy <- function(preset, agent) {
  if (inherits(agent, "gym_agent_gradient")) {
    policy <- default_policy(agent)
    if (isTRUE(preset$normalize)) policy$moments <- no_moments()
    policy
  } else if (is.null(preset$hidden)) {
    policy_linear(bias = preset$bias)
  } else {
    policy_network(
      c(NA, preset$hidden, NA), c("tanh", "identity"), bias = preset$bias, normalize = TRUE
    )
  }
}

inform_of_preset <- function(preset, env) {
  origin <- if (preset$origin == "paper") paste0("paper: ", preset$source) else "ours"
  cli::cli_inform(
    c(i = "Taking the preset for {env} ({origin}), see {.code agent_presets(\"{env}\")}."),
    class = "gym_message_preset"
  )
}
