#' List the available environments
#'
#' List the environments that the server can make, those that require an extra (see
#' [gym_server_install()]), some that it cannot make at all, and the environments in R that this
#' session has registered (see [gym_register()]).
#'
#' @param client A client. The default is the session's client, [gym_client()].
#' @param search A text to look for in the ids, ignoring case. If there is no match, similar ids are
#'   listed. `NULL`, the default, lists all.
#' @return A data frame with one row for each environment: `id` (a string), `max_episode_steps`
#'   (integer, the limit of an episode, `NA` for none), `reward_threshold` (double, the mean return
#'   from which it counts as solved, `NA` for none), `vectorised` (logical, whether it has its own
#'   vector implementation), `extra` (a string, the extra of the server that it requires, such as
#'   `"box2d"`, `NA` for none), `available` (logical, whether it can be made) and `reason` (a
#'   string, why it cannot be made, or `NA`; older servers give none).
#' @section Errors: `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' nrow(env_registry())
#' env_registry(search = "cartpole")
#' env_registry(search = "FrozenLaek")$id
env_registry <- function(client = gym_client(), search = NULL) {
  check_client(client)
  check_string(search, allow_null = TRUE)
  route <- paste0("/v1/registry/", query_text(list(search = search)[!is.null(search)]))
  environments <- get_answer(client, route)$environments
  servers <- data.frame(
    id = listed_texts(environments, "id", ""),
    max_episode_steps = listed_counts(environments, "max_episode_steps"),
    reward_threshold = listed_numbers(environments, "reward_threshold"),
    vectorised = listed_flags(environments, "vectorised"),
    extra = listed_texts(environments, "extra"),
    available = listed_flags(environments, "available"),
    reason = listed_texts(environments, "reason")
  )
  own <- registered_rows(search)
  rbind(servers[!servers$id %in% own$id, ], own, make.row.names = FALSE)
}

# The environments that were made ---------------------------------------------------------

#' List the environments on a server
#'
#' For a server that several sessions share: list its environments with their names, age and last
#' use. [env_list_all()] returns only their ids.
#'
#' @inheritParams env_registry
#' @return A data frame with one row for each environment of all clients, the oldest first:
#'   `instance_id` (a string, for [env_close()] and the other classic calls), `name` (a string,
#'   given by its owner in [gym_make()] or [env_create()], or `NA`), `env_id` (a string), `num_envs`
#'   (integer, the number of sub-environments, `NA` for a single environment), `age` and `idle`
#'   (double, the seconds since it was made and since it was last reset or stepped), `steps`
#'   (double, the number of steps, in all sub-environments together) and `watched` (logical, whether
#'   somebody watches it).
#' @section Errors: `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", name = "first try")
#' env_list()
#' env$close()
env_list <- function(client = gym_client()) {
  check_client(client)
  close_queued(client)
  instances <- get_answer(client, "/v1/instances/")$instances
  data.frame(
    instance_id = listed_texts(instances, "instance_id", ""),
    name = listed_texts(instances, "name"),
    env_id = listed_texts(instances, "env_id", ""),
    num_envs = listed_counts(instances, "num_envs"),
    age = listed_numbers(instances, "age_seconds"),
    idle = listed_numbers(instances, "idle_seconds"),
    steps = listed_numbers(instances, "steps"),
    watched = listed_flags(instances, "watched")
  )
}
