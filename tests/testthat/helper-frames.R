# A rollout of CartPole with steps and frames, cut short.
short_rollout <- function(max_steps = 10, policy = policy_random(), ...) {
  rollout(
    "CartPole-v1", policy, max_steps = max_steps, seed = 1, steps = TRUE, frames = TRUE,
    client = test_client(), ...
  )
}

# What plots may have changed, and must have put back.
plot_parameters <- function() {
  graphics::par(c("mar", "oma", "mgp", "las", "xpd", "cex", "mfrow", "col", "lwd", "tcl"))
}

local_pdf <- function(..., frame = parent.frame()) {
  grDevices::pdf(NULL, ...)
  withr::defer(grDevices::dev.off(), envir = frame)
}
