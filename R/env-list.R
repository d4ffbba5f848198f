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
