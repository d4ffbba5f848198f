# Texts that errors must not show, such as tokens.

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
