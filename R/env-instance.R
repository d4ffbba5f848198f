# Creates and closes environments on a server, and keeps what a client knows about them.

create_instance <- function(client, env_id, seed, render_mode, kwargs, wrappers, num_envs = NULL,
                            vectorization_mode = NULL, autoreset_mode = NULL, name = NULL,
                            num_workers = NULL, call = rlang::caller_env()) {
  check_wrappers(wrappers, call = call)
  given <- given_id(env_id)
  wrappers <- c(given$wrappers, wrappers)
  env_id <- given$id %||% env_id
  calling_r <- intersect(wrapper_names(wrappers), names(transforms))
  if (length(calling_r)) {
    abort_wrong("wrappers", calling_r, call,
                "{calling_r[[1L]]} calls an R function, which an instance on a server cannot do.",
                i = "Use `gym_make()` instead of the classic calls.")
  }
  check_string(env_id, call = call)
  check_string(render_mode, allow_null = TRUE, call = call)
  check_count(num_envs, allow_null = TRUE, call = call)
  if (!is.null(vectorization_mode)) {
    check_choice(vectorization_mode, vectorization_modes, call = call)
  }
  if (!is.null(autoreset_mode)) check_choice(autoreset_mode, autoreset_modes, call = call)
  check_count(num_workers, min = 0, allow_null = TRUE, call = call)
  of_sub_envs <- c(
    vectorization_mode = vectorization_mode, autoreset_mode = autoreset_mode,
    num_workers = num_workers
  )
  abort_if(
    is.null(num_envs) && length(of_sub_envs), names(of_sub_envs)[[1L]], of_sub_envs[[1L]], call,
    "`{names(of_sub_envs)[[1L]]}` is for an environment with sub-environments.",
    i = "Give their number as `num_envs`."
  )
  check_string(name, allow_null = TRUE, call = call)
  numbers <- list(num_envs = num_envs, num_workers = num_workers)
  texts <- list(
    env_id = env_id, vectorization_mode = vectorization_mode, autoreset_mode = autoreset_mode,
    render_mode = render_mode, name = name
  )
  fields <- c(
    vapply(numbers[lengths(numbers) > 0L], whole_text, ""), json_texts(texts[lengths(texts) > 0L]),
    seed = encode_seed(seed, num_envs, call), kwargs = if (length(kwargs)) to_json(kwargs),
    wrappers = if (length(wrappers)) wrappers_json(wrappers)
  )
  if (identical(render_mode, "human")) check_viewer(call)
  close_queued(client)
  answer <- create_on_server(client, fields, call)
  instance_id <- answer$instance_id
  ready <- FALSE
  on.exit(if (!ready) close_unused(client, instance_id))
  if (is.null(answer$action_space)) {
    gym_abort(
      c(paste0("The server at ", client$remote_base, " is an old one, such as that of ",
               "gym-http-api: it does not describe its environments."),
        i = "`gym_server_start()` starts this package's server, which has the same calls."),
      class = "gym_error_http", code = "not_supported", call = call
    )
  }
  instances <- client_state(client)$instances
  instances[[instance_id]] <- new_instance(client, instance_id, answer)
  if (identical(render_mode, "human")) watch_once(known_instance(client, instance_id, call), call)
  warn_as_gymnasium(answer)
  ready <- TRUE
  instance_id
}

close_instance <- function(client, instance_id, call = rlang::caller_env()) {
  route <- paste0(instance_route(instance_id), "close/")
  post_answer(client, route, key = next_key(client_state(client)$keys), call = call)
  forget_instance(instance_place(client, instance_id))
  instances <- client_state(client)$instances
  if (!is.null(instances[[instance_id]])) rm(list = instance_id, envir = instances)
}

# Closes an instance that may not exist any more.
close_if_there <- function(client, instance_id, call = rlang::caller_env()) {
  tryCatch(
    close_instance(client, instance_id, call),
    gym_error_http = function(cnd) {
      if (!isTRUE(cnd$code %in% gone_codes)) rlang::cnd_signal(cnd)
      forget_instance(instance_place(client, instance_id))
    }
  )
}

# The codes of errors for an instance that was closed or removed.
gone_codes <- c("unknown_instance", "instance_idle_closed", "call_too_long", "environment_died")

# What the client knows about an instance. It asks the server only once.
known_instance <- function(client, instance_id, call = rlang::caller_env()) {
  instances <- if (inherits(client, "GymClient")) client_state(client)$instances
  is_name <- is.character(instance_id) && length(instance_id) == 1L && nzchar(instance_id)
  instance <- if (is_name) instances[[instance_id]]
  # A known instance was checked when the client first asked about it. Checking each time whether
  # the server still runs would make a step a tenth slower.
  if (is.null(instance)) {
    check_client(client, "x", call)
    check_string(instance_id, call = call)
    check_not_ended(client, instance_id, call)
    answer <- get_answer(client, instance_route(instance_id), call = call)
    instance <- instances[[instance_id]] <- new_instance(client, instance_id, answer)
  }
  instance
}

read_space <- function(answer, name) {
  read_values(new_space(answer[[name]]), paste0("Its `", name, "`"))
}

#' Find out whether an instance has ended with its server
#'
#' For a server of this session, this checks the server's process. For an object from another
#' session, for example one read by `readRDS()`, it asks the server.
#' @param pid The id of the process in which the instance was made.
#' @return What has ended, in words; `NULL` if nothing has.
#' @noRd
end_of_instance <- function(client, instance_id, pid) {
  base <- client$remote_base
  if (!is.null(the_session$servers[[base]])) {
    return(if (!is_running(base)) "on a server that has ended")
  }
  if (!identical(pid, Sys.getpid())) {
    gone <- function(cnd) "in a session that has ended"
    tryCatch(
      {
        get_answer(client, instance_route(instance_id))
        NULL
      },
      gym_error_connection = gone, gym_error_http_401 = gone, gym_error_http_404 = gone
    )
  }
}

# As end_of_instance(), for a classic call, which names the instance by its id.
end_of_named <- function(client, instance_id) {
  state <- client_state(client)
  known <- !is.null(state$instances[[instance_id]])
  end_of_instance(client, instance_id, if (known) Sys.getpid() else state$made_in)
}

check_not_ended <- function(client, instance_id, call = rlang::caller_env()) {
  ended <- end_of_named(client, instance_id)
  if (!is.null(ended)) {
    abort_closed("`env_create()` makes a new one.", call, paste("made", ended), client)
  }
}

# Makes the client's record of an instance from the server's description.
new_instance <- function(client, instance_id, about) {
  instance <- new.env(parent = emptyenv())
  instance$client <- client
  instance$id <- instance_id
  instance$route <- instance_route(instance_id)
  instance$num_envs <- about$num_envs
  instance$num_workers <- about$num_workers
  instance$vectorization_mode <- shown_line(about$vectorization_mode)
  instance$autoreset_mode <- shown_line(about$autoreset_mode)
  instance$single_action_space <- read_space(about, "action_space")
  observed <- read_space(about, "observation_space")
  wrappers <- lapply(about$wrappers, function(wrapper) wrapper["name"])
  observed$names <- observation_names(about$env_id, observed, as.character(unlist(wrappers)))
  instance$single_observation_space <- observed
  instance$name_observation <- naming(observed, batch = !is.null(about$num_envs))
  instance$actions <- sent_space(instance$single_action_space, about$num_envs)
  instance$observations <- sent_space(observed, about$num_envs)
  instance$sends_tensors <- travels_as_tensors(instance$single_action_space, about$num_envs)
  instance$spec <- read_spec(about$env_id, about)
  instance$draws <- !is.null(about$render_mode)
  instance$takes_numbers <- takes_numbers(observed, about$num_envs)
  instance$done <- FALSE
  # The prepared requests: one for each combination of a call's flags, made at the first such
  # call.
  instance$resets <- vector("list", 4L)
  instance$steps <- vector("list", 16L)
  instance
}

# Reads the server's description of an environment's spec.
read_spec <- function(env_id, spec) {
  threshold <- spec$reward_threshold
  c(
    list(
      id = shown_line(env_id),
      reward_threshold = if (!is.null(threshold)) number_from_json(threshold),
      max_episode_steps = spec$max_episode_steps,
      # The environment's own metadata may be anything.
      render_fps = if (is_number(spec$render_fps)) spec$render_fps
    ),
    if (length(spec$engine)) list(engine = lapply(spec$engine, shown_line))
  )
}

# Passes on Gymnasium's warnings about an environment that the server made.
warn_as_gymnasium <- function(answer) {
  for (text in lapply(answer$warnings, shown_line)) {
    rlang::warn(text, class = "gym_warning_gymnasium", .frequency = "once",
                .frequency_id = paste("gym", text))
  }
}

# Makes the space of all sub-environments only when somebody asks for it: the bounds of thousands
# of pictures take much memory.
instance_space <- function(instance, which = c("action_space", "observation_space")) {
  if (is.null(instance$num_envs)) {
    return(instance[[paste0("single_", which)]])
  }
  instance[[which]] %||% (
    instance[[which]] <- spread_bounds(instance[[sub("_space", "s", which)]])
  )
}

# Writes the seeds as JSON: one seed for all sub-environments; one for each of them, NA for none;
# or a list with several for each, the later ones for the episodes that it starts itself.
encode_seed <- function(seed, num_envs = NULL, call = rlang::caller_env()) {
  if (is.null(seed)) {
    return(NULL)
  }
  if (inherits(seed, "gym_seed_lists")) {
    # A vector of seeds for each sub-environment, `NA` for those that are not reset.
    is_none <- function(one) identical(one, NA_real_)
    fits <- function(one) is_none(one) || length(one) && are_whole(one, 0, largest_seed)
    if (is.null(num_envs) || length(seed) != num_envs || !all(vapply(seed, fits, NA))) {
      abort_argument(seed, "a list with a vector of seeds for each sub-environment", "seed", call)
    }
    texts <- function(one) if (is_none(one)) "null" else json_array(whole_text(one))
    return(json_array(vapply(seed, texts, "")))
  }
  seed <- plain_numbers(seed, call = call)
  if (is.null(num_envs) || length(seed) == 1L) {
    check_seed(seed, min = 0, call = call)
    return(whole_text(seed))
  }
  check_sub_env_seeds(seed, num_envs, call)
  json_array(ifelse(is.na(seed), "null", whole_text(seed)))
}

# FrozenLake's random maps -----------------------------------------------------------------

# Gymnasium draws a random map in the constructor, from a generator that nobody can seed. So R
# draws the map from the seed of the run and sends it.

lake_size <- 8L
chance_of_ice <- 0.8

#' Draw the map of a FrozenLake if it is to be random
#'
#' @param env An environment, or its id.
#' @param arguments The arguments that it is made with.
#' @param seed The seed of the map. If there are several seeds, it is the first that is not `NA`.
#'   `NULL` leaves the map to the server.
#' @return The arguments, with the map as `desc`.
#' @noRd
with_random_map <- function(env, arguments, seed) {
  seed <- stats::na.omit(unlist(seed))
  if (length(seed) && is.numeric(seed) && wants_random_map(env, arguments)) {
    arguments$desc <- with_generator(new_generator(seed[[1L]]), draw_lake())
  }
  arguments
}

# FrozenLake draws a random map only if `map_name` is NULL and there is no `desc`.
wants_random_map <- function(env, arguments) {
  id <- given_id(env)$id
  rlang::is_string(id) && grepl("^FrozenLake", id) && "map_name" %in% names(arguments) &&
    is.null(arguments[["map_name"]]) && is.null(arguments[["desc"]])
}

# Like Gymnasium, draws all cells until there is a way from the start to the goal.
draw_lake <- function() {
  repeat {
    cells <- matrix(stats::runif(lake_size^2) < chance_of_ice, lake_size)
    cells[c(1L, lake_size^2)] <- TRUE
    if (has_way(cells)) break
  }
  cells[] <- ifelse(cells, "F", "H")
  cells[c(1L, lake_size^2)] <- c("S", "G")
  apply(cells, 1L, paste, collapse = "")
}

# Is there a way over ice from the first cell to the last?
has_way <- function(ice) {
  n <- nrow(ice)
  reached <- row(ice) == 1L & col(ice) == 1L
  repeat {
    beside <- rbind(reached[-1L, ], FALSE) | rbind(FALSE, reached[-n, ]) |
      cbind(reached[, -1L], FALSE) | cbind(FALSE, reached[, -n])
    grown <- ice & (reached | beside)
    if (identical(grown, reached)) {
      return(reached[n, n])
    }
    reached <- grown
  }
}
