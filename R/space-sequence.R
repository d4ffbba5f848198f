# Sequence: any number of elements of another space. If the elements are numbers, they are stacked
# into one array, like the values of sub-environments. Other elements are a list. Graph uses the
# same functions.

is_stackable <- function(space) {
  inherits(space, "gym_space_array") || inherits(space, "gym_space_discrete")
}

decode_stack <- function(space, json) {
  if (is_stackable(space)) {
    shape <- c(length(json), space$shape)
    shape_values(check_numbers(decode_numbers(space$dtype, json), shape), shape)
  } else {
    lapply(json, decode_value, space = space)
  }
}

check_stack <- function(space, value, path, call, bounds) {
  if (is_stackable(space)) {
    check_value(batch_space(space, stack_length(value)), value, path, call, bounds)
  } else {
    check_elements(space, value, path, call, bounds)
  }
}

check_elements <- function(space, value, path, call, bounds) {
  if (!is.list(value)) {
    abort_space(space, value, "Several values of this space are a list", call, path)
  }
  for (i in seq_along(value)) check_value(space, value[[i]], path_index(path, i - 1L), call, bounds)
}

stack_length <- function(value) dim(value)[1L] %||% length(value)

write_stack <- function(space, value, stacked = is_stackable(space)) {
  if (stacked) {
    write_value(batch_space(space, stack_length(value)), value)
  } else {
    json_array(vapply(unname(value), write_value, "", space = space))
  }
}

sample_stack <- function(space, n, stacked = is_stackable(space)) {
  values <- lapply(seq_len(n), function(i) space_sample(space))
  if (stacked) stack_values(space, values) else values
}

stack_values <- function(space, values) {
  rank <- length(space$shape)
  if (length(values) == 1L && rank <= 1L && is.numeric(value <- values[[1L]])) {
    # Most batches have one value; this takes a fifth of the time.
    labels <- names(value)
    value <- as.vector(value)
    if (rank) value <- matrix(value, 1L, dimnames = if (length(labels)) list(NULL, labels))
    return(value)
  }
  flat <- lapply(values, row_major)
  numbers <- if (length(flat)) unlist(flat) else decode_numbers(space$dtype, list())
  stacked <- shape_values(numbers, c(length(values), space$shape))
  if (length(space$shape) == 1L && length(values)) colnames(stacked) <- names(values[[1L]])
  stacked
}

# Sequence --------------------------------------------------------------------------

#' @exportS3Method
space_label.gym_space_sequence <- function(space) {
  paste0("Sequence of ", space_label(space$space), if (space$stack) ", stacked")
}

#' @exportS3Method
decode_value.gym_space_sequence <- function(space, json) {
  check_list(json, length(json), "Sequence")
  inside <- space$space
  if (space$stack) decode_stack(inside, json) else lapply(json, decode_value, space = inside)
}

#' @exportS3Method
check_value.gym_space_sequence <- function(space, value, path, call, bounds = FALSE) {
  check <- if (space$stack) check_stack else check_elements
  check(space$space, value, path, call, bounds)
}

#' @exportS3Method
write_value.gym_space_sequence <- function(space, value) {
  write_stack(space$space, value, space$stack && is_stackable(space$space))
}

#' @exportS3Method
space_sample.gym_space_sequence <- function(space) {
  sample_stack(space$space, 1L + stats::rgeom(1L, 0.25), space$stack && is_stackable(space$space))
}

# Graph ------------------------------------------------------------------------------------

# Graph: any number of nodes, of edges between them, and the two nodes of each edge.

#' @exportS3Method
space_label.gym_space_graph <- function(space) {
  edges <- if (!is.null(space$edge_space)) paste(", edges", space_label(space$edge_space))
  paste0("Graph of nodes ", space_label(space$node_space), edges)
}

#' @exportS3Method
decode_value.gym_space_graph <- function(space, json) {
  check_list(json, length(json), "Graph")
  list(
    nodes = decode_stack(space$node_space, json$nodes),
    edges = if (!is.null(json$edges)) decode_stack(space$edge_space, json$edges),
    edge_links = if (!is.null(json$edge_links)) {
      matrix(whole_from_json(json$edge_links), ncol = 2L, byrow = TRUE)
    }
  )
}

#' @exportS3Method
check_value.gym_space_graph <- function(space, value, path, call, bounds = FALSE) {
  parts <- c("nodes", "edges", "edge_links")
  if (!is.list(value) || is.null(value$nodes) || !all(names(value) %in% parts)) {
    problem <- "A value of Graph is a list of nodes, edges and edge_links"
    abort_space(space, value, problem, call, path)
  }
  check_stack(space$node_space, value$nodes, path_key(path, "nodes"), call, bounds)
  if (is.null(value$edges) != is.null(value$edge_links) ||
        is.null(space$edge_space) && !is.null(value$edges)) {
    problem <- "Edges need edge_links, edge_links need edges, and both a space that has edges"
    abort_space(space, value, problem, call, path)
  }
  if (!is.null(value$edges)) {
    check_stack(space$edge_space, value$edges, path_key(path, "edges"), call, bounds)
    links <- stacked_links(stack_length(value$edges), stack_length(value$nodes))
    check_value(links, value$edge_links, path_key(path, "edge_links"), call, bounds = TRUE)
  }
}

# The space of edge_links: two nodes per edge.
stacked_links <- function(edges, nodes) {
  link <- make_space("Box", dtype = "int64", shape = 2L, low = c(0, 0), high = rep(nodes - 1, 2L))
  batch_space(link, edges)
}

#' @exportS3Method
write_value.gym_space_graph <- function(space, value) {
  with_edges <- !is.null(value$edges)
  n <- if (with_edges) stack_length(value$edges) else 0L
  json_object(c(
    nodes = write_stack(space$node_space, value$nodes),
    edges = if (with_edges) write_stack(space$edge_space, value$edges) else "null",
    edge_links = if (with_edges) write_value(stacked_links(n, 1), value$edge_links) else "null"
  ))
}

#' @exportS3Method
space_sample.gym_space_graph <- function(space) {
  nodes <- sample.int(10L, 1L)
  edges <- if (is.null(space$edge_space)) 0L else sample.int(nodes * (nodes - 1L) + 1L, 1L) - 1L
  list(
    nodes = sample_stack(space$node_space, nodes),
    edges = if (edges > 0L) sample_stack(space$edge_space, edges),
    edge_links = if (edges > 0L) {
      matrix(sample.int(nodes, 2L * edges, replace = TRUE) - 1L, ncol = 2L)
    }
  )
}

# Text: a string of certain characters ------------------------------------------------------

#' @exportS3Method
space_label.gym_space_text <- function(space) {
  paste0("Text of ", space$min_length, " to ", count_of(space$max_length, "character"))
}

#' @exportS3Method
decode_value.gym_space_text <- function(space, json) check_text(json)

#' @exportS3Method
check_value.gym_space_text <- function(space, value, path, call, bounds = FALSE) {
  if (!rlang::is_string(value) || is.na(value)) {
    abort_space(space, value, "A value of Text is one string", call, path)
  }
  if (bounds) {
    characters <- strsplit(enc2utf8(value), "")[[1L]]
    known <- strsplit(space$characters, "")[[1L]]
    n <- length(characters)
    if (n < space$min_length || n > space$max_length) {
      abort_space(space, value, paste("The text has", count_of(n, "character")), call, path)
    }
    strange <- setdiff(characters, known)
    if (length(strange)) {
      problem <- paste("The text has characters that the space does not allow:", toString(strange))
      abort_space(space, value, problem, call, path)
    }
  }
}

#' @exportS3Method
write_value.gym_space_text <- function(space, value) json_string(value)

#' @exportS3Method
space_sample.gym_space_text <- function(space) {
  known <- strsplit(space$characters, "")[[1L]]
  lengths <- space$max_length - space$min_length + 1L
  n <- space$min_length + sample.int(lengths, 1L) - 1L
  paste(known[sample.int(length(known), n, replace = TRUE)], collapse = "")
}
