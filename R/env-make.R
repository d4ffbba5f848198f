#' Make an environment
#'
#' Make an environment with the methods `$reset()` and `$step()`, as in Gymnasium's documentation.
#' By default the environment is on the session's own server, which `gym_make()` starts if
#' necessary.
#'
#' The environment stays open until you call `$close()`, until R's garbage collector removes the
#' object, or until the session ends. Keep the object as long as you use the environment.
#'
#' With `num_envs`, the result is a vector environment. It has sub-environments: copies of the
#' environment that one call resets or steps together. Observations and actions then have a row for
#' each sub-environment; [env_reset()] and [env_step()] describe their forms.
#'
#' For an Atari game, Python's `make_vec()` uses the game's own vector environment. Its observations
#' are the last four frames, in grey, 84 x 84 pixels. `gym_make()` instead makes sub-environments
#' that are the same as a single environment: each observes one frame. To get what Python gives, use
#' `vectorization_mode = "vector_entry_point"`. It supports `autoreset_mode`, a seed below 2^31 for
#' each sub-environment, the mask of a reset, and the game's own arguments, such as
#' `reward_clipping`. It limits the frames of an episode (`max_num_frames_per_episode`) and has no
#' `max_episode_steps`.
#'
#' # Names of observations
#'
#' If Gymnasium's documentation names the numbers of an observation, as for CartPole, the results of
#' `$reset()` and `$step()` have these names: `observation["pole_angle"]`. With `num_envs` they are
#' column names: `observations[, "pole_angle"]`. The parts of a Tuple, such as Blackjack's, have
#' names as well. `$single_observation_space$names` lists them. It is `NULL` for other environments,
#' and if a wrapper such as `NormalizeObservation` changes the observations. With
#' `TransformObservation`, the names are those of its `observation_space`. The classic calls return
#' observations without names. Pictures show units and limits only if no wrapper changes the
#' observations.
#'
#' # After the end of an episode
#'
#' Without `num_envs`, call `$reset()` after a step whose `done` is `TRUE`. With `num_envs`, some
#' episodes end while others go on, and `autoreset_mode` decides what happens. With the default,
#' `"NextStep"`, the next `$step()` resets a sub-environment whose episode has ended: it ignores the
#' action and returns the first observation of the new episode, the reward 0, and neither
#' `terminated` nor `truncated`. Leave that step out when you sum rewards or count steps, as
#' [rollout()] does. With `"SameStep"` the step that ends an episode already returns the first
#' observation of the next one. With `"Disabled"` you call `$reset(mask = )`. In all modes, the
#' element `next_observation` of the result is the observation after the step. At the end of an
#' episode it is the last observation of that episode, not the first one of the next.
#'
#' @inheritParams env_create
#' @param ... Further arguments of the environment, by name, such as `sutton_barto_reward = TRUE`
#'   for CartPole. Every environment accepts `max_episode_steps`, which replaces its own step limit;
#'   -1 removes it. For FrozenLake, `desc = NULL, map_name = NULL` draws a random map from the seed,
#'   the same for all sub-environments; `$spec$kwargs$desc` has it.
#' @param seed The seed of the first reset (unless `$reset()` gets one) and of action sampling: a
#'   whole number of at least 0. A vector environment also accepts one seed for each
#'   sub-environment, see [env_reset()]. `NULL`, the default, draws a seed from R's generator, so
#'   [set.seed()] fixes it.
#' @param client A client. The default is the session's client, [gym_client()].
#' @return An object of class `gym_env` with
#'   * `$reset(seed = NULL, options = NULL, return_info = FALSE, mask = NULL, infos = TRUE)`: starts
#'     an episode and returns the first observation, as [env_reset()]; with `infos = FALSE` the
#'     server makes no infos, which is faster,
#'   * `$step(action, which = NULL, infos = TRUE, finals = TRUE)`: takes a step and returns a list,
#'     as [env_step()]; with `finals = FALSE` its `next_observation` equals its `observation`,
#'   * `$render(which = 1)`: the current frame, as [env_render()],
#'   * `$watch()`: opens the page that shows it live, as [env_watch()],
#'   * `$close()`: removes it from the server,
#'   * `$is_open`: `FALSE` after `$close()` or if the environment's server or session has ended,
#'     otherwise `TRUE`,
#'   * `$action_space`, `$observation_space`: the spaces, as [env_action_space_info()],
#'   * `$single_action_space`, `$single_observation_space`: the spaces of one sub-environment; in a
#'     single environment, the same as the two above,
#'   * `$num_envs`, `$vectorization_mode`, `$num_workers`, `$autoreset_mode`: the number of
#'     sub-environments and their settings, see [env_create()]; `NULL` in a single environment.
#'     `$num_workers` is also `NULL` with a vector implementation,
#'   * `$spec`: a list of `id`, `reward_threshold`, `max_episode_steps` (the smallest limit,
#'     including wrappers) and `render_fps` (frames per second), each of these three `NULL` if the
#'     environment has none; `engine` (the version of the package that simulates it, by the
#'     package's name, such as mujoco; absent if Gymnasium itself does); `wrappers` (their names)
#'     and `kwargs` (the environment's arguments),
#'   * `$client`, `$instance_id`: for the classic calls.
#' @section Warnings: Gymnasium's own warnings have class `gym_warning_gymnasium` and appear once
#'   per session, for example for an outdated id.
#' @section Errors: As for [env_create()]. `gym_error_server_start` if no server could be started.
#'   `gym_error_install` if the server's Python environment could not be installed.
#'   `gym_error_argument` for a name after the dollar that the object does not have.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' env$reset()
#' str(env$step(1))
#' env$close()
#'
#' # An episode of MountainCar has 200 steps at most, unless it is given more.
#' long <- gym_make("MountainCar-v0", max_episode_steps = 1000)
#' long$spec$max_episode_steps
#' long$close()
#'
#' framed <- gym_make("CartPole-v1", wrappers = list(list("FrameStackObservation", stack_size = 4)))
#' framed$observation_space$shape
#' framed$close()
#'
#' # A hundred poles. Push each cart to the side to which its pole leans.
#' poles <- gym_make("CartPole-v1", num_envs = 100, seed = 1)
#' poles
#' observation <- poles$reset()
#' for (step in 1:20) {
#'   out <- poles$step(observation[, "pole_angle"] > 0)
#'   observation <- out$observation
#' }
#' summary(observation[, "pole_angle"])
#' poles$close()
gym_make <- function(env_id, ..., seed = NULL, render_mode = NULL, num_envs = NULL,
                     wrappers = list(), client = gym_client(), vectorization_mode = NULL,
                     autoreset_mode = NULL, name = NULL, num_workers = NULL) {
  match_whole_names()
  make_unseeded(
    env_id = env_id, ..., seed = seed %||% draw_seed(), render_mode = render_mode,
    num_envs = num_envs, wrappers = wrappers, client = client,
    vectorization_mode = vectorization_mode, autoreset_mode = autoreset_mode, name = name,
    num_workers = num_workers, call = rlang::current_env()
  )
}

# As gym_make(), but does not draw a seed.
make_unseeded <- function(env_id, ..., seed = NULL, render_mode = NULL, num_envs = NULL,
                          wrappers = list(), client = gym_client(), vectorization_mode = NULL,
                          autoreset_mode = NULL, name = NULL, num_workers = NULL,
                          call = rlang::caller_env()) {
  kwargs <- list(...)
  check_dots_named(kwargs, "seed = 1", call)
  given <- given_id(env_id)
  if (isTRUE(given$registered)) {
    return(make_registered_env(
      env_id, kwargs, seed, num_envs, render_mode = render_mode, wrappers = wrappers,
      vectorization_mode = vectorization_mode, autoreset_mode = autoreset_mode, name = name,
      num_workers = num_workers, call = call
    ))
  }
  check_client(client, call = call)
  kwargs <- with_random_map(env_id, kwargs, seed)
  check_wrappers(wrappers, call = call)
  wrappers <- split_wrappers(c(given$wrappers, wrappers), call)
  env_id <- given$id %||% env_id
  env <- NULL
  instance_id <- NULL
  on.exit(if (is.null(env)) close_unused(client, instance_id))
  # No interrupt may come between creating the instance and storing its id.
  suspendInterrupts(instance_id <- allowInterrupts(withCallingHandlers(
    create_instance(
      client, env_id, seed, render_mode, kwargs, wrappers$server, num_envs, vectorization_mode,
      autoreset_mode, name, num_workers, call = call
    ),
    gym_error_http_400 = function(cnd) explain_unknown_argument(cnd, names(kwargs), call)
  )))
  env <- server_env$new(client, instance_id, wrappers$server, kwargs)
  for (wrapper in wrappers$r) env <- wrap_server_env(env, wrapper[[1L]], wrapper[-1L], call)
  env
}

# The names of the arguments that do not belong to the environment.
how_made <- setdiff(names(formals(make_unseeded)), c("env_id", "...", "client", "call"))

# Replaces Python's error about an unknown argument of the environment by one in R's words.
explain_unknown_argument <- function(cnd, given, call) {
  pattern <- "unexpected keyword argument '([^']+)'"
  name <- regmatches(cnd$message, regexec(pattern, cnd$message))[[1L]][2L]
  if (!name %in% given) {
    return()
  }
  passed <- c(passed_on_by(name), list(gym_make = gym_make))
  others <- passed[names(passed) != "gym_make"]
  own <- arguments_of(if (length(others)) others else passed[1L])
  # Every environment accepts `max_episode_steps`.
  choices <- c(arguments_of(passed), "max_episode_steps")
  by <- paste0("`", names(passed)[[1L]], "()`")
  gym_abort(
    c(paste0("Neither ", by, " nor the environment has an argument `", name, "`."),
      i = did_you_mean(name, choices) %||%
        paste0(by, " has ", quoted_names(own),
               "; see the environment's documentation for those of its own.")),
    class = class(cnd)[seq_len(match("gym_error", class(cnd)) - 1L)],
    status = cnd$status, code = cnd$code, argument = name, call = call
  )
}

#' Find the functions that passed an argument on in their `...`
#' @return A named list of exported functions, first the one that the user called. If a function
#'   of this package has a local string `make`, it passes the argument on to the function of that
#'   name and to train_agent().
#' @noRd
passed_on_by <- function(name) {
  exported <- mget(getNamespaceExports(topenv()), topenv(), "function", list(NULL))
  passed <- lapply(seq_len(sys.nframe() - 1L), function(at) {
    f <- sys.function(at)
    is_ours <- identical(environment(f), topenv())
    make <- if (is_ours) get0("make", sys.frame(at), inherits = FALSE)
    if (rlang::is_string(make)) {
      return(mget(c(make, "train_agent"), topenv()))
    }
    passes <- "..." %in% names(formals(f)) && name %in% evalq(...names(), sys.frame(at))
    if (passes) Filter(function(one) identical(one, f), exported)
  })
  unlist(passed)
}

arguments_of <- function(functions) {
  names <- unlist(lapply(functions, function(f) names(formals(f))))
  setdiff(names, c("env_id", "env", "agent", "x", "..."))
}

server_env <- R6Class(
  c("gym_server_env", "gym_env"), cloneable = FALSE, lock_class = TRUE,
  public = list(
    instance_id = NULL, single_action_space = NULL, single_observation_space = NULL,
    num_envs = NULL, vectorization_mode = NULL, num_workers = NULL, autoreset_mode = NULL,
    spec = NULL,
    initialize = function(client, instance_id, wrappers = list(), kwargs = list()) {
      private$instance <- known_instance(client, instance_id)
      private$pid <- Sys.getpid()
      self$instance_id <- instance_id
      for (name in c("single_action_space", "single_observation_space", "num_envs",
                     "vectorization_mode", "num_workers", "autoreset_mode")) {
        self[[name]] <- private$instance[[name]]
      }
      self$spec <- private$instance$spec
      self$spec$wrappers <- wrapper_names(wrappers)
      self$spec$kwargs <- kwargs
    },
    reset = function(seed = NULL, options = NULL, return_info = FALSE, mask = NULL,
                     infos = TRUE) {
      check_open(self)
      check_flag(return_info)
      reset_instance(
        private$instance, seed, options, return_info, mask, named = TRUE, infos = infos
      )
    },
    step = function(action, which = NULL, infos = TRUE, finals = TRUE) {
      if (private$closed) check_open(self)
      if (missing(action)) check_given(action)
      step_instance(
        private$instance, action, which, named = TRUE, infos = infos, finals = finals,
        call = environment(), check_ended = check_open(self)
      )
    },
    render = function(which = 1) {
      check_open(self)
      env_render(self$client, self$instance_id, which)
    },
    watch = function() {
      check_open(self)
      env_watch(self$client, self$instance_id)
    },
    close = function() {
      if (self$is_open) close_if_there(self$client, self$instance_id)
      private$closed <- TRUE
      invisible(self)
    },
    print = function(...) {
      workers <- if (isTRUE(self$num_workers > 0)) count_of(self$num_workers, "worker")
      how <- paste(c(self$vectorization_mode, workers, self$autoreset_mode), collapse = ", ")
      print_env(self, how, private$instance$observations, private$instance$actions)
    }
  ),
  active = list(
    client = function() private$instance$client,
    action_space = function() instance_space(private$instance, "action_space"),
    observation_space = function() instance_space(private$instance, "observation_space"),
    is_open = function() {
      if (!private$closed && is.null(private$ended)) {
        private$ended <- end_of_instance(self$client, self$instance_id, private$pid)
      }
      !private$closed && is.null(private$ended)
    }
  ),
  private = list(
    instance = NULL, pid = NULL, closed = FALSE,
    # If the server or the session ended first: text that says so.
    ended = NULL,
    finalize = function() {
      # In a forked child the environment still belongs to the parent.
      if (!private$closed && identical(private$pid, Sys.getpid())) {
        queue_closing(self$client, self$instance_id)
      }
    }
  )
)

# `how` says how its sub-environments run.
print_env <- function(env, how, observations, actions) {
  sub_envs <- if (!is.null(env$num_envs)) {
    paste0(", ", count_of(env$num_envs, "sub-environment"), " (", how, ")")
  }
  id <- wrapped_id(env$spec$id, env$spec$wrappers)
  state <- if (!env$is_open) paste(",", end_text(env))
  cat("<gym_env: ", id, sub_envs, state, ">\n", sep = "")
  line <- function(what, space, names) {
    cat("  ", what, format(space), if (length(names)) paste(":", few_names(names)), "\n", sep = "")
  }
  line("observations: ", observations, env$single_observation_space$names)
  line("actions:      ", actions, env$single_action_space$names)
  invisible(env)
}

# Why an environment is not open, as text.
end_text <- function(env) {
  ended <- env$.__enclos_env__$private$ended
  if (is.null(ended)) "closed" else paste("made", ended)
}

# print() already shows a summary.
#' @export
summary.gym_env <- function(object, ...) object

# A name that an environment does not have is an error. (R's own `$` returns NULL, and calling that
# fails with "attempt to apply non-function".) `[[` returns NULL. Every step calls this method, so
# it must be fast.
#' @export
`$.gym_env` <- function(x, name) {
  member <- .subset2(x, name)
  if (is.null(member) && !exists(name, envir = x, inherits = FALSE)) {
    members <- setdiff(ls(x), c("initialize", "print"))
    abort_wrong(name, NULL, rlang::current_env(), "An environment has no `${name}`.",
                i = did_you_mean(name, members, "`$%s`"),
                i = paste0("It has ", paste0("`$", members, "`", collapse = ", "), "."))
  }
  member
}

# R6's own method reads `x$format`, which an environment does not have.
#' @export
format.gym_env <- function(x, ...) {
  paste0("<gym_env: ", wrapped_id(x$spec$id, x$spec$wrappers), ">")
}

check_open <- function(env, call = rlang::caller_env()) {
  if (!env$is_open) {
    hint <- paste0("`gym_make(\"", env$spec$id, "\")` makes a new one.")
    abort_closed(hint, call, end_text(env), env$client)
  }
}

# `end` says how the environment ended. `client` is the client of the server, which may have
# ended, too.
abort_closed <- function(hint, call, end = "closed", client = NULL) {
  closed <- end == "closed"
  gym_abort(
    c(paste0("This environment was ", end, "."),
      if (!closed) end_bullets(client$remote_base), i = hint),
    # The user made a mistake if they closed the environment. If its server ended, the connection
    # was lost.
    class = if (closed) "gym_error_argument" else "gym_error_connection",
    argument = if (closed) "env", call = call
  )
}
