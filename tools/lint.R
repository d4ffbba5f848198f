# Lints every R file of the repository by .lintr. Fails if there is something to fix.
folders <- Filter(dir.exists, c("R", "tests", "inst/examples", "tools", "vignettes"))
files <- list.files(folders, "[.](R|Rmd)$", recursive = TRUE, full.names = TRUE)
# lintr finds its settings from the file. If a process fails on a file, that is an error.
found <- parallel::mclapply(files, lintr::lint, mc.cores = 2, mc.preschedule = FALSE)
broken <- vapply(found, inherits, NA, "try-error")
if (any(broken)) stop("lintr failed on ", toString(files[broken]))
for (lints in Filter(length, found)) print(lints)
count <- sum(lengths(found))
cat(sprintf("lintr: %d found\n", count))
quit(status = if (count > 0) 1 else 0)
