# Lints every R file of the repository by .lintr; fails when there is something to fix.
folders <- Filter(dir.exists, c("R", "tests", "inst/examples", "tools", "vignettes"))
count <- 0
for (folder in folders) {
  lints <- lintr::lint_dir(folder, relative_path = FALSE)
  if (length(lints) > 0) print(lints)
  count <- count + length(lints)
}
cat(sprintf("lintr: %d found\n", count))
quit(status = if (count > 0) 1 else 0)
