# Numbers in texts for programs.

#' Run code that writes or reads numbers in texts that other programs write or read
#'
#' They have a decimal point, whatever `options(OutDec = )` and the locale of numbers say: these are
#' for people, but `as.character()`, `sprintf()`, `write.table()` and jsonlite heed them, too.
#' @noRd
with_decimal_point <- function(code) {
  locale <- Sys.getlocale("LC_NUMERIC")
  if (locale != "C") {
    Sys.setlocale("LC_NUMERIC", "C")
    # R warns of any other locale, whoever sets it.
    on.exit(suppressWarnings(Sys.setlocale("LC_NUMERIC", locale)))
  }
  if (getOption("OutDec") != ".") {
    old <- options(OutDec = ".")
    on.exit(options(old), add = TRUE)
  }
  code
}
