autoplot <- ggplot2::autoplot

# How light colours are, from 0 to 100.
lightness <- function(colours) {
  grDevices::convertColor(t(grDevices::col2rgb(colours)) / 255, "sRGB", "Lab")[, "L"]
}

# What the colour-blind see; the matrices are those of Machado, Oliveira and Fernandes (2009) for
# linear RGB.
seen <- function(colours, blindness) {
  rgb <- t(grDevices::col2rgb(colours)) / 255
  linear <- ifelse(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055)^2.4)
  linear <- pmin(pmax(linear %*% t(blindness), 0), 1)
  shown <- ifelse(linear <= 0.0031308, linear * 12.92, 1.055 * linear^(1 / 2.4) - 0.055)
  grDevices::convertColor(shown, "sRGB", "Lab")
}
blindness <- list(
  protan = rbind(c(0.152286, 1.052583, -0.204868), c(0.114503, 0.786281, 0.099216),
                 c(-0.003882, -0.048116, 1.051998)),
  deutan = rbind(c(0.367322, 0.860646, -0.227968), c(0.280085, 0.672501, 0.047413),
                 c(-0.011820, 0.042940, 0.968881)),
  tritan = rbind(c(1.255528, -0.076749, -0.178779), c(-0.078411, 0.930809, 0.147602),
                 c(0.004733, 0.691367, 0.303900))
)

test_that("colours of lines remain apart in grey and for the colour-blind", {
  expect_gt(min(diff(sort(lightness(series_colours)))), 9)
  for (kind in names(blindness)) {
    expect_gt(min(stats::dist(seen(series_colours, blindness[[kind]]))), 20, label = kind)
  }
})

test_that("what is mapped from low to high is told apart in grey, and text on it is black", {
  expect_true(all(diff(lightness(value_colours())) > 0))
  ends <- lightness(diverging_colours[c(1, 3)])
  expect_gt(abs(diff(ends)), 15)
  expect_gt(min(ends, lightness(action_colours(7))), 55)
})

test_that("text above a picture is broken where four inches end, a part a line", {
  labels <- picture_labels(strrep("word ", 20), c("policy: random", strrep("long ", 10)))
  expect_lte(max(nchar(strsplit(labels$title, "\n")[[1]])), 38)
  expect_identical(strsplit(labels$subtitle, "\n")[[1]][[1]], "policy: random")
  expect_identical(picture_labels("a", c("b", "c"))$subtitle, "b, c")
  expect_null(picture_labels("a")$subtitle)
})

test_that("titles and keys fit four inches", {
  local_device()
  widths <- function(picture) {
    grob <- ggplot2::ggplotGrob(picture)
    above <- grob$grobs[grepl("guide-box|title|caption", grob$layout$name)]
    vapply(above, function(part) grid::convertWidth(grid::grobWidth(part), "in", TRUE), 0)
  }
  labels <- paste("push", c("left", "right", "not at all", "once more"))
  rows <- data.frame(x = 1:4, label = labels)
  expect_fits <- function(labels) {
    picture <- ggplot2::ggplot(rows, ggplot2::aes(.data$x, .data$x, colour = .data$label)) +
      ggplot2::geom_point() + key_of_marks(line_marks(labels)) + theme_gym() +
      picture_labels(strrep("word ", 20), strrep("word ", 30), caption = strrep("word ", 40))
    expect_lte(max(widths(picture)), 4)
  }
  expect_fits(labels)
  expect_fits(paste(labels, "and wait"))
})

test_that("words longer than a line are broken, such as ids, and so are names in keys and rows", {
  id <- "a-package/AVeryLongNameOfAnEnvironmentWithoutASpace-v0"
  expect_lte(max(nchar(strsplit(picture_labels(id)$title, "\n")[[1]])), 38)
  expect_identical(broken_texts(c("one two", "three"), 5), c("one\ntwo", "three"))
  expect_match(axis_labels(y = "share of runs that score more")$y, "\n")
  expect_match(key_labels(strrep("long ", 20)), "\n")
  expect_match(wrapped_strips()(data.frame(a = strrep("x", 50)))[[1]], "\n")
  expect_match(named_rows()$labels(c("a training with a long name", "b"))[[1]], "\n")
})

test_that("marks on an axis are whole numbers where some fit", {
  expect_identical(few_breaks(c(-0.5, 1.5)), 0:1)
  expect_identical(few_breaks(c(-2.4, 2.4)), -2:2)
  expect_identical(few_breaks(c(0.01, 0.09)), pretty(c(0.01, 0.09)))
  # A half of four inches has room for four, and pretty() gives six.
  expect_length(few_breaks(c(-0.54, -0.49), 4), 4)
})

test_that("the numbers of an axis have one form", {
  expect_identical(axis_numbers(c(0, 50000, 1e5, NA)), c("0", "50,000", "100,000", NA))
  expect_identical(axis_numbers(c(0, 2.5, 5)), c("0.0", "2.5", "5.0"))
  expect_identical(axis_numbers(c(5e11, 1e12)), c("5e+11", "1e+12"))
})

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
