#' Make an animation of an episode
#'
#' Write an episode as an animated GIF file or an MP4 video. A rollout must have been played with
#' `frames = TRUE`. For a search, a training or a policy, `animate()` plays a new episode. Printing
#' the result in an interactive session opens the file in RStudio's viewer, or in the browser if
#' there is no viewer. `options(gym.viewer = )` sets another function, or `FALSE` to open nothing. A
#' knitr document shows the animation on the page; with LaTeX it shows a
#' [filmstrip][plot.gym_rollout()]. A temporary file is deleted at the end of its session. If the
#' file is gone, printing draws a GIF again from the stills in the result.
#'
#' A GIF requires the package magick. An MP4 requires the package av, or the program ffmpeg, which
#' the server's extra `"video"` includes (see [gym_server_install()]).
#'
#' The animation has the environment's own speed. Browsers slow down a GIF that has more than 50
#' frames a second. For a faster environment, the GIF therefore shows only every second frame, or
#' fewer.
#'
#' @param x A rollout, a search, a training, or a policy as for [rollout()].
#' @param file The file to write; its name ends in `.gif` or `.mp4`. `NULL`, the default, is a
#'   temporary GIF file.
#' @param fps The number of steps per second, a number. `NULL`, the default, uses the environment's
#'   own speed (50 in CartPole; 30 if it has none).
#' @param ... For methods.
#' @param episode The episode of the rollout to show, a whole number. The default is the first.
#' @param candidate The candidate whose episode to show, if several policies were played, a whole
#'   number. The default is the first.
#' @param width The width in pixels, a whole number. `NULL`, the default, is that of the
#'   environment's frames (600 in CartPole). In an MP4, width and height are even.
#' @param every Show every frame (1), every second one (2), and so on, at the same speed. The last
#'   frame is always shown. `NULL`, the default, shows as many frames as the format allows at that
#'   speed. If `every` is too small for that, a larger number is used, with a message.
#' @param seed A whole number that fixes the episode played, as in [rollout()].
#' @param env,max_steps,client The environment, the step limit and the client, as in [rollout()].
#' @return An object of class `gym_animation`, a list of `file` (its path, a string), `steps` (the
#'   number of steps before each frame, integers), `delays` (how long each is shown, in hundredths
#'   of a second, integers; a second for the last), `size` (width and height in pixels) and
#'   `stills`, the frames of a filmstrip, at most 8.
#' @section Errors: `gym_error_argument` for an invalid argument, a rollout without frames, an
#'   environment that cannot be drawn, or if the software that writes the file is missing. Playing
#'   an episode can raise the errors of [rollout()].
#' @seealso [plot.gym_rollout()] for a filmstrip on paper.
#' @export
#' @examplesIf gym:::can_start_server() && requireNamespace("magick", quietly = TRUE)
#' # The pole falls to the right: push the cart to the right.
#' follow_pole <- function(observation) as.integer(observation[, "pole_angle"] > 0)
#' played <- rollout("CartPole-v1", follow_pole, seed = 1, frames = TRUE)
#' animate(played, width = 300)
#'
#' # Play a new episode with the policy that a search found.
#' search <- search_random("CartPole-v0", seed = 1)
#' animate(search, seed = 1, width = 300, every = 4)
animate <- function(x, file = NULL, fps = NULL, ...) UseMethod("animate")

#' @export
animate.default <- function(x, file = NULL, fps = NULL, ...) {
  if (!is.null(given_id(x)) || is_playable(x)) {
    abort_wrong("x", x, rlang::current_env(),
                "`animate()` shows an episode that was played, and `x` is an environment.",
                i = "`animate(rollout(env, policy, frames = TRUE))` plays one.")
  }
  abort_argument(x, "a rollout, a search, a training or a policy", "x", rlang::current_env())
}

#' @rdname animate
#' @export
animate.gym_rollout <- function(x, file = NULL, fps = NULL, ..., episode = 1, width = NULL,
                                every = NULL, candidate = 1) {
  check_dots_empty(...)
  file <- check_animation(file, fps, width, every)
  new_animation(episode_frames(x, episode, candidate), file, fps, width, every)
}

#' @rdname animate
#' @export
animate.gym_training <- function(x, file = NULL, fps = NULL, ..., seed = NULL, width = NULL,
                                 every = NULL, client = x$client %||% gym_client()) {
  check_dots_empty(...)
  check_found(x)
  # exec() would evaluate `client` first, and so start a server that an environment in R does not
  # need.
  animate_episode(
    rlang::inject(rollout(
      x$env %||% x$env_id, x$policy, max_steps = x$max_steps, seed = seed, client = client,
      frames = TRUE, !!!x$kwargs
    )),
    file, fps, width, every
  )
}

#' @rdname animate
#' @export
animate.gym_policy <- function(x, file = NULL, fps = NULL, ..., env, seed = NULL, max_steps = NULL,
                               width = NULL, every = NULL, client = gym_client()) {
  check_dots_empty(...)
  animate_episode(
    rollout(env, x, max_steps = max_steps, seed = seed, client = client, frames = TRUE),
    file, fps, width, every
  )
}

#' @rdname animate
#' @export
animate.function <- animate.gym_policy

# gganimate has a generic function of the same name. Register these methods for it as well, so that
# `animate()` finds them whichever of the two packages was attached last. The registration waits
# until gganimate is loaded, because gganimate may not be installed.
register_with_gganimate <- function() {
  register <- function(...) register_animate(asNamespace("gganimate"))
  if (isNamespaceLoaded("gganimate")) register()
  setHook(packageEvent("gganimate", "onLoad"), register)
}

# `home`: the environment of the generic function.
register_animate <- function(home) {
  for (class in c("gym_rollout", "gym_training", "gym_policy")) {
    method <- get(paste0("animate.", class), topenv())
    registerS3method("animate", class, method, envir = home)
  }
}

# Checks everything before an episode is played. Returns the file's absolute path.
check_animation <- function(file, fps, width, every, call = rlang::caller_env()) {
  check_number(fps, min = 0.1, allow_null = TRUE, call = call)
  check_count(width, max = 65535, allow_null = TRUE, call = call)
  check_count(every, allow_null = TRUE, call = call)
  if (!is.null(file)) {
    if (!rlang::is_string(file) || !grepl("[.](gif|mp4)$", tolower(file))) {
      abort_argument(file, "the name of a file that ends in .gif or .mp4, or NULL", "file", call)
    }
    if (!dir.exists(dirname(file))) {
      abort_argument(file, "in a folder that exists", "file", call)
    }
  }
  if (!is_mp4(file)) {
    check_suggested("magick", "write a GIF", call)
  } else if (!is_av_there() && is.null(find_ffmpeg())) {
    abort_wrong("file", file, call,
                "Writing an MP4 file requires the package av or the program ffmpeg.",
                i = "`install.packages(\"av\")` installs the package; a .gif file needs neither.")
  }
  if (!is.null(file)) absolute_path(file)
}

is_mp4 <- function(file) !is.null(file) && endsWith(tolower(file), ".mp4")

#' Get the frames of an episode of a rollout
#' @noRd
episode_frames <- function(x, episode = 1, candidate = 1, call = rlang::caller_env()) {
  row <- episode_row(x, episode, candidate, call)
  if (is.null(x$frames)) {
    abort_wrong("x", x, call, "This rollout was played without frames.",
                i = "`rollout(..., frames = TRUE)` keeps them.")
  }
  x$frames[[row]]
}

# Makes an animation of the rollout that `code` plays. `code` is a whole call, because an
# environment may have an argument named `width`, too.
animate_episode <- function(code, file, fps, width, every, call = rlang::caller_env()) {
  file <- check_animation(file, fps, width, every, call)
  played <- naming_own_call(code, "rollout", call)
  new_animation(episode_frames(played), file, fps, width, every, call)
}

new_animation <- function(frames, file, fps, width, every, call = rlang::caller_env()) {
  # The environment's author wrote the number of frames per second, so it may be anything.
  own <- attr(frames, "fps")
  fps <- fps %||% if (is_number(own) && own > 0) own else 30
  video <- is_mp4(file)
  plan <- animation_plan(length(frames), fps, every, if (video) Inf else fastest_fps)
  pngs <- unclass(frames)[plan$steps + 1L]
  # Write a temporary file first, so that an interrupt leaves an existing file as it was.
  written <- temporary_file(fileext = if (video) ".mp4" else ".gif")
  size <- if (video) {
    write_mp4(pngs, written, fps / (every %||% 1), width, call)
  } else {
    write_gif(pngs, written, plan$delays, width)
  }
  if (!is.null(file)) {
    if (!suppressWarnings(file.copy(written, file, overwrite = TRUE))) {
      abort_argument(file, "a file that can be written", "file", call)
    }
    unlink(written)
  }
  structure(class = "gym_animation", list(
    file = file %||% written, steps = plan$steps, delays = plan$delays, size = size,
    stills = pick_stills(frames, 8L)
  ))
}

#' Plan which frames to show, and for how long
#' @param n The number of frames.
#' @return A list: `steps`, the number of steps before each frame, and `delays`, in hundredths of a
#'   second, rounded so that errors do not add up.
#' @noRd
animation_plan <- function(n, fps, every = NULL, fastest = fastest_fps) {
  # The smallest `every` that keeps the speed within the format's limit.
  least <- max(1, ceiling(fps / fastest))
  if (!is.null(every) && every < least) {
    rlang::inform(
      c(paste0("`every` is ", least, " instead of ", every, ", because a GIF can show at most ",
               fastest, " frames a second, and there are ", number_text(fps), "."),
        i = "A lower `fps` shows more of the frames, at a slower pace."),
      class = "gym_message_every"
    )
  }
  every <- max(every, least)
  steps <- unique(as.integer(c(seq(0, n - 1, by = every), n - 1)))
  delays <- diff(round(100 * steps / fps))
  list(steps = steps, delays = as.integer(pmin(pmax(c(delays, 100), 100 / fastest), 65535)))
}

# Browsers slow down animations with more frames a second.
fastest_fps <- 50

# Showing it ------------------------------------------------------------------------

#' @export
print.gym_animation <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  if (!file.exists(x$file)) {
    x <- redrawn_if_gone(x)
    stills <- count_of(length(x$stills$steps), "still")
    cat("  gone; its ", stills, " are in ", x$file, "\n", sep = "")
  }
  open_address(among_temporary_files(x$file), check_viewer())
  invisible(x)
}

# saveRDS() and knitr's cache keep the object for longer than a temporary file lives.
redrawn_if_gone <- function(x, call = rlang::caller_env()) {
  if (file.exists(x$file)) {
    return(x)
  }
  check_suggested("magick", "draw an animation again whose file has gone", call)
  stills <- x$stills
  # Each still is shown until the next one, and the last as long as before.
  last <- x$delays[[length(x$delays)]]
  share <- if (length(stills$steps) > 1L) stills$steps / max(stills$steps) else 0
  delays <- c(diff(round(share * (sum(x$delays) - last))), last)
  x$file <- temporary_file(fileext = ".gif")
  write_gif(unclass(stills$frames), x$file, pmin(delays, 65535), x$size[[1L]])
  x
}

# RStudio's viewer shows only files in the session's temporary directory.
among_temporary_files <- function(file) {
  folders <- paste0(normalizePath(c(dirname(file), tempdir()), "/"), "/")
  if (startsWith(folders[[1L]], folders[[2L]])) {
    return(file)
  }
  copy <- temporary_file(fileext = paste0(".", tools::file_ext(file)))
  file.copy(file, copy)
  copy
}

#' @export
format.gym_animation <- function(x, ...) {
  kilobytes <- if (file.exists(x$file)) {
    paste0(", ", number_text(ceiling(file.size(x$file) / 1024)), " kB")
  }
  paste0(
    "<gym_animation: ", count_of(length(x$steps), "picture"), " of ",
    paste(x$size, collapse = " x "), " pixels, ", format(sum(x$delays) / 100), " s",
    kilobytes, ">\n  ", x$file
  )
}

# Copies the file into the folder of the document's figures. LaTeX cannot show an animation, so it
# gets a filmstrip.
#' @exportS3Method knitr::knit_print
knit_print.gym_animation <- function(x, options = knitr::opts_current$get(), ...) {
  hash <- substr(rlang::hash(unclass(x)[names(x) != "file"]), 1L, 8L)
  path <- function(ending) {
    path <- knitr::fig_path(paste0("-", hash, ending), options, number = NULL)
    dir.create(dirname(path), showWarnings = FALSE, recursive = TRUE)
    path
  }
  if (knitr::is_latex_output()) {
    shown <- path(".pdf")
    size <- filmstrip_size(x$stills)
    grDevices::pdf(shown, width = size[[1L]], height = size[[2L]])
    tryCatch(print(filmstrip(x$stills)), finally = grDevices::dev.off())
  } else {
    x <- redrawn_if_gone(x)
    shown <- path(paste0(".", tools::file_ext(x$file)))
    file.copy(x$file, shown, overwrite = TRUE)
    if (is_mp4(x$file)) {
      return(knitr::asis_output(paste0(
        "<video controls loop muted width=\"", x$size[[1L]], "\" src=\"", shown, "\"></video>"
      )))
    }
  }
  knitr::knit_print(knitr::include_graphics(shown), options, ...)
}
