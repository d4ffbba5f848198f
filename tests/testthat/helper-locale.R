#' Set a locale for the rest of a test
#'
#' If the machine does not have the locale, it is made. If that fails, the test is skipped.
#' @param language Such as "de_DE".
#' @param charset The charset with which it is made, in much less time than with UTF-8.
#' @return The name of the locale, for `Sys.setlocale()` in another session.
#' @noRd
local_locale <- function(category, language, charset, frame = parent.frame()) {
  before <- Sys.getlocale(category)
  withr::defer(suppressWarnings(Sys.setlocale(category, before)), envir = frame)
  set <- function(name) suppressWarnings(Sys.setlocale(category, name))
  found <- set(paste0(language, ".UTF-8"))
  if (!nzchar(found)) {
    skip_if(!nzchar(Sys.which("localedef")), paste("there is no locale", language, "here"))
    folder <- withr::local_tempdir(.local_envir = frame)
    name <- paste0(language, ".", charset)
    processx::run("localedef", c("-c", "-i", language, "-f", charset, file.path(folder, name)),
                  error_on_status = FALSE)
    withr::local_envvar(LOCPATH = folder, .local_envir = frame)
    found <- set(name)
    skip_if(!nzchar(found), paste("no locale", language, "could be made here"))
  }
  found
}
