#' Wrap an environment before it is made
#'
#' Add a wrapper of Gymnasium to an environment before [gym_make()], [env_create()], [rollout()] or
#' [search_random()] makes it, for example to limit the steps, scale the actions or shrink the
#' pictures. Three wrappers call an R function, for example one that shapes rewards. Use the pipe to
#' add several: the first is the innermost, so the others see what it returns. The spaces in R are
#' those of the wrapped environment. A `"TimeLimit"` can only lower the environment's own step
#' limit; `gym_make("MountainCar-v0", max_episode_steps = 1000)` raises it.
#'
#' # R functions
#'
#' These wrappers call your function in each step, around any environment:
#' * `"TransformReward"`: `func` returns the new rewards. Its arguments can be `reward`,
#'   `observation` (before the action), `action`, `next_observation`, `terminated` and `truncated`,
#'   by these names. The environment loses its `reward_threshold`, which is about the original
#'   rewards.
#' * `"TransformObservation"`: `func` gets `observation` and returns the new observations. If their
#'   space is different, give it as `observation_space`.
#' * `"TransformAction"`: `func` gets `action`, and optionally `observation`, and returns the
#'   actions for the environment. If the actions that it gets have a different space, give it as
#'   `action_space`.
#'
#' `func` gets batches, even for a single environment: rewards as a vector, observations in the form
#' for policies (see [act()]). It returns as many values, which should depend only on its arguments.
#' If it has only one argument, this can have any name. A file of [saveRDS()] does not contain the
#' variables and functions of the session that `func` uses: define them again before you continue in
#' another session.
#'
#' R plays a wrapped environment of Gymnasium step by step (see [rollout()]). This is slower than
#' playing on the server, and agents with a table of values step the environment instead of sampling
#' from its model. Wrappers of the server come first, inside these three. If you wrap an environment
#' of [gym_make()], the result is the same instance. The classic calls ignore these wrappers.
#'
#' # Environments written in R
#'
#' If you wrap an environment of [gym_env()], the result is a new environment with the same
#' functions. If you wrap an id from [gym_register()], [gym_make()] applies the wrapper later. The
#' possible wrappers are the three above and `"TimeLimit"`, whose argument `max_episode_steps` is
#' the number of steps after which an episode is cut off. To wrap with a memory of more than one
#' step, write a new environment, see `vignette("own-environment")`.
#'
#' @param env_id The environment's id, a string such as `"CartPole-v1"`, or the result of
#'   `gym_wrap()` for an id; an environment written in R; or, for a wrapper with an R function, an
#'   environment made by [gym_make()].
#' @param wrapper The wrapper's name, a string such as `"TimeLimit"`. The server decides which
#'   wrappers are allowed; the error for an unknown name lists them. [Gymnasium's
#'   documentation](https://gymnasium.farama.org/api/wrappers/) describes their arguments.
#' @param ... The wrapper's arguments, by name. A vector of length one is sent as a single value;
#'   wrap it in `I()` to send a list of one.
#' @return For an id, an object of class `gym_wrapped`, which prints in one line: a list of `env_id`
#'   and `wrappers`. For an environment, another environment.
#' @section Errors: `gym_error_argument`, also for a wrapper or an argument that does not exist for
#'   environments written in R, and for a wrapper of the server around one that calls an R function.
#'   The server's errors come later, when the environment is made, see [env_create()]. During play,
#'   `gym_error_wrapper` if `func` raises an error (with that error's classes) or returns an invalid
#'   value.
#' @section Warnings: `gym_warning_wrapper` if `func` returns another value for a row alone than for
#'   the same row among others, for example because of `observation[1]` instead of
#'   `observation[, 1]`.
#' @export
#' @examples
#' wrapped <- "CartPole-v1" |>
#'   gym_wrap("TimeLimit", max_episode_steps = 50) |>
#'   gym_wrap("NormalizeReward")
#' wrapped
#'
#' @examplesIf gym:::can_start_server()
#' env <- wrapped |> gym_make(seed = 1)
#' env$reset()
#' env$close()
#'
#' # Reward the car for its speed.
#' fast <- "MountainCar-v0" |>
#'   gym_wrap("TransformReward", func = function(reward, next_observation) {
#'     reward + 10 * abs(next_observation[, "velocity"])
#'   })
#' rollout(fast, policy_random(), episodes = 10, seed = 1)
gym_wrap <- function(env_id, wrapper, ...) {
  match_whole_names()
  check_string(wrapper)
  kwargs <- list(...)
  calls_r <- wrapper %in% names(transforms)
  check_dots_named(
    kwargs, if (calls_r) "func = function(reward) reward / 10" else "max_episode_steps = 50"
  )
  if (is.environment(env_id) || is.list(env_id) && !inherits(env_id, "gym_wrapped")) {
    wrap <- if (is_server_env(env_id)) wrap_server_env else wrap_r_env
    return(wrap(env_id, wrapper, kwargs, rlang::current_env()))
  }
  registered <- is_registered(env_id)
  if (registered) check_r_wrapper(wrapper, rlang::current_env())
  if (calls_r) {
    check_wrapper_arguments(wrapper, kwargs, rlang::current_env())
    asked_parts(wrapper, kwargs$func, rlang::current_env())
  }
  wrapped <- with_wrappers(env_id, list(c(list(wrapper), kwargs)))
  if (!registered) split_wrappers(wrapped$wrappers, rlang::current_env())
  wrapped
}

# Adds wrappers to an id.
with_wrappers <- function(env_id, wrappers, call = rlang::caller_env()) {
  if (!inherits(env_id, "gym_wrapped")) {
    check_string(env_id, call = call)
    if (!length(wrappers)) {
      return(env_id)
    }
    env_id <- structure(list(env_id = env_id, wrappers = list()), class = "gym_wrapped")
  }
  check_wrappers(wrappers, call)
  env_id$wrappers <- c(env_id$wrappers, wrappers)
  env_id
}

#' Describe an environment that is given by its id
#'
#' @return `NULL` for an environment that exists already. Otherwise a list: `id`, without wrappers;
#'   `wrappers`, the wrappers that [gym_wrap()] has recorded; `remembers`, the names of the wrappers
#'   whose results depend on earlier episodes; `calls_r`, whether a wrapper calls an R function;
#'   `registered`, whether the environment is written in R and registered in this session, so that a
#'   server does not know it.
#' @noRd
given_id <- function(env) {
  wrapped <- inherits(env, "gym_wrapped")
  if (!wrapped && !is.character(env)) {
    return(NULL)
  }
  id <- if (wrapped) env$env_id else env
  wrappers <- if (wrapped) env$wrappers
  names <- wrapper_names(wrappers)
  list(
    id = id, wrappers = wrappers, remembers = remembering(names),
    calls_r = any(names %in% names(transforms)),
    registered = rlang::is_string(id) && id %in% names(the_session$environments)
  )
}

is_registered <- function(env) isTRUE(given_id(env)$registered)

# Whether an environment is given by an id that a server may know.
is_made_by_server <- function(env) isFALSE(given_id(env)$registered)

wrapper_names <- function(wrappers) vapply(wrappers, function(wrapper) wrapper[[1L]], "")

# The names of the wrappers whose results depend on earlier episodes.
remembering <- function(names) {
  as.character(intersect(names, c("NormalizeObservation", "NormalizeReward")))
}

# The printed name of an environment. It includes the wrappers, because returns depend on them.
wrapped_id <- function(env_id, wrappers) paste(c(env_id, wrappers), collapse = " |> ")

# The printed name of the environment of a result or a policy; `NULL` if it is unknown.
env_text <- function(x) if (!is.null(x$env_id)) wrapped_id(x$env_id, wrappers_around(x))

wrappers_around <- function(x) x$wrappers %||% x$provenance$wrappers

#' Name the environments of several results
#' @param results A list of results with an element `env_id`.
#' @return A string for each different `env_id`, with the ids as names. Environments that differ
#'   only by their wrappers share a string.
#' @noRd
env_names <- function(results) {
  ids <- vapply(results, function(x) x$env_id, "")
  texts <- split_in_order(vapply(results, env_text, ""), ids)
  vapply(texts, function(of_one) toString(unique(of_one)), "")
}

#' @export
format.gym_wrapped <- function(x, ...) {
  text <- function(value) if (inherits(value, "gym_space")) format(value) else describe_value(value)
  wrappers <- vapply(x$wrappers, function(wrapper) {
    values <- vapply(wrapper[-1L], text, "")
    arguments <- paste(names(wrapper)[-1L], values, sep = " = ", recycle0 = TRUE, collapse = ", ")
    paste0(wrapper[[1L]], "(", arguments, ")")
  }, "")
  paste(c(x$env_id, wrappers), collapse = " |> ")
}

#' @export
print.gym_wrapped <- function(x, ...) print_lines(x, paste0("<", format(x), ">"))

check_wrappers <- function(wrappers, call = rlang::caller_env()) {
  # A wrapper is a list of its name and its arguments, which have names.
  is_wrapper <- function(x) {
    is.list(x) && length(x) > 0L && rlang::is_string(x[[1L]]) &&
      (length(x) == 1L || rlang::is_named(x[-1L]))
  }
  if (!is.list(wrappers) || !all(vapply(wrappers, is_wrapper, NA))) {
    must <- "a list of lists such as list(\"TimeLimit\", max_episode_steps = 50)"
    abort_argument(wrappers, must, "wrappers", call)
  }
}

wrappers_json <- function(wrappers) {
  json_array(vapply(wrappers, function(wrapper) {
    kwargs <- if (length(wrapper) > 1L) to_json(wrapper[-1L])
    json_object(c(name = json_string(wrapper[[1L]]), kwargs = kwargs))
  }, ""))
}

# Around environments written in R ----------------------------------------------------------

# Each function makes a wrapper from the traits of the inner environment and the wrapper's
# arguments. It returns a list: `traits`, those of the wrapped environment, and `around`, which
# wraps the functions of a sub-environment. `around` gets `inner` (a list of the functions `reset`
# and `step`) and `num_envs` (`NULL` if not vectorised), and returns such a list. It is called once
# for each sub-environment, so each has its own state.
r_wrappers <- list(
  TimeLimit = function(traits, max_episode_steps, call) {
    check_count(max_episode_steps, call = call)
    limit <- as.integer(min(traits$limit, max_episode_steps))
    list(
      traits = change_traits(traits, list(max_episode_steps = limit)),
      around = function(inner, num_envs) inner
    )
  },
  TransformReward = wrap_transform_reward, TransformObservation = wrap_transform_observation,
  TransformAction = wrap_transform_action
)

#' Wrap an environment written in R
#' @param arguments The wrapper's arguments, a list with names.
#' @return A new environment with the same functions.
#' @noRd
wrap_r_env <- function(env, wrapper, arguments, call) {
  if (!inherits(env, "gym_r_env")) {
    must <- "the id of an environment, or one made by `gym_make()` or by `gym_env()`"
    abort_argument(env, must, "env_id", call)
  }
  definition <- definition_of(env)
  made <- make_r_wrapper(definition$traits, wrapper, arguments, call)
  made$traits$spec$wrappers <- c(made$traits$spec$wrappers, wrapper)
  definition$traits <- made$traits
  definition$wrappers <- c(definition$wrappers, list(made$around))
  # A wrapper may change the transitions of the model.
  definition["model"] <- list(NULL)
  r_env$new(definition)
}

make_r_wrapper <- function(traits, wrapper, arguments, call) {
  check_r_wrapper(wrapper, call)
  check_wrapper_arguments(wrapper, arguments, call)
  rlang::exec(r_wrappers[[wrapper]], traits, !!!arguments, call = call)
}

check_wrapper_arguments <- function(wrapper, arguments, call) {
  make <- r_wrappers[[wrapper]]
  known <- setdiff(names(formals(make)), c("traits", "call"))
  strange <- setdiff(names(arguments), known)
  needed <- known[vapply(formals(make)[known], is_without_default, NA)]
  lacking <- setdiff(needed, names(arguments))
  wrong <- c(strange, lacking)
  if (length(wrong)) {
    does <- if (length(strange)) "has no argument" else "needs the argument"
    has <- if (length(known)) paste("its arguments are", quoted_names(known)) else "it has none"
    abort_wrong(wrong[[1L]], NULL, call, "{wrapper} {does} `{wrong[[1L]]}`: {has}.")
  }
}

is_without_default <- function(formal) rlang::is_missing(formal)

check_r_wrapper <- function(wrapper, call) {
  if (wrapper %in% names(ended_wrappers)) {
    replacement <- paste0("give the function to the wrapper \"", ended_wrappers[[wrapper]], "\"")
    abort_defunct(replacement, paste0("\"", wrapper, "\" around environments written in R"), call)
  }
  if (!wrapper %in% names(r_wrappers)) {
    abort_wrong("wrapper", wrapper, call,
                "There is no wrapper \"{wrapper}\" for environments written in R.",
                i = paste0("There are ", paste(names(r_wrappers), collapse = ", "), "."))
  }
}

# Checks the results of an environment in R before the function of a wrapper gets them. In a
# vectorised environment, a sub-environment whose episode has ended may return anything; the result
# of a running one replaces its result.
checked_functions <- function(inner, traits, num_envs) {
  force(inner)
  n <- num_envs %||% 1L
  playing <- seq_len(n)
  where <- function(name) paste0("`", name, "()` of ", traits$spec$id)
  checked <- function(observation, name) {
    checked_observation(traits, observation, num_envs, where(name), NULL)
  }
  list(
    reset = function(seed, options, ...) {
      playing <<- seq_len(n)
      observation <- inner$reset(seed, options)
      marking_wrapper(checked(observation, "reset"))
    },
    step = function(action, ...) {
      out <- inner$step(action)
      if (length(playing) && length(playing) < n) {
        out <- without_ended(out, traits$observation_space, playing, n)
      }
      marking_wrapper({
        out <- check_step_parts(out, n, where("step"), NULL)
        out$observation <- checked(out$observation, "step")
      })
      if (n > 1L) playing <<- setdiff(playing, which(out$terminated | out$truncated))
      out
    }
  )
}

# Marks errors that already say where they come from.
marking_wrapper <- function(code) {
  tryCatch(code, gym_error = function(cnd) {
    class(cnd) <- c("gym_error_wrapper", class(cnd))
    rlang::cnd_signal(cnd)
  })
}
