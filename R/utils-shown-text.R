# Text from a server, made safe for a terminal.

# Enough for an error message with a traceback.
longest_shown <- 4000L

# C0 except tab and newline, DEL, C1, and characters that change the direction of text.
unseen <- paste0(
  "(*UTF)[\\x{01}-\\x{08}\\x{0b}-\\x{1f}\\x{7f}-\\x{9f}\\x{061c}\\x{200e}\\x{200f}",
  "\\x{2028}-\\x{202e}\\x{2066}-\\x{2069}\\x{feff}]"
)

#' Remove from a text what a terminal would obey
#'
#' These are escape sequences, control characters and marks of direction. A long text is cut.
#' @param x A character vector; names stay.
#' @param most How many characters of each element.
#' @noRd
shown_text <- function(x, most = longest_shown) {
  # Quick for plain and short texts, as most are.
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

# The same for a text that is shown within a line.
shown_line <- function(x, most = 200L) {
  if (!is.null(x)) gsub("[\t\n]+", " ", shown_text(x, most))
}
