# Solves CartPole by random search, prints what was found, and draws it.
library(gym)

folder <- "pictures"
dir.create(folder, showWarnings = FALSE)

draw <- function(name, object, width = 900, height = 600) {
  file <- file.path(folder, name)
  png(file, width = width, height = height, res = 110)
  plot(object)
  dev.off()
  normalizePath(file)
}

last_frame <- function(policy, seed) {
  env <- gym_make("CartPole-v0", seed = seed)
  on.exit(env$close())
  observation <- env$reset()
  repeat {
    step <- env$step(act(policy, observation))
    if (step$terminated || step$truncated) break
    observation <- step$observation
  }
  env$render()
}

# Fifty random networks may hold none that balances the pole: then another seed.
for (attempt in 1:5) {
  seed <- sample.int(10000, 1)
  cat("search_random(seed = ", seed, ")\n\n", sep = "")
  result <- search_random(seed = seed)
  print(result)
  cat("\n")
  if (result$solved) break
}

cat("100 fresh episodes with the network found:\n\n")
print(summary(result))
cat("\n")

pictures <- c(
  "the search" = draw("demo-search.png", result),
  "the last step of an episode" = draw("demo-frame.png", last_frame(result$policy, seed), 600, 400)
)
cat(sprintf("A picture of %s: %s\n", names(pictures), pictures), sep = "")
cat("\nThe same again, in R:  search_random(seed = ", seed, ")\n", sep = "")
