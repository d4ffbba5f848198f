# Numbers and names as text, for messages and printing.

environment_label <- function(env) env$spec$id %||% "the environment"

count_of <- function(n, noun) paste0(whole_number_text(n), " ", noun, if (n != 1) "s")

# Writes numbers without an exponent as long as a reader can count the digits: 100,000, not 1e+05.
number_text <- function(x, ...) marked_text(x, digits = 4L, scientific = 3L, ...)

whole_number_text <- function(n) marked_text(n, scientific = FALSE)

# Separates thousands by a comma. If options(OutDec = ) or the locale makes the comma the decimal
# mark, by a full stop.
marked_text <- function(x, ...) {
  if (grepl(",", format(0.5, scientific = FALSE), fixed = TRUE)) {
    format(x, ..., big.mark = ".", decimal.mark = ",")
  } else {
    format(x, ..., big.mark = ",")
  }
}

# Formats each number by itself: together all would get as many decimals as the longest one needs.
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

# The time that a result took, for its print(), unless the user leaves times out.
elapsed_text <- function(seconds, before = " in ") {
  if (prints_times()) paste0(before, seconds_text(seconds))
}

prints_times <- function() !isFALSE(getOption("gym.print_seconds"))

# A name without the characters that people confuse.
plain_name <- function(x) gsub("[._]", "", tolower(x))

# The names of arguments in Stable-Baselines3, RLlib and textbooks (in plain form), with our names.
other_names <- list(
  alpha = "learning_rate", lr = "learning_rate", eta = "learning_rate", stepsize = "learning_rate",
  gamma = "discount", discountfactor = "discount", discount = "gamma", discountrate = "discount",
  gaelambda = "lambda", eps = "epsilon", explorationrate = "epsilon",
  nsteps = c("batch_steps", "n"), rolloutsteps = "batch_steps", trainbatchsize = "batch_steps",
  batchsize = "batch", minibatchsize = "batch", nepochs = "epochs", numepochs = "epochs",
  cliprange = "clip", clipparam = "clip", entcoef = "entropy", entropycoeff = "entropy",
  vfcoef = "value_weight", buffersize = "memory", memorysize = "memory", tau = "target_rate",
  targetupdateinterval = "target_every", totaltimesteps = "total_steps", timesteps = "total_steps",
  nenvs = "num_envs", ncpus = "num_workers", ncores = "num_workers",
  n = c("episodes", "iterations"), times = "episodes", nepisodes = "episodes",
  numepisodes = "episodes", nevalepisodes = "eval_episodes", evalfreq = "eval_every",
  popsize = "population", sigma = "noise"
)

# Finds the choice that the user probably meant by `name`: a misspelling, or another library's name.
# Returns character(0) if there is none.
nearest_name <- function(name, choices) {
  ours <- intersect(other_names[[plain_name(name)]], choices)
  if (length(ours)) {
    return(ours[[1L]])
  }
  ordered <- function(x) {
    vapply(strsplit(x, ""), function(letters) paste(sort(letters), collapse = ""), "")
  }
  distance <- function(form) utils::adist(form(plain_name(name)), form(plain_name(choices)))[1L, ]
  # `max_steps` is `max_episode_steps` with a word left out.
  words <- function(x) strsplit(tolower(x), "[._]")
  wanted <- words(name)[[1L]]
  within <- length(wanted) > 1L & vapply(words(choices), function(of) all(wanted %in% of), NA)
  begins <- nchar(name) > 3L & startsWith(plain_name(choices), plain_name(name))
  close <- distance(identity) <= min(2, ceiling(nchar(name) / 3)) | begins | within
  # If several names are equally similar, prefer the one with the same letters.
  best <- order(distance(identity), distance(ordered))
  utils::head(choices[best[close[best]]], 1L)
}

did_you_mean <- function(name, choices, form = "`%s`") {
  near <- if (length(choices)) nearest_name(name, choices)
  if (length(near)) paste0("Did you mean ", sprintf(form, near), "?")
}

quoted_names <- function(names) paste0("`", names, "`", collapse = ", ")

# Lists the names. If there are many, only the first ones and the last.
few_names <- function(names) {
  n <- length(names)
  paste0(quoted_names(utils::head(names, if (n > 12L) 10L else n)),
         if (n > 12L) paste0(", ..., `", names[[n]], "`"))
}

# Prints an object by what format() returns.
print_line <- function(x) print_lines(x, format(x))

print_lines <- function(x, lines) {
  writeLines(lines)
  invisible(x)
}

# Text from a server, made safe for a terminal ---------------------------------------------

# This is enough for an error message with a traceback.
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
  # Return early for short, plain texts, the usual case.
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

# Like shown_text(), but for a text within a line.
shown_line <- function(x, most = 200L) {
  if (!is.null(x)) gsub("[\t\n]+", " ", shown_text(x, most))
}

# Tokens ----------------------------------------------------------------------------------

# Remembers a token that errors must not show. An error shows the call as the script wrote it,
# perhaps with the token.
hide_token <- function(token) {
  if (is.character(token)) the_session$hidden <- unique(c(the_session$hidden, token[nzchar(token)]))
}

#' Remove tokens from the parts of an error
#' @param x A call, or a part of one.
#' @return `x` with `"<token>"` instead of each text that is or contains a token.
#' @noRd
without_tokens <- function(x) {
  if (!length(the_session$hidden)) {
    x
  } else if (is.character(x)) {
    found <- x %in% the_session$hidden
    # A short token may be part of a text by chance, so only long ones are searched for.
    for (token in Filter(function(token) nchar(token) >= 8L, the_session$hidden)) {
      found <- found | grepl(token, x, fixed = TRUE)
    }
    replace(x, found, "<token>")
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
