# Converts policies that Stable-Baselines3 trained to networks of this package.

#' Make a policy from the files of a job of Stable-Baselines3
#' @param folder The job's folder.
#' @return A [policy_network()], or a policy of class `gym_policy_sb3`, that is not bound yet.
#' @noRd
sb3_policy <- function(folder) {
  bytes <- read_bytes(file.path(folder, "policy.safetensors"))
  read <- read_tensors(bytes)
  about <- from_json(read$metadata$about)
  if (!is.null(about$algorithm)) {
    return(new_sb3_policy(bytes, about))
  }
  layers <- read$tensors[grep("^layer ", names(read$tensors))]
  weights <- unname(layers[order(as.integer(sub("layer ", "", names(layers))))])
  policy <- policy_network(
    c(ncol(weights[[1L]]) - 1L, vapply(weights, nrow, 0L)), unlist(about$activation), weights,
    bias = TRUE, output = about$output, log_std = read$tensors$log_std %||% 0,
    clip_obs = about$clip_obs %||% 10
  )
  if (!is.null(about$count)) {
    # Stable-Baselines3 divides by the root of the variance plus a small number. This package
    # divides by the root of the sum of squares over (count - 1), so give it the fitting sum.
    count <- max(about$count, 2)
    variance <- read$tensors$variance
    policy$moments <- new_moments(count, read$tensors$mean, variance * (count - 1))
  }
  policy
}

#' @rdname as_policy
#' @param activation For a zip file of Stable-Baselines3: PyTorch's name of the activation of the
#'   hidden layers, such as `"ReLU"`. `NULL`, the default, is the one that the file names in plain
#'   text, or the algorithm's default.
#' @param moments For such a file: how the observations were normalised in training (by
#'   `VecNormalize`), a list of the numeric vectors `mean` and `variance`, and optionally of the
#'   numbers `clip_obs` (10 by default) and `epsilon` (1e-8). `FALSE` if they were not normalised.
#'   `NULL`, the default, means the same, but raises an error if there is a file `vecnormalize.pkl`
#'   beside the zip file.
#' @export
as_policy.character <- function(x, ..., activation = NULL, moments = NULL) {
  check_dots_empty(...)
  call <- rlang::current_env()
  check_string(x)
  check_string(activation, allow_null = TRUE)
  if (!file.exists(x)) abort_argument(x, "a file that exists", "x", call)
  check_no_pickle(x, call)
  check_moments(moments, x, call)
  folder <- temporary_file("gym-sb3-")
  dir.create(folder)
  on.exit(unlink(folder, recursive = TRUE))
  moments <- if (is.list(moments)) {
    c(lapply(moments[c("mean", "variance")], as.list), moments[c("clip_obs", "epsilon")])
  }
  job <- list(
    task = "convert", file = absolute_path(x), activation = activation,
    moments = Filter(Negate(is.null), moments)
  )
  if (!length(job$moments)) job["moments"] <- list(NULL)
  result <- run_sb3_job(job, folder, sb3_python(call), call)
  if (!is.null(result$error)) rlang::cnd_signal(sb3_error(result$error, call))
  sb3_policy(folder)
}

check_no_pickle <- function(x, call) {
  abort_if(
    grepl("[.](pkl|pickle|pt|pth)$", tolower(x)),
    "x", x, call, '"{basename(x)}" is a pickle, and is not loaded.',
    x = "A pickle from elsewhere can run any program with your rights: read your files, delete them,
         send them away.",
    i = "`as_policy()` reads the zip file that `model.save()` makes, by its weights alone."
  )
}

check_moments <- function(moments, x, call) {
  if (is.null(moments)) {
    name <- sub("[.]zip$", "", basename(x))
    beside <- file.path(dirname(x), c("vecnormalize.pkl", file.path(name, "vecnormalize.pkl")))
    abort_if(
      any(file.exists(beside)), "moments", NULL, call,
      "This policy's observations were normalised: there is
       {beside[file.exists(beside)][[1L]]}.",
      i = "That file is a pickle, which can run any program, and is not loaded. Give `moments =
           list(mean = , variance = )`: in Python they are `obs_rms.mean` and `obs_rms.var` of the
           VecNormalize.",
      i = "`moments = FALSE` takes the policy without."
    )
    return()
  }
  if (isFALSE(moments)) {
    return()
  }
  numbers <- is.list(moments) && length(moments$mean) == length(moments$variance) &&
    is.numeric(moments$mean) && is.numeric(moments$variance)
  if (!numbers || !all(names(moments) %in% c("mean", "variance", "clip_obs", "epsilon"))) {
    abort_argument(moments, "a list of `mean` and `variance`, or FALSE", "moments", call)
  }
}
