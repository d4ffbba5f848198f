# A server's environments inside wrappers that call R functions. R plays them step by step.

# Wraps an environment of a server. The instance on the server stays the same.
wrap_server_env <- function(env, wrapper, arguments, call) {
  if (!wrapper %in% names(transforms)) {
    abort_wrong("wrapper", wrapper, call,
                "The server applies {wrapper} when it makes an environment, but this one exists
                 already.",
                i = "`gym_make(gym_wrap(\"{env$spec$id}\", \"{wrapper}\"))` makes a wrapped one.",
                i = "An existing one can be wrapped by {toString(names(transforms))}.")
  }
  traits <- new_traits(env$single_observation_space, env$single_action_space, env$spec$id)
  traits$spec <- env$spec
  made <- make_r_wrapper(traits, wrapper, arguments, call)
  made$traits$spec$wrappers <- c(env$spec$wrappers, wrapper)
  wrapped_server_env$new(env, made, renames = "action_space" %in% names(arguments))
}

wrapped_server_env <- R6Class(
  c("gym_wrapped_server_env", "gym_server_env", "gym_env"), inherit = server_env, cloneable = FALSE,
  public = list(
    initialize = function(env, made, renames) {
      traits <- made$traits
      for (name in c("instance_id", "num_envs", "vectorization_mode", "num_workers",
                     "autoreset_mode")) {
        self[[name]] <- env[[name]]
      }
      self$spec <- traits$spec
      self$single_observation_space <- traits$observation_space
      self$single_action_space <- traits$action_space
      private$env <- env
      private$traits <- traits
      # The instance as seen from outside the wrapper. If its action space is new, the documented
      # meanings of actions do not apply.
      private$instance <- list(
        client = env$client, num_envs = env$num_envs, spec = if (!renames) traits$spec,
        single_action_space = traits$action_space,
        single_observation_space = traits$observation_space,
        actions = sent_space(traits$action_space, env$num_envs),
        observations = sent_space(traits$observation_space, env$num_envs)
      )
      inner <- list(
        reset = function(...) {
          out <- env$reset(..., return_info = TRUE)
          private$info <- out$info
          out$observation
        },
        step = env$step
      )
      private$functions <- made$around(inner, env$num_envs, env)
    },
    reset = function(seed = NULL, options = NULL, return_info = FALSE, mask = NULL,
                     infos = TRUE) {
      check_open(self)
      check_flag(return_info)
      observation <- private$functions$reset(
        seed = seed, options = options, mask = mask, infos = infos
      )
      if (return_info) list(observation = observation, info = private$info) else observation
    },
    step = function(action, which = NULL, infos = TRUE, finals = TRUE) {
      check_open(self)
      action <- private$take_action(action, which, rlang::current_env())
      private$functions$step(action, which = which, infos = infos, finals = finals)
    },
    close = function() {
      private$env$close()
      invisible(self)
    }
  ),
  active = list(is_open = function() {
    open <- private$env$is_open
    private$ended <- private$env$.__enclos_env__$private$ended
    open
  }),
  private = list(
    env = NULL, traits = NULL, functions = NULL, info = NULL,
    # Checks actions and converts them to the form that the wrapper's function gets.
    take_action = function(action, which, call) {
      check_which(which, private$instance, call)
      action <- numbered_actions(private$instance, action, call)
      if (!is.null(self$num_envs)) which <- which %||% seq_len(self$num_envs)
      checked_action(private$traits, action, which, call)
    },
    # The environment inside closes itself.
    finalize = function() NULL
  )
)

# Wrappers by their names ------------------------------------------------------------------

#' Split wrappers into those applied by the server and those applied in R after them
#' @return A list of two lists, `server` and `r`.
#' @noRd
split_wrappers <- function(wrappers, call) {
  in_r <- wrapper_names(wrappers) %in% names(transforms)
  # R functions cannot be sent to the server.
  takes_function <- function(wrapper) any(vapply(wrapper, is.function, NA))
  wrong <- Filter(takes_function, wrappers[!in_r])
  if (length(wrong)) {
    name <- wrong[[1L]][[1L]]
    abort_wrong("wrapper", name, call, "The wrapper {name} does not take an R function.",
                i = did_you_mean(name, names(transforms), "%s"),
                i = "These do: {toString(names(transforms))}.")
  }
  late <- which(!in_r & cumsum(in_r) > 0L)
  if (length(late)) {
    names <- c(wrappers[[late[[1L]]]][[1L]], wrappers[[which(in_r)[[1L]]]][[1L]])
    abort_wrong("wrapper", names[[1L]], call,
                "{names[[1L]]} runs on the server, so it must be inside {names[[2L]]}, which runs
                 in R.",
                i = "Write it before {names[[2L]]}.")
  }
  list(server = wrappers[!in_r], r = wrappers[in_r])
}
