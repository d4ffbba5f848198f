# Checks that every file of R/ uses only its own layer and those below, and that no name is defined
# twice. A file's layer is its prefix: space-array.R and space.R both have the prefix "space".
# Prints `layers: clean`, or a line for each use of a higher layer, and then fails.
#
# codetools::findGlobals() finds what a function uses, also functions that are passed by name. An S3
# method may be in a layer above its generic, because dispatch does not count as a use. Calls in
# cli's strings are not found.

# The only list of the layers, from the top.
floors <- list(
  c("plot", "animate"), "sb3", "agent", "train", "data", "mdp", "play", "policy", "env", "space",
  "client", c("server", "install"), "http", "utils"
)

# The package's help page and .onLoad() may use all layers.
outside <- "gym-package.R"

# The rank of a file's layer, counted from the top. NA for a prefix that is not listed.
rank_of <- function(file) {
  prefix <- sub("[-.].*", "", file)
  match(TRUE, vapply(floors, function(floor) prefix %in% floor, NA))
}

# Returns an element for each top-level expression of a file, with all names that it uses, also in
# nested functions, lists and R6 classes. An expression that is not an assignment has the name "".
uses_in <- function(file) {
  rows <- lapply(parse(file.path("R", file), keep.source = FALSE), function(expression) {
    is_named <- is.call(expression) && as.character(expression[[1L]])[1L] %in% c("<-", "=") &&
      is.name(expression[[2L]])
    name <- if (is_named) as.character(expression[[2L]]) else ""
    code <- if (is_named) expression[[3L]] else expression
    used <- codetools::findGlobals(as.function(list(code), envir = globalenv()), merge = TRUE)
    list(file = file, name = name, uses = used)
  })
  Filter(function(row) row$name != "" || length(row$uses), rows)
}

files <- setdiff(list.files("R", "[.]R$"), outside)
objects <- unlist(lapply(files, uses_in), recursive = FALSE)
home <- vapply(objects, function(object) object$file, "")
names(home) <- vapply(objects, function(object) object$name, "")

problems <- sprintf("R/%s has no known prefix", files[is.na(vapply(files, rank_of, 0L))])
# If two objects have the same name, R silently keeps the last.
twice <- unique(names(home)[duplicated(names(home)) & names(home) != ""])
problems <- c(problems, sprintf("%s is defined more than once", twice))
for (object in objects) {
  own <- rank_of(object$file)
  for (used in setdiff(intersect(object$uses, names(home)), "")) {
    if (isTRUE(rank_of(home[[used]]) < own)) {
      problems <- c(problems, sprintf(
        "R/%s %s -> R/%s %s", object$file, object$name, home[[used]], used
      ))
    }
  }
}

writeLines(if (length(problems)) sort(problems) else "layers: clean")
quit(status = if (length(problems)) 1 else 0)
