# Draws the pictures of the README into man/figures, from vignettes/results.rds, which
# tools/vignette-results.R makes. Needs the packages magick and png.
#
#   tools/in-env Rscript tools/figures.R

library(gym)
source("vignettes/pictures.R")

results <- readRDS("vignettes/results.rds")

draw <- function(name, object) {
  file <- file.path("man/figures", name)
  grDevices::png(file, width = 7, height = 5, units = "in", res = 120)
  plot(object)
  grDevices::dev.off()
  fewer_colours(file)
  cat(file, ": ", round(file.size(file) / 1000), " kB\n", sep = "")
}

draw("search.png", results$search)
draw("decision.png", results$map)

played <- rollout("CartPole-v0", results$search$policy, seed = 1, frames = TRUE)
stopifnot(played$episodes$return == 200)
# Every second frame is smooth enough, at the same pace.
print(animate(played, "man/figures/cartpole.gif", width = 300, every = 2))
