# Vector environments: their spaces, their infos, and checks of seeds, masks and numbers of
# sub-environments.

vectorization_modes <- c("vector_entry_point", "sync", "async")
autoreset_modes <- c("NextStep", "SameStep", "Disabled")

# The space of the values sent and received. For a vector environment, it is the space of a batch.
sent_space <- function(space, num_envs) {
  if (is.null(num_envs)) space else batch_space(space, num_envs)
}

# Whether values are sent as tensors. A vector environment sends tensors if there is at least one
# number, which a safetensors file needs; a single environment only if they are faster.
travels_as_tensors <- function(space, num_envs) {
  isTRUE(count_numbers(space) >= if (is.null(num_envs)) tensors_pay_from else 1)
}

# Steps ---------------------------------------------------------------------------------

# Reads the actions that the server drew: one, or one for each sub-environment.
decode_sample <- function(instance, json) {
  single <- instance$single_action_space
  if (is.null(instance$num_envs)) {
    decode_value(single, json)
  } else {
    check_list(json, instance$num_envs, "all sub-environments")
    batch_of(single, lapply(json, decode_value, space = single))
  }
}

# Checks --------------------------------------------------------------------------------

check_sub_env_seeds <- function(seed, num_envs, call) {
  right <- is.numeric(seed) && are_whole(seed[!is.na(seed) | is.nan(seed)], 0, largest_seed)
  if (!right || length(seed) != num_envs) {
    must <- paste0(
      "a whole number of at least 0, or ", num_envs,
      " of them, one for each sub-environment (NA for none)"
    )
    abort_argument(seed, must, "seed", call)
  }
}

# The mask as JSON. The last one is kept, because rollouts often send the same mask again.
mask_json <- function(mask, instance, call) {
  if (is.null(mask)) {
    return(NULL)
  }
  if (!identical(mask, instance$last_mask$mask)) {
    check_mask(mask, instance, call)
    instance$last_mask <- list(mask = mask, json = to_json(I(mask)))
  }
  instance$last_mask$json
}

check_mask <- function(mask, instance, call) {
  check_is_vector_env(instance, mask, "mask", call)
  n <- instance$num_envs
  if (!is.logical(mask) || length(mask) != n || anyNA(mask) || !any(mask)) {
    must <- paste0(
      "a logical vector of length ", n, ", one for each sub-environment, with a TRUE in it"
    )
    abort_argument(mask, must, "mask", call)
  }
}

check_which <- function(which, instance, call) {
  if (is.null(which)) {
    return(invisible())
  }
  check_is_vector_env(instance, which, "which", call)
  n <- instance$num_envs
  if (!are_whole(which, 1, n) || length(which) == 0L || is.unsorted(which, strictly = TRUE)) {
    must <- paste0("numbers of sub-environments from 1 to ", n, ", in increasing order")
    abort_argument(which, must, "which", call)
  }
}

check_is_vector_env <- function(instance, x, arg, call) {
  abort_if(
    is.null(instance$num_envs), arg, x, call,
    "`{arg}` is for an environment with sub-environments; this {instance$spec$id} has none.",
    i = "`gym_make()` makes one with `num_envs`."
  )
}

# Infos -----------------------------------------------------------------------------------

#' Convert the info of several sub-environments to R values
#'
#' For each key, Gymnasium has an array with an entry for each sub-environment. A second key, with a
#' `_` in front, has a mask that says which sub-environments have a value. In R, entries without a
#' value are `NA`, or `NULL` in a list, and there are no masks.
#' @noRd
info_by_sub_env <- function(json, n) {
  if (!length(json)) {
    return(json)
  }
  masks <- paste0("_", names(json))
  keys <- names(json)[!names(json) %in% masks]
  values <- Map(info_of_sub_envs, json[keys], json[paste0("_", keys)], n)
  stats::setNames(values, keys)
}

info_of_sub_envs <- function(json, mask, n) {
  if (!is.null(names(json))) {
    return(info_by_sub_env(json, n))
  }
  mask <- unlist(mask)
  if (length(mask) != n || length(json) != n) {
    return(info_from_json(json))
  }
  # Only the values that the mask selects determine the type: Gymnasium fills the others with zero
  # or None.
  values <- info_from_json(json[mask])
  entry <- rep(NA_integer_, n)
  entry[mask] <- seq_len(sum(mask))
  rows_of(values, entry)
}
