autoplot <- ggplot2::autoplot

search_of <- function(returns, rounds, ...) {
  search_random(
    scripted_environment(returns), rounds = rounds, episodes = length(returns) / rounds, ...
  )
}

test_that("plot() prints the picture of autoplot(), and returns it invisibly", {
  search <- search_of(1:4, rounds = 2)
  # The file is there only when something was drawn.
  file <- withr::local_tempfile(fileext = ".png")
  grDevices::png(file)
  picture <- expect_invisible(plot(search))
  grDevices::dev.off()
  expect_true(file.exists(file))
  expect_identical(ggplot2::layer_data(picture), ggplot2::layer_data(autoplot(search)))
  expect_identical((picture + ggplot2::labs(title = "mine"))$labels$title, "mine")
})

test_that("titles, labels and limits can be chosen", {
  local_device()
  picture <- plot(search_of(1:4, rounds = 2), main = "mine", xlab = "a", ylab = "b",
                  ylim = c(-50, 50))
  expect_identical(picture$labels[c("title", "x", "y")], list(title = "mine", x = "a", y = "b"),
                   ignore_attr = TRUE)
  expect_identical(picture$coordinates$limits$y, c(-50, 50))
  expect_null(plot(search_of(1:4, rounds = 2), main = "")$labels$title)
})

test_that("labels of axes work in pictures without axes, and a key can be left out", {
  local_device()
  solved <- solve_mdp(walk_model())
  pictures <- list(
    plot(solved, columns = 4, xlab = "across", ylab = "down", guide = "none"),
    plot(policy_network(c(2, 1)), xlab = "across", ylab = "down", guide = "none"),
    plot(decision_map(policy = policy_network(c(2, 1)), xlim = 0:1, ylim = 0:1),
         xlab = "across", ylab = "down", guide = "none"),
    plot(new_frame(array(0:11, c(2, 2, 3))), xlab = "across", ylab = "down", guide = "none")
  )
  for (picture in pictures) {
    grob <- ggplot2::ggplotGrob(picture)
    drawn <- function(name) class(grob$grobs[[grep(name, grob$layout$name)[[1]]]])[[1]]
    expect_false("zeroGrob" %in% c(drawn("xlab-b"), drawn("ylab-l")))
    expect_false(any(grepl("guide-box", grob$layout$name)))
  }
  expect_error(plot(solved, guide = "left"), "`guide` must be \"none\" or NULL",
               class = "gym_error_argument")
  long <- plot(policy_network(c(2, 1)), ylab = strrep("long ", 10))
  expect_match(long$labels$y, "\n")
})

test_that("results are called as in the call, as their variables, or by a label of their own", {
  named <- function(object, ...) {
    names(given_rollouts(arguments_as_written(quote(object))))
  }
  a <- rollout(scripted_environment(1:3), policy_random(), episodes = 3)
  expect_identical(named(random = a, `no name` = a), c("random", "no name"))
  expect_identical(named(a, b = a), c("a", "b"))
  expect_identical(named(rollout(scripted_environment(1:3), policy_random(), 3), a),
                   c("random", "a"))
  expect_identical(named(a, a), c("a", "a 1"))
  expect_identical(named(a, rollout(scripted_environment(1:3), policy_random(), 3)),
                   c("a", "random"))
  local_device()
  expect_identical(levels(plot(b = a, a)$data$label), c("a", "b"))
})

test_that("a frame is a picture, too", {
  picture <- drawn(autoplot(new_frame(array(0:11, c(2, 2, 3)))))
  expect_identical(dim(picture$layers[[2]]$geom_params$grob$raster), c(2L, 2L))
})

test_that("library(gym) loads neither ggplot2 nor grid, a picture does", {
  skip_unless_all()
  code <- paste(
    "library(gym); loaded <- function() intersect(c('ggplot2', 'grid'), loadedNamespaces())",
    "before <- loaded(); pdf(NULL); plot(policy_network(c(2, 1)))",
    "cat(length(before), length(loaded()), class(ggplot2::autoplot(policy_network(c(2, 1))))[[1]])",
    sep = "; "
  )
  said <- processx::run(file.path(R.home("bin"), "Rscript"), c("-e", code))$stdout
  expect_match(said, "^0 2 gg")
})

test_that("a result may have the name of an argument of its picture", {
  local_device()
  episode <- rollout(fake_environment(), policy_random(), seed = 1, steps = TRUE)
  n <- episode
  expect_s3_class(plot(episode, type = "trajectory"), "ggplot")
  expect_identical(plot(episode, n)$labels, plot(episode, other = n)$labels)
})
