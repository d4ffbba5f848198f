# The windy gridworld of Sutton and Barto (2018), example 6.5, learned by Sarsa.
#
# The goal lies in the row of the start. In the columns between them a wind moves the player up by
# one or two rows. Each step costs 1. The shortest path takes 15 steps.

library(gym)

wind <- c(0, 0, 0, 1, 1, 1, 2, 2, 1, 0)
moves <- rbind(up = c(-1, 0), right = c(0, 1), down = c(1, 0), left = c(0, -1))

windy <- gym_env(
  reset = function(self) {
    self$at <- c(row = 4, column = 1)
    place(self$at)
  },
  step = function(self, action) {
    blown <- c(-wind[self$at[["column"]]], 0)
    self$at[] <- pmin(pmax(self$at + moves[action + 1, ] + blown, 1), c(7, 10))
    list(observation = place(self$at), reward = -1, terminated = all(self$at == c(4, 8)))
  },
  render = function(self) {
    plot(NULL, xlim = c(0.5, 10.5), ylim = c(7.5, 0.5), asp = 1, xlab = "Wind", ylab = "",
         axes = FALSE)
    x <- rep(1:10, 7)
    y <- rep(1:7, each = 10)
    rect(x - 0.5, y - 0.5, x + 0.5, y + 0.5, col = grey(1 - wind / 10), border = "white")
    axis(1, 1:10, wind, tick = FALSE)
    text(8, 4, "goal")
    points(self$at[["column"]], self$at[["row"]], pch = 19, cex = 3)
  },
  observation_space = space_discrete(70), action_space = space_discrete(4), id = "WindyGridworld",
  render_fps = 4
)

# Cells are numbered from 0, row by row.
place <- function(at) 10 * (at[["row"]] - 1) + at[["column"]] - 1

print(check_env(windy, max_steps = 2000))

# Sarsa learns the value of each action in each cell. It takes the best action so far, or, with
# probability 0.1, a random one.
values <- matrix(0, 70, 4)
choose <- function(place) {
  if (runif(1) < 0.1) sample.int(4, 1) else which.max(values[place + 1, ])
}

set.seed(1)
lengths <- integer(300)
for (episode in seq_along(lengths)) {
  place_now <- windy$reset()
  action <- choose(place_now)
  repeat {
    out <- windy$step(action - 1)
    lengths[episode] <- lengths[episode] + 1L
    next_action <- choose(out$observation)
    # Values at the goal stay 0: no step starts there.
    target <- out$reward + values[out$observation + 1, next_action]
    error <- target - values[place_now + 1, action]
    values[place_now + 1, action] <- values[place_now + 1, action] + 0.5 * error
    if (out$done) break
    place_now <- out$observation
    action <- next_action
  }
}
cat("Steps of the first ten episodes:", mean(lengths[1:10]), "on average, of the last hundred:",
    mean(lengths[201:300]), "\n")

# The learned policy takes the best action in each cell.
greedy <- function(observation) max.col(values[observation + 1, , drop = FALSE], "first") - 1
learned <- rollout(windy, greedy, seed = 1, steps = TRUE, max_steps = 100)
print(learned)
cat("Its way:", rownames(moves)[learned$steps$action + 1], "\n")

# The book's figure: the number of finished episodes over the steps.
plot(cumsum(lengths), seq_along(lengths), type = "l", xlab = "Steps", ylab = "Episodes",
     main = "Windy gridworld")
