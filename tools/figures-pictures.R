# Draws the pictures of a search that the help and the README show, into man/figures: network.png,
# decision.png, landscape.png and luck.png. With the gym package installed:
#
#   tools/in-env Rscript tools/figures-pictures.R [folder]
#
# The 500 searches of the last take two or three minutes; what they came to is printed.

library(gym)

arguments <- commandArgs(trailingOnly = TRUE)
folder <- if (length(arguments)) arguments[[1L]] else file.path("man", "figures")

draw <- function(name, object, ...) {
  file <- file.path(folder, name)
  grDevices::png(file, width = 7, height = 5, units = "in", res = 96)
  plot(object, ...)
  grDevices::dev.off()
  cat(file, ": ", round(file.size(file) / 1000), " kB\n", sep = "")
}

# A network that watches angle and velocity of the pole both.
search <- search_random("CartPole-v0", seed = 8)
print(search)

draw("network.png", search$policy)
draw("decision.png", decision_map(search$policy, "CartPole-v0", "pole_angle",
                                  "pole_angular_velocity", path = TRUE, seed = 8))
landscape <- search_landscape(search, seed = 1)
print(landscape)
draw("landscape.png", landscape)

searches <- search_repeat("CartPole-v0", seeds = 1:500)
print(summary(searches))
draw("luck.png", searches)
