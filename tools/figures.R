# Draws the pictures of the README into man/figures, from vignettes/results.rds, which
# tools/vignette-results.R makes.
#
#   tools/in-env Rscript tools/figures.R
#
# Takes some two minutes, most of them for a training of LunarLander, and the packages magick and
# png.

library(gym)
source("vignettes/pictures.R")

results <- readRDS("vignettes/results.rds")
policy <- results$search$policy

draw <- function(name, object, ..., width = 7, height = 5) {
  file <- file.path("man/figures", name)
  grDevices::png(file, width = width, height = height, units = "in", res = 120)
  plot(object, ...)
  grDevices::dev.off()
  fewer_colours(file)
  cat(file, ": ", round(file.size(file) / 1000), " kB\n", sep = "")
}

draw("search.png", results$search)
draw("network.png", policy)
draw("decision.png", results$map)
draw("landscape.png", results$landscape)
draw("luck.png", results$searches)

played <- rollout("CartPole-v0", policy, seed = 1, steps = TRUE, frames = TRUE)
stopifnot(played$episodes$return == 200)
draw("trajectory.png", played, type = "trajectory")
draw("filmstrip.png", played, type = "filmstrip", height = 1.5)
# Every second frame is smooth enough, at the same pace.
print(animate(played, "man/figures/cartpole.gif", width = 300, every = 2))

lander <- search_ars("LunarLander-v3", continuous = TRUE, target = 220, seed = 1001)
print(lander)
print(animate(lander, "man/figures/lander.gif", seed = 3, width = 300, every = 5))
