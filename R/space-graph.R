# Graph: any number of nodes, of edges between them, and the two nodes of each edge.

#' @exportS3Method
init_space.gym_space_graph <- function(space) {
  space$node_space <- new_space(space$node_space)
  if (!is.null(space$edge_space)) {
    space$edge_space <- new_space(space$edge_space)
  }
  space
}

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
    edge_links = if (with_edges) {
      write_value(stacked_links(n, 1), value$edge_links)
    } else {
      "null"
    }
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
