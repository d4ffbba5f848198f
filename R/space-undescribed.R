# Spaces of which a server with the classic protocol sends only the name.

# Makes a space from the classic protocol's description, which is complete for these two kinds.
new_classic_space <- function(description) {
  if (isTRUE(description$name %in% c("Discrete", "Box"))) {
    return(new_space(description))
  }
  structure(list(name = description$name), class = c("gym_space_undescribed", "gym_space"))
}

#' @exportS3Method
space_label.gym_space_undescribed <- function(space) paste(space$name, "(not described)")

#' @exportS3Method
decode_value.gym_space_undescribed <- function(space, json) info_from_json(json)

#' @exportS3Method
check_value.gym_space_undescribed <- function(space, value, path, call, bounds = FALSE) {
  if (bounds) {
    abort_undescribed(space, call)
  }
}

#' @exportS3Method
write_value.gym_space_undescribed <- function(space, value) to_json(value)

#' @exportS3Method
space_sample.gym_space_undescribed <- function(space) abort_undescribed(space)

abort_undescribed <- function(space, call = rlang::caller_env()) {
  gym_abort(
    paste0("The server gives only the name of this space, ", space$name, "."),
    class = "gym_error_argument", argument = "space", value = space, call = call
  )
}
