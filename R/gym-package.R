#' gym: R at the wheel of Gymnasium
#'
#' Plays the environments of [Gymnasium](https://gymnasium.farama.org) from R.
#' [gym_make()] makes an environment, [rollout()] plays a policy in it,
#' [search_random()] finds the weights of a small neural network that solves
#' it. The classic client calls ([env_create()], [env_reset()], [env_step()]
#' and the others) work as they always did.
#'
#' @section Words:
#' * **Environment**: a task. A step takes an *action* and gives an *observation* and a *reward*.
#' * **Space**: the set to which actions or observations belong, see [space_sample()].
#' * **Episode**: the steps from a reset to the end, which comes by the task's own rules
#'   (*terminated*) or by a limit (*truncated*). Its *return* is the sum of its rewards.
#' * **Vector environment**: `num_envs` *sub-environments* that are stepped at once; the column
#'   `sub_env` counts them, the argument `which` picks some.
#' * **Policy**: what chooses the actions, a function of the observation.
#' * **Candidate**: one set of weights that a search tries; an **iteration** tries one or several.
#' * **Instance**: an environment on a server, which has an id there.
#'
#' @section Errors:
#' Every error of this package has class `gym_error` and one of these classes:
#'
#' | class | when |
#' |---|---|
#' | `gym_error_argument` | an argument is not what the function takes; nothing was sent |
#' | `gym_error_space` | an action or observation does not fit its space |
#' | `gym_error_environment` | a function of an environment written in R raised an error |
#' | `gym_error_http` | the server refused |
#' | `gym_error_connection` | no server there, connection lost, time over; an answer that is none |
#' | `gym_error_server_start` | a server could not be started |
#' | `gym_error_install` | what the server needs could not be installed |
#' | `gym_error_checkpoint` | a search or a training cannot go on from its file, or not keep one |
#' | `gym_error_search` | a search ended early; what was played is its field `result` |
#' | `gym_error_training` | the same of a training |
#' | `gym_error_agent` | an agent returned what it must not, or a candidate's return is not finite |
#'
#' A `gym_error_http` also has a class with the status, such as
#' `gym_error_http_400`, and the fields `status` (a number), `code` (a word for
#' programs, such as `"unknown_instance"`) and `hint` (a string or `NULL`).
#'
#' ```r
#' tryCatch(
#'   env_step(client, "0123abcd", 1),
#'   gym_error_http_400 = function(cnd) cnd$code,
#'   gym_error_connection = function(cnd) "no server"
#' )
#' ```
#'
#' @section Options:
#' `gym.max_answer_bytes`: how many bytes an answer of a server may have, a number; the default is
#' 2^29, half a gigabyte. Of JSON, of which R makes much more, it may be a sixteenth. A larger
#' answer ends with a `gym_error_connection` as soon as so much has come. Compressed
#' answers are not decompressed. `gym.viewer` is described at [env_watch()].
#'
#' Whatever a server says in an error or by a name is shown without control characters, and cut
#' where it is long.
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
