# Words for messages and for what is printed.

environment_label <- function(env) env$spec$id %||% "the environment"

count_of <- function(n, noun) {
  paste0(format(n, big.mark = ",", scientific = FALSE), " ", noun, if (n != 1) "s")
}

number_text <- function(x) format(x, digits = 4L, big.mark = ",")

# One by one, as together they would get as many decimals as the longest needs.
number_text_each <- function(x) vapply(unname(x), number_text, "")

percent_text <- function(share) paste0(format(100 * share, digits = 2L), "%")

se_text <- function(se) if (!is.na(se)) paste0(" (standard error ", number_text(se), ")")

seconds_text <- function(seconds) {
  if (seconds < 120) {
    paste(format(round(seconds, 1L), nsmall = 1L), "s")
  } else {
    paste(round(seconds / 60), "min")
  }
}
