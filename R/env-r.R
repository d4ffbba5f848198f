#' Make an environment from R functions
#'
#' Make an environment that works like those of [gym_make()] from two functions: one that starts an
#' episode, and one that takes a step. It does not need a server.
#'
#' The functions keep their state in `self`, an R environment: `self$position <- 0`. Each
#' sub-environment has its own `self`, so [rollout()] and every search can play many of them
#' together. They do not change the environment that you pass.
#'
#' Each step checks the results of the functions. An observation must belong to the observation
#' space, a reward must be one number, and a flag must be `TRUE` or `FALSE`. Numbers that are not
#' integers may exceed a bound by a rounding error of 1e-6 times the bound, or of 1e-6 if that is
#' larger. Actions are checked before `step` gets them, but `step` also gets a Box action outside
#' its bounds, as in Gymnasium. [check_env()] checks more.
#'
#' # Random numbers
#'
#' Each environment and each sub-environment has its own random generator. In `reset` and `step`,
#' `runif()`, `sample()` and all other random functions use it, and the session's generator does not
#' change. `$reset(seed = 1)` sets its seed. The session's `RNGkind()` makes no difference. A seed
#' of at most 2^31 - 1 is like [set.seed()] for R's generator `"L'Ecuyer-CMRG"`. Each larger seed,
#' up to 2^53, selects a random stream of its own. If you give no seed, the first reset draws one
#' from the session's generator, so [set.seed()] fixes it, too.
#'
#' # Vectorised functions
#'
#' With `vectorized = TRUE` the functions play all sub-environments at once, which is many times
#' faster if they compute with whole vectors. `self$num_envs` is the number of sub-environments.
#' `reset` returns a batch of observations, for a Box of one dimension a matrix with a row for each
#' sub-environment. `step` gets a batch of actions and returns a batch of observations and vectors
#' for `reward`, `terminated` and `truncated`. `step` continues to step sub-environments whose
#' episode has ended, until all are reset; their results are ignored. All sub-environments share one
#' random generator.
#'
#' @param reset A function of `self` that starts an episode and returns the first observation. With
#'   a second argument `options` it gets the options of `$reset(options = )`.
#' @param step A function of `self` and `action` that takes a step and returns a list of
#'   `observation`, `reward` (a number), `terminated` (whether the episode ended by the
#'   environment's own rules) and optionally `truncated` (whether it was cut off, default `FALSE`)
#'   and `info` (a list).
#' @param observation_space,action_space The spaces, such as `space_box(-1, 1, shape = 2)` and
#'   `space_discrete(3)`.
#' @param ... Further values, by name, with which each `self` starts, such as `size = 5` for
#'   `self$size`. Create R environments and R6 objects in `reset` instead: here they are an error,
#'   also in a list, because all sub-environments would share them. In a vectorised environment,
#'   `num_envs` is the number of sub-environments of this object, 256 by default.
#' @param render A function of `self` that draws the environment. It plots with R's graphics, or
#'   returns a picture: a raster image, a matrix of greys or of colours, or an array of height x
#'   width x 3. `NULL`, the default, for an environment that cannot be drawn.
#' @param vectorized Do the functions play all sub-environments at once? `FALSE`, the default, or
#'   `TRUE`.
#' @param model The environment's [model][gym_model()], for [env_model()]; the table of its
#'   transitions; or a function of the environment that returns one of them. `NULL`, the default,
#'   for none. The environment's spaces must be Discrete, and may have more states and actions than
#'   the table. With a table, 1000 resets estimate where episodes start; if `reset` is not random,
#'   this is exact.
#' @param id The name of the environment in messages and titles, a string.
#' @param max_episode_steps The number of steps after which an episode is cut off, a whole number.
#'   `NULL`, the default, for no limit.
#' @param reward_threshold The mean return from which the environment counts as solved, a number.
#'   `NULL`, the default, for none.
#' @param render_fps The number of frames per second. `NULL`, the default, leaves it to [animate()].
#' @return An object of class `gym_r_env` and `gym_env` with
#'   * `$reset(seed = NULL, options = NULL, return_info = FALSE)`: starts an episode and returns the
#'     first observation, or a list of `observation` and `info`,
#'   * `$step(action)`: takes a step and returns a list of `observation`, `reward`, `done`, `info`,
#'     `terminated` and `truncated`, as [env_step()],
#'   * `$render()`: the current frame, as [env_render()],
#'   * `$close()`, `$is_open`,
#'   * `$observation_space`, `$action_space`, and `$single_observation_space`,
#'     `$single_action_space`, which differ from them in a vectorised environment,
#'   * `$num_envs`: `NULL`, or the number of sub-environments of a vectorised environment,
#'   * `$spec`: a list of `id`, `reward_threshold`, `max_episode_steps` and `render_fps`.
#' @section Errors: `gym_error_argument` for an invalid argument, and in `$reset()` and `$step()`
#'   for an invalid result of your function. `gym_error_space` for an action or an observation that
#'   does not fit its space. `gym_error_environment` if your function raises an error. It also has
#'   the classes of your error, which is its `parent`.
#' @section Warnings: `gym_warning_step_after_done`.
#' @seealso [gym_register()], [check_env()], `vignette("own-environment")`
#' @export
#' @examples
#' # Walk to the right end of a corridor, on slippery ground.
#' corridor <- gym_env(
#'   reset = function(self) {
#'     self$position <- 0
#'     self$position
#'   },
#'   step = function(self, action) {
#'     slips <- runif(1) < 0.1
#'     move <- if (xor(action == 1, slips)) 1 else -1
#'     self$position <- min(max(self$position + move, 0), self$size - 1)
#'     list(
#'       observation = self$position, reward = -1,
#'       terminated = self$position == self$size - 1
#'     )
#'   },
#'   observation_space = space_discrete(5), action_space = space_discrete(2),
#'   size = 5, id = "Corridor", max_episode_steps = 100
#' )
#' corridor
#' corridor$reset(seed = 1)
#' str(corridor$step(1))
#'
#' rollout(corridor, policy_random(), episodes = 100, seed = 1)
gym_env <- function(reset, step, observation_space, action_space, ..., render = NULL,
                    vectorized = FALSE, model = NULL, id = "R-environment",
                    max_episode_steps = NULL, reward_threshold = NULL, render_fps = NULL) {
  match_whole_names()
  check_takes(reset, "self")
  check_takes(step, c("self", "action"))
  if (!is.null(render)) check_takes(render, "self")
  check_flag(vectorized)
  if (!is.null(model) && !is.function(model) && !inherits(model, c("data.frame", "gym_model"))) {
    must <- "a model, a data frame of transitions, a function that returns one, or NULL"
    abort_argument(model, must, "model", rlang::current_env())
  }
  parameters <- list(...)
  check_dots_named(parameters, "size = 5")
  check_not_shared(parameters)
  # A missing space raises the same error as NULL.
  if (missing(observation_space)) observation_space <- NULL
  if (missing(action_space)) action_space <- NULL
  traits <- new_traits(
    observation_space, action_space, id, max_episode_steps, reward_threshold, render_fps
  )
  r_env$new(list(
    traits = traits, reset = reset, step = step, render = render, vectorized = vectorized,
    parameters = parameters, model = model
  ))
}

# An environment written in R. Sub-environments are made from its `definition`: `traits`, the
# functions, `vectorized`, `parameters` (the values with which each `self` starts), and `wrappers`,
# see wrap_r_env().
r_env <- R6Class(
  c("gym_r_env", "gym_env"), cloneable = FALSE,
  public = list(
    observation_space = NULL, action_space = NULL, single_observation_space = NULL,
    single_action_space = NULL, num_envs = NULL, vectorization_mode = NULL, autoreset_mode = NULL,
    spec = NULL, client = NULL,
    initialize = function(definition) {
      traits <- definition$traits
      private$definition <- definition
      private$sub_env <- definition_sub_env(definition)
      n <- private$sub_env$num_envs
      spread <- function(space) if (is.null(n)) space else spread_bounds(batch_space(space, n))
      self$single_observation_space <- traits$observation_space
      self$single_action_space <- traits$action_space
      self$observation_space <- spread(traits$observation_space)
      self$action_space <- spread(traits$action_space)
      self$num_envs <- n
      self$spec <- traits$spec
    },
    reset = function(seed = NULL, options = NULL, return_info = FALSE) {
      check_sub_env_open(private$sub_env)
      check_seed(seed, min = 0)
      check_flag(return_info)
      if (!is.null(options)) check_named_list(options)
      observation <- reset_sub_env(private$sub_env, seed, options, call = rlang::current_env())
      if (return_info) list(observation = observation, info = list()) else observation
    },
    step = function(action) step_r_env(private$sub_env, action),
    render = function() {
      call <- rlang::current_env()
      sub_env <- private$sub_env
      check_sub_env_open(sub_env, call)
      check_was_reset(sub_env, call)
      check_renders(sub_env, call)
      drawn <- draw_sub_env(sub_env, call)
      if (is.raw(drawn)) frame_from_png(drawn) else drawn
    },
    close = function() {
      private$sub_env$closed <- TRUE
      invisible(self)
    },
    print = function(...) {
      print_env(self, "vectorised", self$observation_space, self$action_space)
    }
  ),
  active = list(is_open = function() !private$sub_env$closed),
  private = list(definition = NULL, sub_env = NULL)
)

sub_env_of <- function(env) env$.__enclos_env__$private$sub_env

# NULL for any other environment.
definition_of <- function(env) {
  if (inherits(env, "gym_r_env")) env$.__enclos_env__$private$definition
}

#' Make a sub-environment from functions, with its own `self`
#'
#' For a vectorised environment, one such object holds all sub-environments.
#' @param num_envs The number of sub-environments of a vectorised environment.
#' @return An environment: `traits`; `reset`, a function of `seed` and `options` that returns the
#'   first observation; `step`, a function of an action; `render`, a function without arguments, or
#'   `NULL`; `takes_options`, whether the user's `reset()` accepts options; `num_envs`, `NULL` if it
#'   is not vectorised; `generator`, its random generator, `NULL` before first use; `taken`, the
#'   number of steps in the episode, `NA` before the first reset; `ended`, whether the episode has
#'   ended, `NA` after the warning about a step after the end; `closed`.
#' @noRd
definition_sub_env <- function(definition, num_envs = NULL) {
  reset <- definition$reset
  step <- definition$step
  render <- definition$render
  self <- list2env(definition$parameters, parent = environment(step) %||% globalenv())
  if (definition$vectorized) {
    num_envs <- num_envs %||% definition$parameters$num_envs %||% vectorized_sub_envs
    check_count(num_envs, call = NULL)
    self$num_envs <- num_envs <- as.integer(num_envs)
  }
  takes_options <- "options" %in% names(formals(reset))
  functions <- list(
    reset = function(seed, options) {
      if (takes_options) reset(self, options = options) else reset(self)
    },
    step = function(action) step(self, action)
  )
  for (wrap_around in definition$wrappers) functions <- wrap_around(functions, num_envs)
  list2env(parent = emptyenv(), list(
    traits = definition$traits, reset = functions$reset, step = functions$step,
    render = if (!is.null(render)) function() render(self), takes_options = takes_options,
    num_envs = num_envs, generator = NULL, taken = NA_integer_, ended = FALSE, closed = FALSE
  ))
}

check_takes <- function(f, arguments, arg = rlang::caller_arg(f), call = rlang::caller_env()) {
  named <- paste0("`", arguments, "`", collapse = " and ")
  if (!is.function(f)) {
    abort_argument(f, paste("a function of", named), arg, call)
  }
  declared <- formals(args(f))
  if (!"..." %in% names(declared) && length(declared) < length(arguments)) {
    abort_wrong(arg, f, call,
                "`{arg}` must be a function of {named}, and this one has
                 {count_of(length(declared), 'argument')}.",
                i = paste0("It begins with `function(", paste(arguments, collapse = ", "), ")`."))
  }
}

step_r_env <- function(sub_env, action, call = rlang::caller_env()) {
  check_sub_env_open(sub_env, call)
  traits <- sub_env$traits
  which <- if (!is.null(sub_env$num_envs)) seq_len(sub_env$num_envs)
  check_was_reset(sub_env, call)
  action <- checked_action(traits, action, which, call)
  out <- complete_step(raw_step(sub_env, action, call), sub_env, call = call)
  if (isTRUE(all(sub_env$ended))) {
    # NA: the episode is over, and the warning has been given.
    sub_env$ended <- NA
    warn_step_after_end(traits$spec$id, call)
  } else {
    sub_env$ended <- sub_env$ended | out$terminated | out$truncated
  }
  list(
    observation = out$observation, reward = out$reward, done = out$terminated | out$truncated,
    info = out$info, terminated = out$terminated, truncated = out$truncated
  )
}

check_sub_env_open <- function(sub_env, call = rlang::caller_env()) {
  if (sub_env$closed) abort_closed("Make a new one.", call)
}

# Shared values ------------------------------------------------------------------------

#' Refuse values that all sub-environments would share
#'
#' R does not copy environments, and R6 objects are environments. This does not look into the
#' environments of functions.
#' @param values A named list: the values with which each `self` starts, or the arguments of an
#'   entry point.
#' @noRd
check_not_shared <- function(values, call = rlang::caller_env()) {
  for (name in names(values)) {
    shared <- shared_object(values[[name]], name)
    if (is.null(shared)) next
    object <- shared$object
    class <- if (is.object(object)) class(object)[[1L]]
    again <- if (is_playable(object)) {
      paste0("gym_make(\"", object$spec$id, "\", seed = 1)")
    } else if (inherits(object, "R6")) {
      paste0(class, "$new()")
    } else {
      "new.env()"
    }
    what <- if (is.null(class)) "an environment of R" else paste("an object of class", class)
    abort_wrong(name, object, call,
                "`{shared$path}` is {what}, which all sub-environments would share.",
                i = "Let each make its own in `reset`: `if (is.null(self${name})) self${name} <-
                     {again}`.",
                i = "If nothing changes it, the functions can use it without `self`.")
  }
}

# Finds the first environment in a value or, if the value is a list, in its elements. Returns a
# list of `path` and `object`. It accepts R6 classes and, in a list, objects of this package such as
# a client: these are environments, but nobody changes their state.
shared_object <- function(value, path) {
  if (is.environment(value) && !inherits(value, "R6ClassGenerator")) {
    return(list(path = path, object = value))
  }
  if (is.list(value) && !any(startsWith(class(value), "gym_"))) {
    keys <- rlang::names2(value)
    for (i in seq_along(value)) {
      inside <- if (nzchar(keys[[i]])) path_key(path, keys[[i]]) else paste0(path, "[[", i, "]]")
      found <- shared_object(.subset2(value, i), inside)
      if (!is.null(found)) {
        return(found)
      }
    }
  }
}
