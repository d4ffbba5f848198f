# Builds the site into site/, without a network. The articles start the only server. Then checks
# that all links inside the site lead to something.
options(pkgdown.internet = FALSE)
# What CRAN knows of packages that an article names but that are not installed, such as torch.
no_packages <- function() data.frame(Package = character(), URL = character())
utils::assignInNamespace("CRAN_urls", no_packages, "downlit")
folder <- "site"

# Returns where a page's links lead: files of the site, each with a place in the file if the link
# names one.
local_links <- function(page) {
  html <- xml2::read_html(page)
  links <- c(
    xml2::xml_attr(xml2::xml_find_all(html, "//a[@href]"), "href"),
    xml2::xml_attr(xml2::xml_find_all(html, "//*[@src]"), "src")
  )
  links <- unique(grep("^([a-z]+:|//|#$|$)", links, value = TRUE, invert = TRUE))
  to <- utils::URLdecode(sub("#.*", "", links))
  data.frame(
    link = links, to = ifelse(nzchar(to), file.path(dirname(page), to), page),
    place = ifelse(grepl("#", links), sub(".*#", "", links), "")
  )
}

broken_links <- function(page) {
  links <- local_links(page)
  is_there <- function(to, place) {
    if (dir.exists(to)) to <- file.path(to, "index.html")
    file.exists(to) && (!nzchar(place) || place %in% places(to))
  }
  links$link[!mapply(is_there, links$to, links$place, USE.NAMES = FALSE)]
}

known_places <- new.env()
places <- function(page) {
  page <- normalizePath(page)
  if (is.null(known_places[[page]])) {
    known_places[[page]] <- xml2::xml_text(xml2::xml_find_all(xml2::read_html(page), "//@id"))
  }
  known_places[[page]]
}

# README.md and SECURITY.md link to the repository's files; the site has pages of them.
link_to_pages <- function(text) {
  text <- gsub('href="pkgdown/assets/', 'href="', text)
  text <- gsub('href="vignettes/(articles/)?([^"/]*)[.]Rmd"', 'href="articles/\\2.html"', text)
  gsub('href="NEWS[.](md|html)"', 'href="news/index.html"', text)
}

# pkgdown's pages load scripts from the network. pkgdown/extra.js replaces the ones that are needed.
without_network <- function(text) {
  text <- gsub('<script src="(https?:|file:)[^>]*></script>', "", text)
  text <- gsub('<link rel="stylesheet" href="https?:[^>]*>', "", text)
  # There is no logo.
  text <- gsub('<img src="" class="logo"[^>]*>', "", text)
  sub('<script src="((../)*)pkgdown[.]js"></script>', '<script src="\\1search.js"></script>', text)
}

# pkgdown shortens the paths of knitr's pictures, but not those of its animations.
link_to_animations <- function(text) {
  gsub(paste0('src="([.][.]/)+', folder, "/articles/"), 'src="', text)
}

change_page <- function(page) {
  text <- link_to_animations(without_network(readLines(page, encoding = "UTF-8")))
  if (dirname(page) == folder) text <- link_to_pages(text)
  writeLines(text, page, useBytes = TRUE)
}

pkgdown::build_site(
  preview = FALSE, install = FALSE, devel = FALSE, lazy = FALSE, new_process = FALSE,
  override = list(destination = folder)
)
places_found <- readLines(file.path(folder, "search.json"), encoding = "UTF-8", warn = FALSE)
writeLines(c("const searchPlaces =", places_found, ";"), file.path(folder, "search.js"),
           useBytes = TRUE)
pages <- list.files(folder, "[.]html$", recursive = TRUE, full.names = TRUE)
for (page in pages) change_page(page)
broken <- Filter(length, sapply(pages, broken_links, simplify = FALSE))
for (page in names(broken)) cat(page, ": ", toString(broken[[page]]), "\n", sep = "")
cat(sprintf("%d pages, %d broken links; open %s/index.html\n", length(pages),
            length(unlist(broken)), folder))
quit(status = if (length(broken) > 0) 1 else 0)
