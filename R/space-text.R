# Text: a string of certain characters.

#' @exportS3Method
init_space.gym_space_text <- function(space) space

#' @exportS3Method
space_label.gym_space_text <- function(space) {
  paste0("Text of ", space$min_length, " to ", count_of(space$max_length, "character"))
}

#' @exportS3Method
decode_value.gym_space_text <- function(space, json) check_text(json)

#' @exportS3Method
check_value.gym_space_text <- function(space, value, path, call, bounds = FALSE) {
  if (!rlang::is_string(value) || is.na(value)) {
    abort_space(space, value, "A value of Text is one string", call, path)
  }
  if (bounds) {
    characters <- strsplit(enc2utf8(value), "")[[1L]]
    known <- strsplit(space$characters, "")[[1L]]
    n <- length(characters)
    if (n < space$min_length || n > space$max_length) {
      abort_space(space, value, paste("The text has", count_of(n, "character")), call, path)
    }
    strange <- setdiff(characters, known)
    if (length(strange)) {
      problem <- paste("The text has characters that the space does not allow:", toString(strange))
      abort_space(space, value, problem, call, path)
    }
  }
}

#' @exportS3Method
write_value.gym_space_text <- function(space, value) json_string(value)

#' @exportS3Method
space_sample.gym_space_text <- function(space) {
  known <- strsplit(space$characters, "")[[1L]]
  lengths <- space$max_length - space$min_length + 1L
  n <- space$min_length + sample.int(lengths, 1L) - 1L
  paste(known[sample.int(length(known), n, replace = TRUE)], collapse = "")
}
