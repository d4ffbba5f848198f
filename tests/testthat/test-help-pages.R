# The source tree has man/ and _pkgdown.yml beside tests/.
source_tree <- function(...) {
  path <- file.path(test_path(), "../..", ...)
  skip_if_not(file.exists(path), "not a source tree")
  path
}

help_pages <- function() {
  pages <- lapply(list.files(source_tree("man"), "[.]Rd$", full.names = TRUE), tools::parse_Rd)
  Filter(function(page) !"internal" %in% rd_texts(page, "\\keyword"), pages)
}

rd_texts <- function(page, tag) {
  found <- Filter(function(part) identical(attr(part, "Rd_tag"), tag), page)
  trimws(vapply(found, function(part) paste(unlist(part), collapse = ""), ""))
}

test_that("every help page has an example that runs", {
  skip_unless_all()
  for (page in help_pages()) {
    name <- rd_texts(page, "\\name")
    examples <- rd_texts(page, "\\examples")
    expect_length(examples, 1L)
    expect_true(any(nzchar(examples)), info = name)
  }
})

# parse_Rd() gives what is in such a part without its name.
test_that("no example is kept from running", {
  for (file in list.files(source_tree("man"), "[.]Rd$", full.names = TRUE)) {
    kept <- grep("\\\\(dontrun|donttest)", readLines(file), value = TRUE)
    expect_identical(kept, character(), info = basename(file))
  }
})

test_that("the reference on the web names every help page", {
  skip_unless_all()
  lines <- readLines(source_tree("_pkgdown.yml"))
  reference <- lines[-seq_len(match("reference:", lines))]
  entries <- sub("^  - ", "", grep("^  - ", reference, value = TRUE))
  starts <- sub("starts_with\\(\"(.*)\"\\)", "\\1", grep("^starts_with", entries, value = TRUE))
  topics <- setdiff(entries, grep("^starts_with", entries, value = TRUE))
  for (page in help_pages()) {
    aliases <- rd_texts(page, "\\alias")
    ways <- sum(aliases %in% topics) +
      sum(vapply(starts, function(start) any(startsWith(aliases, start)), NA))
    expect_true(ways > 0L, info = rd_texts(page, "\\name"))
  }
  known <- unlist(lapply(help_pages(), rd_texts, "\\alias"))
  expect_identical(setdiff(topics, known), character())
})

test_that("the site's menu names every article", {
  lines <- readLines(source_tree("_pkgdown.yml"))
  entries <- sub("^  - ", "", grep("^  - ", lines, value = TRUE))
  starts <- sub("starts_with\\(\"(.*)\"\\)", "\\1", grep("^starts_with", entries, value = TRUE))
  articles <- list.files(source_tree("vignettes"), "[.]Rmd$", recursive = TRUE)
  expect_gt(length(articles), 15L)
  for (article in sub("[.]Rmd$", "", articles)) {
    expect_true(article %in% entries || any(startsWith(article, starts)), info = article)
  }
})

test_that("texts name the tutorial, and do not take it for known as a post", {
  skip_unless_all()
  texts <- c(list.files(source_tree("man"), "[.]Rd$", full.names = TRUE),
             list.files(source_tree("vignettes"), "[.](Rmd|md|csv)$", full.names = TRUE),
             source_tree("README.md"))
  for (file in texts) {
    text <- paste(readLines(file), collapse = " ")
    expect_false(grepl("\\b[Tt]he post\\b", text), info = basename(file))
    if (grepl("[Tt]he tutorial('s)?\\b", text) && grepl("[.]Rd$", file)) {
      expect_match(text, "Artificial Intelligence in R (I)", fixed = TRUE, info = basename(file))
    }
  }
})

test_that("the cheat sheet's functions are there", {
  sheet <- paste(readLines(source_tree("tools/cheatsheet/cheatsheet.html")), collapse = "\n")
  every <- function(pattern, text) regmatches(text, gregexpr(pattern, text, perl = TRUE))[[1L]]
  code <- gsub("<[^>]*>", "", every("(?s)<pre>.*?</pre>", sheet))
  called <- unique(unlist(lapply(code, every, pattern = "(?<![$:[:alnum:]_.])[A-Za-z_]+(?=\\()")))
  base <- c("function", "list", "c", "abs", "library", "plot", "summary", "coef")
  expect_gt(length(called), 30L)
  expect_identical(setdiff(called, c(getNamespaceExports("gym"), base)), character())
})
