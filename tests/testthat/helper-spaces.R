# Descriptions of spaces as the server writes them, after from_json().

describe_box <- function(low, high, shape = length(low), dtype = "float64") {
  list(name = "Box", shape = as.list(shape), dtype = dtype, low = as.list(low),
       high = as.list(high))
}

describe_dict <- function(...) {
  spaces <- list(...)
  entries <- Map(function(key, space) list(key = key, space = space), names(spaces), spaces)
  list(name = "Dict", dtype = NULL, spaces = unname(entries))
}

pick <- function(x) x[[sample.int(length(x), 1L)]]

random_shape <- function() {
  shapes <- list(integer(), 1, 3, c(1, 1), c(2, 3), c(3, 1), c(0, 2), c(2, 0), 0, c(2, 2, 2))
  as.integer(pick(shapes))
}

# Draws the description of a space from R's generator.
random_description <- function(depth = 3L, kinds = NULL) {
  leaves <- c("Discrete", "Box", "MultiDiscrete", "MultiBinary", "Text")
  nests <- c("Tuple", "Dict", "Sequence", "Graph", "OneOf")
  kind <- pick(if (depth > 0L) c(leaves, nests) else leaves)
  if (!is.null(kinds)) kind <- pick(kinds)
  part <- function(...) random_description(depth - 1L, ...)
  stackable <- c("Discrete", "Box")
  switch(kind,
    Discrete = list(
      name = kind, n = pick(list(1L, 5L, 2147483647L)), dtype = "int64",
      start = pick(list(0L, -3L, 9007190000000000, -9007190000000000))
    ),
    Box = random_box(),
    MultiDiscrete = {
      shape <- random_shape()
      n <- prod(shape)
      list(name = kind, shape = as.list(shape), dtype = "int64",
           nvec = as.list(sample.int(9L, n, TRUE)), start = as.list(sample(-5:5, n, TRUE)))
    },
    MultiBinary = list(name = kind, shape = as.list(random_shape()), dtype = "int8"),
    Text = list(name = kind, min_length = 0L, max_length = 6L,
                characters = "az\"\\/~.\u00e9\u6f22\U1F600 \n$"),
    Tuple = list(name = kind, spaces = replicate(sample(0:3, 1), part(), simplify = FALSE)),
    Dict = {
      keys <- c("a", "b.c", "d/e", "f~g", "h i", "\u00e9", "", "$", "a\"b", "~1", "\\")
      keys <- sample(keys, sample(0:3, 1))
      list(name = kind, spaces = lapply(keys, function(key) list(key = key, space = part())))
    },
    Sequence = list(name = kind, space = part(), stack = pick(c(TRUE, FALSE))),
    Graph = list(name = kind, node_space = part(stackable),
                 edge_space = pick(list(NULL, part(stackable)))),
    OneOf = list(name = kind, spaces = replicate(sample(1:3, 1), part(), simplify = FALSE))
  )
}

random_box <- function() {
  shape <- random_shape()
  n <- prod(shape)
  dtype <- pick(c(integer_dtypes, "bool", "float16", "float32", "float64"))
  range <- switch(dtype,
    float16 = pick(list(c(-1, 1), c(-65504, 65504), c(0, 1e100))),
    float32 = pick(list(c(-1, 1), c(-3.4e38, 3.4e38), c(-1e100, 1e100))),
    float64 = pick(list(c(-1, 1), c(-1.7e308, 1.7e308), c(-1e100, 1e100))),
    as.numeric(dtype_ranges[[dtype]])
  )
  describe_box(rep(range[[1]], n), rep(range[[2]], n), shape, dtype)
}

# The names of the kinds in a nested space.
all_kinds <- function(space) {
  parts <- c(space$spaces, list(space$space, space$node_space, space$edge_space))
  parts <- Filter(function(part) !is.null(part), unname(parts))
  unique(c(space$name, unlist(lapply(parts, all_kinds))))
}

# The JSON text of a value, as a request has it.
encode_value <- function(space, value, call) {
  check_value(space, value, "", call)
  write_value(space, value)
}
