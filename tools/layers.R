# Checks that every file of R/ uses only what stands on its own floor or below, and that no name is
# given twice. A file's floor is
# its prefix: space-array.R and space.R both have the prefix "space". Prints `layers: clean`, or
# one line for each use of a higher floor, and then fails.
#
# What a function uses is what codetools::findGlobals() finds in it, functions that are passed by
# name included. An S3 method may live above its generic: dispatch is no use. Calls inside of the
# strings of cli are not seen.

# The one list of the floors, from the top.
floors <- list(
  c("plot", "animate"), "sb3", "agent", "train", "data", "mdp", "play", "policy", "env", "space",
  "client", c("server", "install"), "http", "utils"
)

# The package's help page and .onLoad() see the whole house.
outside <- "gym-package.R"

# Its rank counts from the top; NA for a prefix that is not listed.
rank_of <- function(file) {
  prefix <- sub("[-.].*", "", file)
  match(TRUE, vapply(floors, function(floor) prefix %in% floor, NA))
}

# One row for each top-level object of a file, with all the names that it uses: nested functions,
# lists and R6 classes lie in the same expression. What is no assignment has the name "".
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
# Of two objects with one name R keeps the last, and says nothing.
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
