#' gym: R at the wheel of Gymnasium
#'
#' Use the environments of [Gymnasium](https://gymnasium.farama.org) from R. [gym_make()] makes an
#' environment, [rollout()] plays a policy in it, and [search_random()] finds the weights of a small
#' neural network that solves it. The classic client calls ([env_create()], [env_reset()],
#' [env_step()] and the others) work as they always did.
#'
#' @section Words:
#' * **Environment**: a task. A step takes an *action* and gives an *observation* and a *reward*.
#' * **Space**: the set that actions or observations belong to, see [space_sample()].
#' * **Episode**: the steps from a reset to the end. An episode ends by the rules of the task
#'   (*terminated*) or by a limit (*truncated*). Its *return* is the sum of its rewards.
#' * **Vector environment**: `num_envs` *sub-environments* that are stepped together. The column
#'   `sub_env` holds their numbers; the argument `which` selects some of them.
#' * **Policy**: a function of the observation that chooses the action.
#' * **Candidate**: one set of weights that a search tries. An **iteration** tries one or several.
#' * **Instance**: an environment on a server, where it has an id.
#'
#' @section Errors:
#' Every error of this package has class `gym_error` and one of these classes:
#'
#' | class | when |
#' |---|---|
#' | `gym_error_argument` | an argument has a wrong value; nothing was sent |
#' | `gym_error_space` | an action or observation does not fit its space |
#' | `gym_error_environment` | a function of an environment written in R raised an error |
#' | `gym_error_http` | the server refused the request |
#' | `gym_error_connection` | no server, connection lost, timeout, or an unreadable answer |
#' | `gym_error_server_start` | a server could not be started |
#' | `gym_error_install` | the server's software could not be installed |
#' | `gym_error_checkpoint` | a checkpoint cannot be read, resumed or written |
#' | `gym_error_search` | a search failed early; the field `result` has the finished part |
#' | `gym_error_training` | a training failed early; the field `result` has the finished part |
#' | `gym_error_agent` | an agent returned a wrong value, or a return is not finite |
#'
#' A `gym_error_http` also has a class with the status, such as `gym_error_http_400`, and the fields
#' `status` (a number), `code` (a word for programs, such as `"unknown_instance"`) and `hint` (a
#' string or `NULL`).
#'
#' ```r
#' tryCatch(
#'   env_step(client, "0123abcd", 1),
#'   gym_error_http_400 = function(cnd) cnd$code,
#'   gym_error_connection = function(cnd) "no server"
#' )
#' ```
#'
#' @section Options: `gym.max_answer_bytes`: the size of the largest answer that R accepts from a
#' server, in bytes. The default is 2^29 (half a gigabyte). The limit for JSON is a sixteenth of
#' this number, because R needs much more memory for JSON. As soon as an answer passes the limit,
#' the call raises a `gym_error_connection`. R does not decompress answers.
#'
#' `gym.print_seconds`: whether [print()] shows when a result was made and how long that took.
#' `FALSE` leaves these times out, so that a report with fixed seeds is the same each time you knit
#' it.
#'
#' `gym.viewer`: how a page opens, see [env_watch()].
#'
#' R shows texts from a server, in errors and names, without control characters, and shortens long
#' ones.
#'
#' @examplesIf gym:::can_start_server()
#' search <- search_random("CartPole-v0", seed = 1)
#' search
#' plot(search)
#'
#' @importFrom R6 R6Class
#' @importFrom rlang %||% .data
#' @keywords internal
"_PACKAGE"

.onLoad <- function(libname, pkgname) {
  the_session$pid <- Sys.getpid()
  the_session$prompt_for_server <- prompt_for_server
  reg.finalizer(the_session, end_session, onexit = TRUE)
  register_with_gganimate()
}
