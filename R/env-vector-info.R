# The info of a vector environment.

#' Convert the info of several sub-environments to R values
#'
#' For each key, Gymnasium has an array with an entry for each sub-environment, and under the key
#' with a `_` before it a mask of those that have a value. Here the other entries are `NA`, or
#' `NULL` in a list, and there are no masks.
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
  # Only the values selected by the mask determine the type: the others are zero or nothing.
  values <- info_from_json(json[mask])
  entry <- rep(NA_integer_, n)
  entry[mask] <- seq_len(sum(mask))
  rows_of(values, entry)
}
