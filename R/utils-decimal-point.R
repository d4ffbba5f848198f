# Numbers in texts that programs read.

#' Run code that writes or reads numbers in texts for programs
#'
#' Such texts need a decimal point. `options(OutDec = )` and the locale's number format are for
#' people, but `as.character()`, `sprintf()`, `write.table()` and jsonlite use them, too.
#' @noRd
with_decimal_point <- function(code) {
  locale <- Sys.getlocale("LC_NUMERIC")
  if (locale != "C") {
    Sys.setlocale("LC_NUMERIC", "C")
    # R warns about any other locale.
    on.exit(suppressWarnings(Sys.setlocale("LC_NUMERIC", locale)))
  }
  if (getOption("OutDec") != ".") {
    old <- options(OutDec = ".")
    on.exit(options(old), add = TRUE)
  }
  code
}
