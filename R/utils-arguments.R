# Checks of arguments. A check that fails raises `gym_error_argument`, which names the argument and
# its value.

# R's own error for a missing argument would name a function that the user has not called.
check_given <- function(x, hint = NULL, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (missing(x)) {
    abort_wrong(arg, NULL, call, "`{arg}` is missing.", i = hint)
  }
}

check_count <- function(x, min = 1, max = .Machine$integer.max, allow_null = FALSE,
                        arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  check_number(x, min, max, allow_null, arg, call, whole = TRUE)
}

check_number <- function(x, min = -Inf, max = Inf, allow_null = FALSE, arg = rlang::caller_arg(x),
                         call = rlang::caller_env(), whole = FALSE) {
  fits <- is_number(x) && (!whole || x == trunc(x)) && x >= min && x <= max
  if (!fits && !(allow_null && is.null(x))) {
    must <- paste0(if (whole) "a whole number" else "a number", range_text(min, max))
    abort_argument(x, paste0(must, if (allow_null) " or NULL"), arg, call)
  }
  invisible(x)
}

check_above_zero <- function(x, max = .Machine$double.xmax, arg = rlang::caller_arg(x),
                             call = rlang::caller_env()) {
  if (!is_number(x) || x <= 0 || x > max) {
    abort_argument(x, paste0("a number above 0", if (is.infinite(max)) ", or Inf"), arg, call)
  }
  invisible(x)
}

# Up to here doubles represent every whole number.
largest_seed <- 2^53

# All seeds follow this rule: those that set.seed() takes, and larger ones, as in Gymnasium. Seeds
# of environments are at least 0.
check_seed <- function(x, min = -.Machine$integer.max, arg = rlang::caller_arg(x),
                       call = rlang::caller_env()) {
  # Mention the largest seed only if `x` exceeds it.
  max <- if (is_number(x) && x > largest_seed) largest_seed else Inf
  check_count(x, min, max, allow_null = TRUE, arg = arg, call = call)
}

check_seeds <- function(seeds, call = rlang::caller_env()) {
  if (!is.numeric(seeds) || is_integer64(seeds) || !length(seeds)) {
    abort_argument(seeds, "one or more whole numbers", "seeds", call)
  }
  for (i in seq_along(seeds)) check_seed(seeds[[i]], arg = paste0("seeds[", i, "]"), call = call)
  if (anyDuplicated(seeds)) {
    twice <- seeds[[anyDuplicated(seeds)]]
    abort_wrong("seeds", seeds, call,
                "`seeds` must be different, but {twice} occurs more than once.",
                i = "`unique(seeds)` has each of them once.")
  }
}

check_flag <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!rlang::is_bool(x)) {
    abort_argument(x, "TRUE or FALSE", arg, call)
  }
  invisible(x)
}

check_string <- function(x, allow_null = FALSE,
                         arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  fits <- rlang::is_string(x) && !is.na(x) && nzchar(x)
  if (!fits && !(allow_null && is.null(x))) {
    abort_argument(x, paste0("a string", if (allow_null) " or NULL"), arg, call)
  }
  invisible(x)
}

check_choice <- function(x, choices, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!rlang::is_string(x) || !x %in% choices) {
    abort_argument(x, paste("one of", paste0('"', choices, '"', collapse = ", ")), arg, call)
  }
  invisible(x)
}

check_named_list <- function(x, arg = rlang::caller_arg(x), call = rlang::caller_env()) {
  if (!is.list(x) || (length(x) && !rlang::is_named(x))) {
    abort_argument(x, "a list with names", arg, call)
  }
  check_unique_names(x, arg, call)
}

# Of several elements with one name, JSON would silently keep only the last.
check_unique_names <- function(x, arg, call) {
  twice <- anyDuplicated(names(x))
  if (twice) {
    abort_wrong(NULL, NULL, call, "`{arg}` has `{names(x)[[twice]]}` more than once.")
  }
}

check_dots_named <- function(dots, example, call = rlang::caller_env()) {
  if (length(dots) && !rlang::is_named(dots)) {
    abort_wrong(NULL, NULL, call, "Further arguments need names, such as `{example}`.")
  }
  check_unique_names(dots, "...", call)
}

#' Match the names of a call's arguments only whole
#'
#' R completes the names of arguments before `...`: `learn_ppo("Pendulum-v1", g = 5)` would set
#' `gamma`. A function whose `...` may have arguments of an environment calls this first. If R has
#' completed a name, the function is called again in a way that prevents this, and returns that
#' result.
#' @param frame The frame of the function.
#' @noRd
match_whole_names <- function(frame = parent.frame()) {
  at <- Position(function(one) identical(one, frame), sys.frames(), right = TRUE)
  f <- sys.function(at)
  call <- sys.call(at)
  from <- sys.frame(sys.parents()[[at]])
  dots <- which(vapply(as.list(call), identical, NA, quote(...)))
  if (length(dots)) {
    names <- rlang::names2(eval(quote(substitute(list(...))), from))[-1L]
    passed <- lapply(paste0("..", seq_along(names), recycle0 = TRUE), as.name)
    call <- as.call(append(as.list(call)[-dots], stats::setNames(passed, names), dots - 1L))
  }
  known <- names(formals(f))
  before <- known[seq_len(match("...", known) - 1L)]
  given <- rlang::names2(call)
  open <- setdiff(before, given)
  completed <- nzchar(given) & !given %in% known &
    vapply(given, function(name) any(startsWith(open, name)), NA)
  if (any(completed)) {
    whole <- as.list(match.call(f, call[!completed]))
    # Arguments that are passed without a value keep their defaults, and R matches no other name to
    # them.
    whole[setdiff(before, names(whole))] <- list(rlang::missing_arg())
    again <- as.call(c(whole, as.list(call)[completed]))
    rlang::eval_bare(bquote(return(eval(quote(.(again)), .(from)))), frame)
  }
}

# For functions that have `...` only because their generic has it.
check_dots_empty <- function(..., call = rlang::caller_env()) {
  if (...length()) {
    given <- names(list(...))[[1L]] %||% ""
    name <- if (nzchar(given)) paste0("`", given, "`") else describe_argument(..1)
    abort_wrong("...", list(...), call, "There is no argument for {name} here.")
  }
}

#' Check that a suggested package is installed
#' @noRd
check_suggested <- function(package, purpose, call = rlang::caller_env()) {
  if (!requireNamespace(package, quietly = TRUE)) {
    abort_wrong(NULL, NULL, call, "The package {package} is required to {purpose}.",
                i = "`install.packages(\"{package}\")` installs it.")
  }
}

check_columns <- function(x, needed, arg, call) {
  absent <- setdiff(needed, names(x))
  if (length(absent)) {
    abort_wrong(arg, x, call, "`{arg}` has no column {quoted_names(absent)}.",
                i = if (length(absent) == 1L) did_you_mean(absent, names(x)),
                i = if (length(x)) paste0("Its columns are ", few_names(names(x)), "."))
  }
}

check_column <- function(x, name, must, are_good, arg, call) {
  good <- are_good(x[[name]])
  if (!all(good)) {
    row <- which(!good)[[1L]]
    abort_wrong(arg, x, call,
                "The column `{name}` of `{arg}` must have {must}, and in row {row} it has
                 {describe_value(x[[name]][[row]])}.")
  }
}

# Each of these returns a flag for each value, or a single FALSE for values of another type.
are_finite <- function(x) if (is.numeric(x)) is.finite(x) else FALSE
are_whole_numbers <- function(x) {
  if (is.numeric(x)) is.finite(x) & x == trunc(x) & abs(x) <= .Machine$integer.max else FALSE
}
are_probabilities <- function(x) if (is.numeric(x)) !is.na(x) & x >= 0 & x <= 1 else FALSE
are_flags <- function(x) if (is.logical(x)) !is.na(x) else FALSE

abort_argument <- function(x, must, arg, call, hint = NULL) {
  abort_wrong(arg, x, call, "`{arg}` must be {must}, not {describe_argument(x)}.",
              i = integer64_hint(x), i = hint)
}

is_number <- function(x) {
  is.numeric(x) && !is_integer64(x) && length(x) == 1L && is.null(dim(x)) && !is.na(x)
}

range_text <- function(min, max) {
  # R's largest integer is a limit of the type; do not mention it.
  bounded <- max != .Machine$integer.max && max < Inf
  above <- min > -.Machine$integer.max
  paste0(
    if (above) paste(if (bounded) " from" else " of at least", format(min)),
    if (bounded) paste(if (above) " to" else " of at most", format(max, scientific = FALSE))
  )
}

describe_argument <- function(x) {
  plain <- if (is.factor(x)) as.character(x) else x
  is_short <- is.null(x) || is.atomic(x) && length(x) <= 5L && is.null(attributes(plain))
  if (is_short) {
    describe_value(x)
  } else if (is.array(x)) {
    paste0("an array of ", paste(dim(x), collapse = " x "))
  } else if (is.function(x)) {
    "a function"
  } else if (is.data.frame(x)) {
    paste("a data frame with", count_of(nrow(x), "row"))
  } else if (is.object(x)) {
    paste("an object of class", class(x)[[1L]])
  } else {
    kind <- if (is.list(x)) "list" else paste(typeof(x), "vector")
    paste0(if (is.integer(x)) "an " else "a ", kind, " of length ", length(x))
  }
}
