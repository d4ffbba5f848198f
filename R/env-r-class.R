#' A class of environments to inherit from
#'
#' Write a class of environments in R as an R6 class that inherits from `GymEnv`, with methods
#' `reset()` and `step()`, like a Python class that inherits from Gymnasium's `Env`. [gym_env()]
#' makes an environment from functions instead.
#'
#' Your class has
#' * a method `reset()`, which returns the first observation. It may have the arguments `options`
#'   and `seed`. The seed is set even without such an argument, see below.
#' * a method `step(action)`, which returns a list of `observation`, `reward` (a number),
#'   `terminated` (whether the episode ended by the environment's own rules) and optionally
#'   `truncated` (whether it was cut off; default `FALSE`) and `info` (a list).
#' * optionally a method `render()`, which either plots or returns a picture, as in [gym_env()].
#' * the two spaces, either as public fields `observation_space` and `action_space`, or as arguments
#'   of `super$initialize()`.
#'
#' `$new()` calls `super$initialize()`, with the arguments listed below. From then on `env$reset()`
#' and `env$step()` check arguments and results, count the steps, and draw from the environment's
#' own random generator, as described at [gym_env()].
#'
#' @section Arguments of `super$initialize()`:
#' * `observation_space`, `action_space`: the spaces. The default is the fields of these names.
#' * `id`: the name of the environment, a string. The default is the name of the class.
#' * `max_episode_steps`: the number of steps after which an episode is cut off, a whole number.
#'   `NULL`, the default, for no limit.
#' * `reward_threshold`: the mean return from which it counts as solved, a number. `NULL`, the
#'   default, for none.
#' * `render_fps`: the number of frames per second. `NULL`, the default, for 30.
#'
#' @return `GymEnv` is an R6 generator. Its objects, of class `gym_r_env` and `gym_env`, have the
#'   elements of those of [gym_env()] and the fields and methods of their own class.
#' @section Errors: As for [gym_env()]. `gym_error_argument` also for a class without a method
#'   `reset()` or `step()`.
#' @seealso [gym_env()], [gym_register()]
#' @name GymEnv
#' @export GymEnv
#' @examples
#' # Walk to the right end of a corridor, on slippery ground.
#' Corridor <- R6::R6Class(
#'   "Corridor",
#'   inherit = GymEnv,
#'   public = list(
#'     size = NULL,
#'     position = NULL,
#'     initialize = function(size = 5, ...) {
#'       self$size <- size
#'       super$initialize(
#'         observation_space = space_discrete(size), action_space = space_discrete(2), ...
#'       )
#'     },
#'     reset = function() {
#'       self$position <- 0
#'       self$position
#'     },
#'     step = function(action) {
#'       slips <- runif(1) < 0.1
#'       move <- if (xor(action == 1, slips)) 1 else -1
#'       self$position <- min(max(self$position + move, 0), self$size - 1)
#'       list(
#'         observation = self$position, reward = -1,
#'         terminated = self$position == self$size - 1
#'       )
#'     }
#'   )
#' )
#' env <- Corridor$new(size = 4, max_episode_steps = 100)
#' env
#' env$reset(seed = 1)
#' env$step(1)
NULL

GymEnv <- R6Class(
  c("gym_r_env", "gym_env"),
  public = list(
    observation_space = NULL,
    action_space = NULL,
    single_observation_space = NULL,
    single_action_space = NULL,
    num_envs = NULL,
    vectorization_mode = NULL,
    autoreset_mode = NULL,
    spec = NULL,
    client = NULL,
    initialize = function(observation_space = self$observation_space,
                          action_space = self$action_space, id = class(self)[[1L]],
                          max_episode_steps = NULL, reward_threshold = NULL, render_fps = NULL) {
      check_overrides(self)
      traits <- new_traits(
        observation_space, action_space, id, max_episode_steps, reward_threshold, render_fps
      )
      private$gym_sub_env <- class_sub_env(self, traits)
      become_sub_env(self, private$gym_sub_env)
    },
    reset = function() abort_no_method(self, "reset"),
    step = function(action) abort_no_method(self, "step"),
    render = function() abort_no_method(self, "render"),
    close = function() {
      private$gym_sub_env$closed <- TRUE
      invisible(self)
    },
    print = function(...) {
      print_env(self, "vectorised", self$observation_space, self$action_space)
    }
  ),
  active = list(
    is_open = function() !private$gym_sub_env$closed
  ),
  private = list(gym_sub_env = NULL)
)

sub_env_of <- function(env) {
  sub_env <- env$.__enclos_env__$private$gym_sub_env
  if (is.null(sub_env)) {
    gym_abort(
      c(paste0("An object of class ", class(env)[[1L]], " is not ready to be played."),
        i = "Its method `initialize()` must call `super$initialize()`."),
      class = "gym_error_argument", argument = "env", value = env, call = NULL
    )
  }
  sub_env
}

# Sets the fields that show the state of an object's sub-environment.
become_sub_env <- function(env, sub_env) {
  traits <- sub_env$traits
  n <- sub_env$num_envs
  spread <- function(space) if (is.null(n)) space else spread_bounds(batch_space(space, n))
  env$single_observation_space <- traits$observation_space
  env$single_action_space <- traits$action_space
  env$observation_space <- spread(traits$observation_space)
  env$action_space <- spread(traits$action_space)
  env$num_envs <- n
  env$spec <- traits$spec
  replace_methods(env, checked_methods(sub_env))
}

# R6 locks methods. These are replaced once, when the object is made.
replace_methods <- function(env, methods) {
  methods <- methods[names(methods) %in% names(env)]
  rlang::env_binding_unlock(env, names(methods))
  for (name in names(methods)) {
    assign(name, methods[[name]], envir = env)
  }
  rlang::env_binding_lock(env, names(methods))
}

# The sub-environment that plays an object's own methods.
class_sub_env <- function(env, traits) {
  reset <- env$reset
  takes <- intersect(c("seed", "options"), names(formals(reset)))
  functions <- plain_results(list(
    reset = function(seed, options) {
      if (length(takes)) do.call(reset, list(seed = seed, options = options)[takes]) else reset()
    },
    step = env$step
  ))
  new_sub_env(
    traits,
    reset = functions$reset,
    step = functions$step,
    render = if (overrides(env, "render")) env$render,
    takes_options = "options" %in% takes
  )
}

overrides <- function(env, name) {
  !identical(body(env[[name]]), body(GymEnv$public_methods[[name]]))
}

check_overrides <- function(env, call = rlang::caller_env()) {
  for (name in c("reset", "step")) {
    if (!overrides(env, name)) abort_no_method(env, name, call)
  }
}

abort_no_method <- function(env, name, call = rlang::caller_env()) {
  if (class(env)[[1L]] == "gym_r_env") {
    problem <- "GymEnv is a class to inherit from."
  } else {
    problem <- paste0("The class ", class(env)[[1L]], " has no method `", name, "()`.")
  }
  gym_abort(
    c(problem, i = "`R6::R6Class(\"Name\", inherit = GymEnv, public = list(reset = , step = ))`."),
    class = "gym_error_argument", argument = name, call = call
  )
}
