#' Make an environment of R functions
#'
#' Makes an environment that is played as those of [gym_make()] are, from two functions of your own:
#' one that starts an episode, and one that takes a step. No server is started for it. A class of
#' environments, as in Gymnasium, is made with [GymEnv].
#'
#' The functions keep what they have to remember in `self`, an R environment:
#' `self$position <- 0`. Every sub-environment has a `self` of its own, so that [rollout()] and
#' every search can play many of them side by side; the environment that they are given does not
#' move when they play it.
#'
#' What the functions return is checked in each step: an observation must belong to the observation
#' space, bounds included, a reward must be one number, a flag `TRUE` or `FALSE`. An action is
#' checked before `step` gets it; only a Box action outside of its bounds is handed on, as in
#' Gymnasium. [check_env()] finds out more.
#'
#' # Random numbers
#'
#' Each environment, and each sub-environment, has a random generator of its own. `runif()`,
#' `sample()` and the others draw from it within `reset` and `step`, and the session's own is
#' afterwards as it was. `$reset(seed = 1)` seeds it, and a seed gives the same draws whatever
#' `RNGkind()` the session has. A seed of at most 2^31 - 1 gives what [set.seed()] gives for R's
#' generator `"L'Ecuyer-CMRG"`; one up to 2^53 a stream of its own, made of its lower 31 bits and of
#' the others. An environment that was never seeded draws one seed from the
#' session's generator when it is reset for the first time, so that [set.seed()] fixes it, too.
#'
#' # Vectorised functions
#'
#' With `vectorized = TRUE` the functions play all sub-environments at once, which is many times
#' faster where they calculate with whole vectors. `self$num_envs` says how many there are. `reset`
#' returns a batch of observations, for a Box of one dimension a matrix with a row for each
#' sub-environment; `step` gets a batch of actions and returns a batch of observations and vectors
#' for `reward`, `terminated` and `truncated`. Sub-environments whose episode has ended go on
#' being stepped, and what they return is ignored, until all are reset. They share one generator.
#'
#' @param reset A function of `self` that starts an episode and returns the first observation. With
#'   a second argument `options` it gets the options of `$reset(options = )`.
#' @param step A function of `self` and `action` that takes a step and returns a list of
#'   `observation`, `reward` (a number), `terminated` (whether the episode ended by the
#'   environment's own rules) and perhaps `truncated` (whether it was cut off, `FALSE` without it)
#'   and `info` (a list).
#' @param observation_space,action_space The spaces, such as `space_box(-1, 1, shape = 2)` and
#'   `space_discrete(3)`.
#' @param render A function of `self` that draws the environment as it is: it either plots with R's
#'   graphics, or returns a picture, as a raster image, a matrix of greys or of colours, or an array
#'   of height x width x 3. `NULL`, the default, for an environment that cannot be drawn.
#' @param vectorized Do the functions play all sub-environments at once? `FALSE`, the default, or
#'   `TRUE`.
#' @param ... Further values, by name, which each `self` has from the beginning, such as
#'   `size = 5` for `self$size`. In a vectorised environment `num_envs` is how many
#'   sub-environments this object has, 256 unless it is given.
#' @param model The environment's [model][gym_model()], for [env_model()], the table of its
#'   transitions, or a function of the environment that returns one of them; `NULL`, the default,
#'   for an environment that has none. A table does not say where episodes start: that is taken
#'   from `reset`, exactly where it draws nothing, and from 1000 resets where it draws.
#' @param id What the environment is called in messages and titles, a string.
#' @param max_episode_steps After how many steps an episode is cut off, a whole number; `NULL`, the
#'   default, for never.
#' @param reward_threshold The mean return from which the environment counts as solved, a number;
#'   `NULL`, the default, for none.
#' @param render_fps How many frames make a second of it, a number; `NULL`, the default, leaves it
#'   to [animate()].
#' @return An object of class `gym_r_env` and `gym_env` with
#'   * `$reset(seed = NULL, options = NULL, return_info = FALSE)`: starts an episode and returns the
#'     first observation, or a list of `observation` and `info`,
#'   * `$step(action)`: takes a step and returns a list of `observation`, `reward`, `done`, `info`,
#'     `terminated` and `truncated`, as [env_step()],
#'   * `$render()`: the current frame, as [env_render()],
#'   * `$close()`, `$is_open`,
#'   * `$observation_space`, `$action_space`, and `$single_observation_space`,
#'     `$single_action_space`, which differ from them in a vectorised environment,
#'   * `$num_envs`: `NULL`, or of a vectorised environment how many sub-environments it has,
#'   * `$spec`: a list of `id`, `reward_threshold`, `max_episode_steps` and `render_fps`.
#' @section Errors: `gym_error_argument` for an argument that is not what it should be, and in
#'   `$reset()` and `$step()` for a function that does not return what it should;
#'   `gym_error_space` for an action or an observation that does not fit its space;
#'   `gym_error_environment` where a function of yours raises an error: it also has the classes of
#'   that error, which is its `parent`.
#' @section Warnings: `gym_warning_step_after_done`.
#' @seealso [GymEnv], [gym_register()], [check_env()], `vignette("own-environment")`
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
gym_env <- function(reset, step, observation_space, action_space, render = NULL,
                    vectorized = FALSE, ..., model = NULL, id = "R-environment",
                    max_episode_steps = NULL, reward_threshold = NULL, render_fps = NULL) {
  check_takes(reset, "self")
  check_takes(step, c("self", "action"))
  if (!is.null(render)) {
    check_takes(render, "self")
  }
  check_flag(vectorized)
  if (!is.null(model) && !is.data.frame(model) && !is.function(model) &&
        !inherits(model, "gym_model")) {
    must <- "a model, a data frame of transitions, a function that returns one, or NULL"
    abort_argument(model, must, "model", rlang::current_env())
  }
  parameters <- list(...)
  check_dots_named(parameters, "size = 5")
  # A space that was left out is refused as one that is NULL is.
  if (missing(observation_space)) observation_space <- NULL
  if (missing(action_space)) action_space <- NULL
  traits <- new_traits(
    observation_space, action_space, id, max_episode_steps, reward_threshold, render_fps
  )
  function_env$new(list(
    traits = traits, reset = reset, step = step, render = render, vectorized = vectorized,
    parameters = parameters, model = model
  ))
}

# The sub-environments of functions are made of a definition: `traits`, the functions, `vectorized`,
# `parameters`, the values that each `self` begins with, and `wrappers`, see wrap_r_env().
function_env <- R6Class(
  "gym_function_env",
  inherit = GymEnv,
  public = list(
    initialize = function(definition) {
      private$gym_definition <- definition
      private$gym_sub_env <- definition_sub_env(definition)
      become_sub_env(self, private$gym_sub_env)
    }
  ),
  private = list(gym_definition = NULL)
)

# NULL for an object of a class of the user's.
definition_of <- function(env) {
  if (inherits(env, "gym_function_env")) env$.__enclos_env__$private$gym_definition
}

#' Make a sub-environment of functions, with a `self` of its own
#' @param num_envs How many sub-environments it has if it is vectorised.
#' @noRd
definition_sub_env <- function(definition, num_envs = NULL) {
  reset <- definition$reset
  step <- definition$step
  render <- definition$render
  self <- list2env(definition$parameters, parent = environment(step) %||% globalenv())
  if (definition$vectorized) {
    num_envs <- num_envs %||% definition$parameters$num_envs %||% vectorized_sub_envs
    check_count(num_envs, call = NULL)
    num_envs <- as.integer(num_envs)
    self$num_envs <- num_envs
  }
  takes_options <- "options" %in% names(formals(reset))
  functions <- list(
    reset = if (takes_options) {
      function(seed, options) reset(self, options = options)
    } else {
      function(seed, options) reset(self)
    },
    step = function(action) step(self, action)
  )
  functions <- plain_results(functions)
  for (wrap_around in definition$wrappers) {
    functions <- wrap_around(functions, num_envs)
  }
  new_sub_env(
    definition$traits,
    reset = functions$reset,
    step = functions$step,
    render = if (!is.null(render)) function() render(self),
    takes_options = takes_options,
    num_envs = num_envs
  )
}

check_takes <- function(f, arguments, arg = rlang::caller_arg(f), call = rlang::caller_env()) {
  named <- paste0("`", arguments, "`", collapse = " and ")
  if (!is.function(f)) {
    abort_argument(f, paste("a function of", named), arg, call)
  }
  declared <- formals(args(f))
  if (!"..." %in% names(declared) && length(declared) < length(arguments)) {
    gym_abort(
      c(paste0("`", arg, "` must be a function of ", named, ", and this one has ",
               count_of(length(declared), "argument"), "."),
        i = paste0("It begins with `function(", paste(arguments, collapse = ", "), ")`.")),
      class = "gym_error_argument", argument = arg, value = f, call = call
    )
  }
}
