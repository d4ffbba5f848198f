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

# Tokens ----------------------------------------------------------------------------------

# Remembers a token that errors must not show: an error keeps the call as the script wrote it,
# perhaps with the token.
hide_token <- function(token) {
  if (is.character(token)) {
    the_session$hidden <- unique(c(the_session$hidden, token[nzchar(token)]))
  }
}

#' Remove tokens from the parts of an error
#' @param x A call, or a part of one.
#' @return `x` with `"<token>"` instead of each text that is or contains a token.
#' @noRd
without_tokens <- function(x) {
  if (!length(the_session$hidden)) {
    x
  } else if (is.character(x)) {
    x[is_token_text(x)] <- "<token>"
    x
  } else if (is.call(x) || is.pairlist(x)) {
    # An argument may be missing, as in x[1, ].
    for (i in which(!vapply(x, function(part) is.null(part) || rlang::is_missing(part), NA))) {
      x[[i]] <- without_tokens(x[[i]])
    }
    x
  } else {
    x
  }
}

is_token_text <- function(texts) {
  found <- texts %in% the_session$hidden
  # A short token may be a part of any text by chance.
  for (token in Filter(function(token) nchar(token) >= 8L, the_session$hidden)) {
    found <- found | grepl(token, texts, fixed = TRUE)
  }
  found
}

# The calls that led to an error, without tokens. NULL if no token is known: rlang then makes the
# trace itself.
hidden_trace <- function(frame) {
  if (length(the_session$hidden)) {
    trace <- rlang::trace_back(bottom = frame)
    trace$call <- lapply(trace$call, without_tokens)
    trace
  }
}
