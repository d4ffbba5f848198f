# Makes the moving picture and the filmstrip of README in man/figures: CartPole, solved.
#
#   tools/in-env Rscript tools/figures.R
#
# Takes some seconds, and the packages magick and png.

library(gym)

search <- search_random("CartPole-v0", seed = 2027)
print(search)
played <- rollout("CartPole-v0", search$policy, seed = 1, steps = TRUE, frames = TRUE)
print(played)
stopifnot(played$episodes$return == 200)

# Every second frame is smooth enough, at the same pace.
print(animate(played, "man/figures/cartpole.gif", width = 300, every = 2))

grDevices::png("man/figures/filmstrip.png", width = 7, height = 1.5, units = "in", res = 150)
plot(played, type = "filmstrip")
grDevices::dev.off()

grDevices::png("man/figures/trajectory.png", width = 7, height = 5, units = "in", res = 100)
plot(played, type = "trajectory")
grDevices::dev.off()
