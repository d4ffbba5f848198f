# Tests of pictures look at the built plot, not at pixels.

local_device <- function(frame = parent.frame()) {
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off(), envir = frame)
}

# Prints the picture, which must not warn, or touch R's generator. Returns it.
drawn <- function(picture) {
  force(picture)
  local_device()
  state <- globalenv()$.Random.seed
  testthat::expect_silent(print(picture))
  testthat::expect_identical(globalenv()$.Random.seed, state)
  invisible(picture)
}

# The data of a picture's layers of one kind, such as "GeomPoint", in their order.
layers_of <- function(picture, geom) {
  kinds <- vapply(picture$layers, function(layer) Find(nzchar, class(layer$geom)), "")
  lapply(which(kinds == geom), function(i) ggplot2::layer_data(picture, i))
}

# The labels of a picture's key, or NULL if it has none.
key_of <- function(picture, aesthetic = "colour") {
  scale <- ggplot2::ggplot_build(picture)$plot$scales$get_scales(aesthetic)
  if (is.null(scale)) NULL else scale$get_labels()
}
