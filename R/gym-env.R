# Environments as objects.

#' Make an environment
#'
#' Makes an environment that is played with `$reset()` and `$step()`, as
#' Gymnasium's documentation writes it with a dot. Without a `client` it lives
#' on the session's own server, which is started when there is none.
#'
#' The environment is closed by `$close()`, or some time after the object itself
#' has been thrown away: keep the object for as long as the environment is played.
#'
#' @inheritParams env_create
#' @param ... Further arguments for the environment, by name, such as
#'   `sutton_barto_reward = TRUE` for CartPole.
#' @param client A client, by default that of [gym_client()].
#' @return An object of class `gym_env` with
#'   * `$reset(seed = NULL, options = NULL, return_info = FALSE)`: starts an episode
#'     and returns the first observation, as [env_reset()],
#'   * `$step(action)`: takes a step and returns a list, as [env_step()],
#'   * `$render()`: the current frame, as [env_render()],
#'   * `$close()`: takes it off the server,
#'   * `$action_space`, `$observation_space`: the spaces, as
#'     [env_action_space_info()],
#'   * `$spec`: a list of `id`, `reward_threshold` and `max_episode_steps`, the
#'     latter two `NULL` where the environment has none,
#'   * `$client`, `$instance_id`: for the classic calls.
#' @section Errors: As [env_create()]; `gym_error_server_start` when no server
#'   could be started.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", seed = 1)
#' env$reset()
#' str(env$step(1))
#' env$close()
#'
#' short <- gym_make("CartPole-v1", wrappers = list(list("TimeLimit", max_episode_steps = 5)))
#' short$reset()
#' short$close()
gym_make <- function(env_id, ..., seed = NULL, render_mode = NULL, client = gym_client(),
                     wrappers = list()) {
  kwargs <- list(...)
  check_dots_named(kwargs, "seed = 1")
  check_client(client)
  instance_id <- create_instance(client, env_id, seed, render_mode, kwargs, wrappers)
  env <- NULL
  on.exit(if (is.null(env)) close_if_there(client, instance_id))
  env <- gym_env$new(client, instance_id)
  env
}

gym_env <- R6Class(
  "gym_env",
  cloneable = FALSE,
  lock_class = TRUE,
  public = list(
    client = NULL,
    instance_id = NULL,
    action_space = NULL,
    observation_space = NULL,
    spec = NULL,
    initialize = function(client, instance_id) {
      private$instance <- known_instance(client, instance_id)
      private$pid <- Sys.getpid()
      self$client <- client
      self$instance_id <- instance_id
      self$action_space <- private$instance$action_space
      self$observation_space <- private$instance$observation_space
      self$spec <- private$instance$spec
    },
    reset = function(seed = NULL, options = NULL, return_info = FALSE) {
      private$check_open()
      check_flag(return_info)
      reset_instance(self$client, private$instance, seed, options, return_info)
    },
    step = function(action) {
      private$check_open()
      step_instance(self$client, private$instance, action, render = FALSE)
    },
    render = function() {
      private$check_open()
      env_render(self$client, self$instance_id)
    },
    close = function() {
      if (!private$closed) {
        close_if_there(self$client, self$instance_id)
        private$closed <- TRUE
      }
      invisible(self)
    },
    print = function(...) {
      cat("<gym_env: ", self$spec$id, if (private$closed) ", closed", ">\n", sep = "")
      cat("  observations: ", format(self$observation_space), "\n", sep = "")
      cat("  actions:      ", format(self$action_space), "\n", sep = "")
      invisible(self)
    }
  ),
  private = list(
    instance = NULL,
    pid = NULL,
    closed = FALSE,
    check_open = function(call = rlang::caller_env()) {
      if (private$closed) {
        gym_abort(
          c("This environment was closed.",
            i = paste0("`gym_make(\"", self$spec$id, "\")` makes a new one.")),
          class = "gym_error_argument",
          call = call
        )
      }
    },
    finalize = function() {
      # In a forked child the environment is still the parent's.
      if (!private$closed && identical(private$pid, Sys.getpid())) {
        state <- connection(self$client)
        state$to_close <- c(state$to_close, self$instance_id)
      }
    }
  )
)
