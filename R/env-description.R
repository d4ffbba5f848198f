# A server's description of an environment given by its id: its spaces and its limits. This does not
# make an instance.

#' Describe an environment whose episodes a server plays itself
#'
#' The server is asked once for each environment.
#' @param env_id,num_envs,frames,client As for [as_vector_env()].
#' @param arguments The arguments of the environment, a list.
#' @return As [as_vector_env()], without the functions that play, and with `description`, a list:
#'   `fields`, JSON texts by which a request names the environment, `group`, the number of episodes
#'   that share a seed if all sub-environments have one generator (or `NULL`), `processes`, the
#'   number that play, `needs_max_steps`, whether an episode may go on forever, `versions` and
#'   `processor`. `NULL` if R plays its episodes: an environment in R or an object, frames, wrappers
#'   that remember earlier episodes, arguments about sub-environments, an older server.
#' @noRd
describe_env <- function(env_id, arguments, client, num_envs = NULL, frames = FALSE,
                         call = rlang::caller_env()) {
  played_here <- frames || !is_made_by_server(env_id) || any(names(arguments) %in% how_made()) ||
    calls_r(env_id) || length(remembering(wrapper_names(noted_wrappers(env_id))))
  if (played_here) {
    return(NULL)
  }
  check_dots_named(arguments, "seed = 1", call)
  check_client(client, call = call)
  described <- known_description(client, env_id, arguments, call)
  other_size <- isTRUE(described$one_seed) && !is.null(num_envs) && num_envs != described$num_envs
  if (is.null(described) || other_size) {
    return(NULL)
  }
  described$num_envs <- as.integer(num_envs %||% described$num_envs)
  described$batch_size <- episodes_of_batch(described$num_envs)
  described
}

# The server's description of an environment, `NULL` if it does not play it itself.
known_description <- function(client, env_id, arguments, call) {
  if (!plays_rollouts(client, call)) {
    return(NULL)
  }
  known <- known_of_env(client, env_id, arguments)
  known$described <- known$described %||% list(ask_description(client, env_id, arguments, call))
  described <- known$described[[1L]]
  if (!is.null(described)) described$known <- known
  described
}

# The names of arguments that do not belong to the environment.
how_made <- function() {
  setdiff(names(formals(make_unseeded)), c("env_id", "...", "client", "call"))
}

# Whether it is given by an id that a server knows.
is_made_by_server <- function(env) is_given_by_id(env) && !is_registered(env)

ask_description <- function(client, env_id, arguments, call) {
  wrappers <- noted_wrappers(env_id)
  fields <- c(
    env_id = json_string(bare_id(env_id)), kwargs = if (length(arguments)) to_json(arguments),
    wrappers = if (length(wrappers)) wrappers_json(wrappers)
  )
  answer <- tryCatch(
    withCallingHandlers(
      perform_request(
        prepare_request(client, rollouts_route, fields = fields, repeatable = TRUE), call = call
      ),
      gym_error_http_400 = function(cnd) explain_unknown_argument(cnd, names(arguments), call)
    ),
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% c("not_supported", "too_many_processes"))) rlang::cnd_signal(cnd)
    }
  )
  warn_as_gymnasium(answer)
  if (!is.null(answer) && !length(answer$remembers)) {
    described_env(client, answer, fields, wrappers, arguments)
  }
}

rollouts_route <- "/v1/rollouts/"

described_env <- function(client, answer, fields, wrappers, arguments) {
  check_description(answer)
  observed <- read_space(answer, "observation_space")
  observed$names <- observation_names(answer$env_id, observed, wrapper_names(wrappers))
  num_envs <- answer$group %||% count_sub_envs(observation_bytes(observed))
  new_vector_env(
    observed, read_space(answer, "action_space"),
    c(
      read_spec(answer$env_id, answer$spec),
      list(wrappers = wrapper_names(wrappers), kwargs = arguments)
    ),
    num_envs, episodes_of_batch(num_envs), one_seed = !is.null(answer$group), client = client,
    description = list(
      fields = fields, group = answer$group, processes = answer$processes %||% 1L,
      needs_max_steps = answer$needs_max_steps %||% is.null(answer$spec$max_episode_steps),
      versions = answer$versions, processor = shown_line(string_or_null(answer$processor))
    )
  )
}

check_description <- function(answer) {
  is_natural <- function(x) is_number(x) && are_whole(x, 1, 2^24)
  check_optional(answer, "env_id", rlang::is_string, "a string")
  check_optional(answer, "spec", is_object, "an object")
  check_optional(answer, "group", is_natural, "a whole number")
  check_optional(answer, "processes", is_natural, "a whole number")
  check_optional(answer, "needs_max_steps", rlang::is_bool, "true or false")
  check_optional(answer$spec, "max_episode_steps", is_number, "a number")
}
