#' List who has which environment on a server
#'
#' For a server that several sessions share: which environments it runs, for how long,
#' and when each was last used. [env_list_all()] tells their ids alone, as ever.
#'
#' @inheritParams env_registry
#' @return A data frame with one row for each environment of all of the server's
#'   clients, the oldest first: `instance_id` (a string, for [env_close()] and the other
#'   classic calls), `name` (a string, what its owner called it by [gym_make()] or
#'   [env_create()], `NA` for none), `env_id` (a string), `num_envs` (integer, its lanes,
#'   `NA` for an environment without), `age` and `idle` (double, the seconds since it was
#'   made and since it was last reset or stepped), `steps` (double, how many it has
#'   taken, in all lanes together) and `watched` (logical, whether somebody watches it).
#' @section Errors: `gym_error_argument`, `gym_error_connection`.
#' @export
#' @examplesIf gym:::can_start_server()
#' env <- gym_make("CartPole-v1", name = "first try")
#' env_list()
#' env$close()
env_list <- function(x = gym_client()) {
  check_client(x)
  close_abandoned(x)
  instances <- get_answer(x, "/v1/instances/")$instances
  column <- function(name, missing) {
    vapply(instances, function(instance) instance[[name]] %||% missing, missing)
  }
  # JSON writes a whole number without a point, as an integer.
  number <- function(name) {
    vapply(instances, function(instance) number_from_json(instance[[name]]), 0)
  }
  data.frame(
    instance_id = column("instance_id", ""),
    name = column("name", NA_character_),
    env_id = column("env_id", ""),
    num_envs = column("num_envs", NA_integer_),
    age = number("age_seconds"),
    idle = number("idle_seconds"),
    steps = number("steps"),
    watched = column("watched", NA)
  )
}
