# Checks the spelling of the help pages, the vignettes and what GitHub shows, in British English.
# Other words belong in inst/WORDLIST. Code between backticks is not read.
language <- "en-GB"
known <- spelling::get_wordlist(".")
# make bench writes these tables.
is_text <- function(found) any(!grepl("^bench", found))
unknown <- rbind(
  spelling::spell_check_package("."),
  spelling::spell_check_files(c("SECURITY.md", "CONTRIBUTING.md"), known, language)
)
unknown <- unknown[vapply(unknown$found, is_text, NA), ]
if (nrow(unknown) > 0) print(unknown) else cat("spelling: clean\n")
quit(status = if (nrow(unknown) > 0) 1 else 0)
