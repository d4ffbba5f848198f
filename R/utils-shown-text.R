# Text from elsewhere, as it may stand in a terminal.

# Long enough for an error with what led to it.
longest_shown <- 4000L

# C0 but for tab and newline, DEL, C1, and what turns the direction of the text around it.
unseen <- paste0(
  "(*UTF)[\\x{01}-\\x{08}\\x{0b}-\\x{1f}\\x{7f}-\\x{9f}\\x{061c}\\x{200e}\\x{200f}",
  "\\x{2028}-\\x{202e}\\x{2066}-\\x{2069}\\x{feff}]"
)

#' Take out of a text what a terminal would obey
#'
#' Escape sequences, control characters, marks of direction; what is too long is cut.
#' @param x A character vector; names stay.
#' @param most How many characters of each element.
#' @noRd
shown_text <- function(x, most = longest_shown) {
  # Most texts are plain, and short.
  if (!length(x) || all(grepl("^[ -~]*$", x, useBytes = TRUE) & nchar(x, "bytes") <= most)) {
    return(x)
  }
  text <- iconv(enc2utf8(as.character(x)), "UTF-8", "UTF-8", sub = "byte")
  text <- gsub(unseen, "", cli::ansi_strip(text), perl = TRUE)
  long <- nchar(text) > most
  text[long] <- paste0(substr(text[long], 1L, most), "...")
  x[] <- text
  x
}

# Where it stands within a line.
shown_line <- function(x, most = 200L) {
  if (!is.null(x)) gsub("[\t\n]+", " ", shown_text(x, most))
}
