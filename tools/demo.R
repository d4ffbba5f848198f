# Solves CartPole by random search, prints what was found, and draws it.
library(gym)

folder <- "pictures"
dir.create(folder, showWarnings = FALSE)

draw <- function(name, object, ...) {
  file <- file.path(folder, name)
  png(file, width = 900, height = 600, res = 110)
  plot(object, ...)
  dev.off()
  normalizePath(file)
}

# If none of the fifty random networks balances the pole, try another seed.
for (attempt in 1:5) {
  seed <- sample.int(10000, 1)
  cat("search_random(seed = ", seed, ")\n\n", sep = "")
  result <- search_random(seed = seed)
  if (result$solved) break
  print(result)
  cat("\n")
}

# The search, and 100 fresh episodes with its network.
print(summary(result))
cat("\n")

moves <- requireNamespace("magick", quietly = TRUE)
episode <- rollout("CartPole-v0", result$policy, seed = seed, steps = TRUE, frames = moves)
pictures <- c(
  "Every episode of the search" = draw("demo-search.png", result),
  "The network" = draw("demo-network.png", result$policy),
  "What it does in an episode" = draw("demo-episode.png", episode, type = "trajectory")
)
if (moves) {
  film <- animate(episode, file.path(folder, "demo.gif"), width = 300, every = 2)
  pictures <- c(pictures, "The pole, moving" = normalizePath(film$file))
}
cat(sprintf("%s: %s\n", names(pictures), pictures), sep = "")
cat("\nTo repeat this in R:  search_random(seed = ", seed, ")\n", sep = "")
