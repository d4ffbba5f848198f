# Draws vignettes/articles/blackjack.png, which the page of chapter 5 shows, by that page's code.
#
#   tools/in-env Rscript --no-init-file tools/blackjack.R
#
# Takes half a minute.
library(gym)
source("vignettes/pictures.R")

learned <- learn_monte_carlo(
  "Blackjack-v1", sab = TRUE, iterations = 500, discount = 1, epsilon = 0.1, seed = 1,
  target = Inf, eval_every = 1000, eval_episodes = 10000
)
print(learned)
file <- "vignettes/articles/blackjack.png"
grDevices::png(file, width = 7, height = 3.6, units = "in", res = 64)
plot(decision_map("Blackjack-v1", learned, "dealer_card", "player_sum", xlim = c(1, 10),
                  ylim = c(12, 21)))
grDevices::dev.off()
fewer_colours(file)
