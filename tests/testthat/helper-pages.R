# Tests run the code of pages in vignettes/. They are in the source tree, or in an installed package
# that was built with its vignettes.

page_files <- function(pattern) {
  folders <- c(file.path(test_path(), "../../vignettes"), system.file("doc", package = "gym"))
  files <- lapply(folders, list.files, pattern = pattern, full.names = TRUE)
  found <- files[lengths(files) > 0L]
  if (length(found)) found[[1L]] else character()
}

# Returns a vignette's R chunks, each as its header's text and its lines of code.
page_chunks <- function(file) {
  lines <- readLines(file, encoding = "UTF-8")
  fences <- grep("^```", lines)
  starts <- fences[c(TRUE, FALSE)]
  ends <- fences[c(FALSE, TRUE)]
  stopifnot(length(starts) == length(ends), lines[ends] == "```")
  chunks <- Map(function(start, end) {
    list(header = lines[[start]], code = lines[seq_len(end - start - 1L) + start])
  }, starts, ends)
  chunks[grepl("^```[{]r", lines[starts])]
}
