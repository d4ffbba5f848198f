# Text from a server, made safe for a terminal.

# Enough for an error message with a traceback.
longest_shown <- 4000L

# C0 except tab and newline, DEL, C1, and characters that change the direction of text.
unseen <- paste0(
  "(*UTF)[\\x{01}-\\x{08}\\x{0b}-\\x{1f}\\x{7f}-\\x{9f}\\x{061c}\\x{200e}\\x{200f}",
  "\\x{2028}-\\x{202e}\\x{2066}-\\x{2069}\\x{feff}]"
)

#' Remove terminal commands from a text
#'
#' These are escape sequences, control characters and marks of direction. A long text is shortened.
#' @param x A character vector; names stay.
#' @param most The largest number of characters of an element.
#' @noRd
shown_text <- function(x, most = longest_shown) {
  # Fast for plain and short texts, the usual case.
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

# The same for a text within a line.
shown_line <- function(x, most = 200L) {
  if (!is.null(x)) gsub("[\t\n]+", " ", shown_text(x, most))
}
