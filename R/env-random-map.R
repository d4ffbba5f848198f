# FrozenLake's random maps. Gymnasium draws one in the constructor, from a generator that cannot be
# seeded. Here it is drawn from the seed of the run and sent.

lake_size <- 8L
chance_of_ice <- 0.8

#' Draw the map of a FrozenLake with a random map
#'
#' @param env An environment, or its id.
#' @param arguments The arguments that it is made with.
#' @param seed The seed of the map; of several, the first that is given. `NULL` leaves the map to
#'   the server.
#' @return The arguments, with the map as `desc`.
#' @noRd
with_random_map <- function(env, arguments, seed) {
  seed <- stats::na.omit(unlist(seed))
  if (length(seed) && is.numeric(seed) && wants_random_map(env, arguments)) {
    arguments$desc <- with_generator(new_generator(seed[[1L]]), draw_lake())
  }
  arguments
}

# By default FrozenLake has a map with a name.
wants_random_map <- function(env, arguments) {
  id <- bare_id(env)
  rlang::is_string(id) && grepl("^FrozenLake", id) && "map_name" %in% names(arguments) &&
    is.null(arguments[["map_name"]]) && is.null(arguments[["desc"]])
}

# Like Gymnasium: draws cells until there is a way from the start to the goal.
draw_lake <- function() {
  repeat {
    cells <- matrix(stats::runif(lake_size^2) < chance_of_ice, lake_size)
    cells[c(1L, lake_size^2)] <- TRUE
    if (has_way(cells)) break
  }
  cells[] <- ifelse(cells, "F", "H")
  cells[c(1L, lake_size^2)] <- c("S", "G")
  apply(cells, 1L, paste, collapse = "")
}

# Is there a way over ice from the first cell to the last?
has_way <- function(ice) {
  n <- nrow(ice)
  reached <- row(ice) == 1L & col(ice) == 1L
  repeat {
    beside <- rbind(reached[-1L, ], FALSE) | rbind(FALSE, reached[-n, ]) |
      cbind(reached[, -1L], FALSE) | cbind(FALSE, reached[, -n])
    grown <- ice & (reached | beside)
    if (identical(grown, reached)) {
      return(reached[n, n])
    }
    reached <- grown
  }
}
