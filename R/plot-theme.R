# What all pictures share: the colours, the theme, titles and labels, and the key.

# Colours that remain distinct for colour-blind readers (simulated as by Machado, Oliveira and
# Fernandes, 2009) and in grey, because each is lighter than the one before it in this order: blue,
# brown, purple, green, gold, sky.
gym_colours <- c(
  blue = "#003473", gold = "#CDA514", purple = "#9250C2", green = "#009A79", brown = "#833718",
  sky = "#A2CDE9", ink = "#333333"
)

# For lines and areas that differ by colour alone.
series_colours <- unname(gym_colours[c("blue", "gold", "purple", "green", "brown", "sky")])

# If there are more labels than colours, the colours are less distinct, but still all different.
named_colours <- function(labels) {
  n <- length(labels)
  enough <- n <= length(series_colours)
  stats::setNames(if (enough) series_colours[seq_len(n)] else grDevices::hcl.colors(n), labels)
}

# From low to high. Both ends are light enough for black text, but not equally light, so that they
# differ in grey, too.
diverging_colours <- c("#EFB549", "#FAF7F0", "#4797C8")

# For regions and cells with a colour for each action, light enough for black text.
action_colours <- function(n) {
  light <- c("#F3D98B", "#A2CDE9", "#D9B8EE", "#7FC9B3", "#E3B7A2", "#EDEDED", "#C6D66B")
  light[seq_len(n)]
}

# With more actions than colours or symbols, use a continuous scale.
most_named_actions <- 6L

# The fill of a region or cell: the name of its action, or its number if there are many actions.
shown_actions <- function(actions, numbers, labels) {
  named <- length(numbers) <= most_named_actions
  if (named) factor(labels[match(actions, numbers)], labels) else actions
}

# The colour scale of actions. `taken` are the labels that the key shows.
action_fill <- function(numbers, labels, name = NULL, taken = labels, guide = rows_of_key(taken)) {
  if (length(numbers) > most_named_actions) {
    return(continuous_fill("action", c("#FBF3C9", "#7FC9B3", "#4797C8"), limits = range(numbers)))
  }
  ggplot2::scale_fill_manual(
    name = name, values = stats::setNames(action_colours(length(labels)), labels), limits = taken,
    guide = guide
  )
}

value_colours <- function() grDevices::hcl.colors(101L, "viridis")

theme_gym <- function() {
  text <- ggplot2::element_text
  ggplot2::theme_minimal(base_size = 11) +
    ggplot2::theme(
      plot.title = text(face = "bold", size = ggplot2::rel(1.1)),
      plot.subtitle = text(colour = "grey30", size = ggplot2::rel(0.9)),
      plot.caption = text(hjust = 0, size = ggplot2::rel(0.72)),
      plot.title.position = "plot", plot.caption.position = "plot",
      # The number at the right end of an axis reaches beyond the panel.
      plot.margin = ggplot2::margin(5.5, 13, 5.5, 5.5),
      legend.position = "top", legend.justification = "left", legend.box = "vertical",
      legend.box.just = "left", legend.margin = ggplot2::margin(),
      legend.spacing = ggplot2::unit(2, "pt"), legend.box.spacing = ggplot2::unit(4, "pt"),
      legend.key.height = ggplot2::unit(12, "pt"),
      legend.title = text(size = ggplot2::rel(0.8)), legend.text = text(size = ggplot2::rel(0.75)),
      panel.grid.minor = ggplot2::element_blank(), strip.clip = "off",
      strip.text = text(hjust = 0, size = ggplot2::rel(0.7), margin = ggplot2::margin(b = 2))
    )
}

# For pictures with many small panels.
theme_gym_panels <- function() {
  theme_gym() +
    ggplot2::theme(
      axis.text = ggplot2::element_text(size = ggplot2::rel(0.7)),
      panel.spacing.x = ggplot2::unit(12, "pt")
    )
}

# For pictures without axes: grids, diagrams and frames. The user may still give the axes labels.
theme_gym_bare <- function() {
  list(
    ggplot2::labs(x = NULL, y = NULL), theme_gym(),
    ggplot2::theme(panel.grid = ggplot2::element_blank(), axis.text = ggplot2::element_blank())
  )
}

# Breaks the text around a picture into lines that fit four inches, because ggplot2 cuts off longer
# lines. If a subtitle does not fit in one line, each of its parts gets a line.
picture_labels <- function(title = NULL, subtitle = NULL, ..., width = 54, caption = NULL) {
  axes <- axis_labels(...)
  joined <- paste(subtitle, collapse = ", ")
  lines <- unlist(lapply(if (nchar(joined) > width) subtitle else joined, broken_text, width))
  ggplot2::labs(
    title = broken_text(title, 38), subtitle = if (length(lines)) paste(lines, collapse = "\n"),
    caption = if (length(caption)) paste(broken_texts(caption, 1.25 * width), collapse = "\n"),
    !!!axes
  )
}

# Breaks the labels of axes into lines that fit. The vertical axis of a small picture is two inches
# long.
axis_labels <- function(...) {
  given <- list(...)
  widths <- c(x = 44, y = 24)
  Map(function(text, axis) {
    if (is.character(text)) broken_text(text, widths[[axis]]) else text
  }, given, names(given))
}

broken_text <- function(text, width) {
  if (length(text) && nzchar(text)) paste(broken_texts(text, width), collapse = "\n")
}

# Breaks each text into lines of at most this width. Longer words, such as ids, are broken, too.
broken_texts <- function(texts, width) {
  vapply(strwrap(texts, width, simplify = FALSE), function(lines) {
    cut <- gsub(paste0("(\\S{", as.integer(width), "})(?=\\S)"), "\\1\n", lines, perl = TRUE)
    paste(cut, collapse = "\n")
  }, "", USE.NAMES = FALSE)
}

policy_subtitle <- function(x) paste("policy:", policy_label(x$policy))

# The key -------------------------------------------------------------------------------

# The meaning of a point or a line.
key_mark <- function(colour, shape = NA, line = "blank") {
  list(colour = gym_colours[[colour]], shape = shape, line = line)
}

#' Make the key of a picture
#'
#' Layers name their mark by the colour, as in `aes(colour = "episode")`.
#' @param marks A list of marks, named by their meaning. `NULL` marks are not drawn.
#' @return A list, to be added to the picture.
#' @noRd
key_of_marks <- function(marks) {
  marks <- marks[lengths(marks) > 0L]
  each <- function(part) unlist(lapply(marks, function(mark) mark[[part]]))
  drawn <- list(shape = unname(each("shape")), linetype = unname(each("line")))
  ggplot2::scale_colour_manual(
    name = NULL, values = each("colour"), limits = names(marks), labels = key_labels,
    guide = rows_of_key(names(marks), override.aes = drawn)
  )
}

# The marks of lines, for key_of_marks().
line_marks <- function(labels) {
  lapply(named_colours(labels), function(colour) list(colour = colour, shape = NA, line = "solid"))
}

# Breaks labels that are longer than a line of the key.
key_labels <- function(labels) broken_texts(labels, 46)

# A key with as many rows as fit into four inches.
rows_of_key <- function(labels, ...) {
  n <- length(labels)
  width <- function(rows) {
    columns <- ceiling(n / rows)
    sum(tapply(pmin(nchar(labels), 46) + 6, (seq_len(n) - 1L) %% columns, max))
  }
  rows <- Find(function(rows) width(rows) <= 54, seq_len(n))
  ggplot2::guide_legend(nrow = rows %||% max(n, 1L), byrow = TRUE, ...)
}

# The key of a colour scale, with few numbers so that they do not overlap.
continuous_fill <- function(name, colours, ...) {
  ggplot2::scale_fill_gradientn(
    name = name, colours = colours, n.breaks = 4, guide = ggplot2::guide_colourbar(order = 1), ...
  )
}

# The targets of several environments share one place in the key.
target_label <- function(target) {
  paste(c("target", if (length(target) == 1L) number_text(target)), collapse = " ")
}

# Draws the line of the target, if there is one, or a line for each environment.
target_line <- function(target, ...) {
  if (length(target)) {
    ggplot2::geom_hline(
      ggplot2::aes(yintercept = .data$target, colour = .data$key),
      data.frame(target = target, key = target_label(target), ...), linetype = "dashed",
      linewidth = 0.7
    )
  }
}

target_mark <- function(target) {
  if (length(target)) stats::setNames(list(key_mark("ink", line = "dashed")), target_label(target))
}

finite_target <- function(target) if (!is.null(target) && is.finite(target)) target

# Axes ----------------------------------------------------------------------------------

number_axis <- function(scale, ...) scale(labels = axis_numbers, ...)

# Gives all numbers of an axis the same form.
axis_numbers <- function(at) ifelse(is.na(at), NA, number_text(at, trim = TRUE))

# Breaks the panels' titles if they do not fit in half of four inches.
wrapped_strips <- function(columns = 2) {
  ggplot2::as_labeller(function(labels) broken_texts(labels, 66 %/% columns))
}

# Axis marks. If there are few whole numbers, mark them all, because actions are whole numbers.
# `pretty()` may give more marks than asked for.
few_breaks <- function(limits, n = 5) {
  from <- ceiling(limits[[1L]])
  to <- floor(limits[[2L]])
  if (from < to && to - from < n) {
    return(from:to)
  }
  at <- pretty(limits, n)
  if (sum(at >= limits[[1L]] & at <= limits[[2L]]) > n) pretty(limits, n - 1) else at
}

returns_label <- "return (reward summed over an episode)"

training_steps_label <- "steps of the environment"

# plot() -------------------------------------------------------------------------------

# plot() of a result prints the picture that autoplot() makes. Printing needs ggplot2's namespace.
# The first picture loads it, so loading this package stays fast.

show_picture <- function(x, ..., main = NULL, xlab = NULL, ylab = NULL, xlim = NULL, ylim = NULL,
                         guide = NULL) {
  arguments <- arguments_as_written(quote(x))
  # Pass results without names, in variables that know their names. Otherwise a result that the user
  # named `episode` would become this argument of autoplot().
  named <- which(vapply(arguments, is_comparable, NA))
  names(arguments) <- rlang::names2(arguments)
  labelled <- Map(structure, arguments[named], label = names(arguments)[named])
  names <- paste0("result", named, recycle0 = TRUE)
  results <- list2env(stats::setNames(labelled, names), parent = asNamespace("ggplot2"))
  arguments[named] <- lapply(names, as.name)
  names(arguments)[named] <- ""
  picture <- naming_own_call(eval(as.call(c(quote(autoplot), arguments)), results), "autoplot")
  labels <- Filter(Negate(is.null), list(x = xlab, y = ylab))
  picture <- picture + ggplot2::labs(!!!do.call(axis_labels, labels))
  if (!is.null(main)) picture <- picture + ggplot2::labs(title = broken_text(main, 38))
  if (!is.null(guide)) {
    must <- "\"none\" or NULL"
    if (!identical(guide, "none")) abort_argument(guide, must, "guide", rlang::current_env())
    picture <- picture + ggplot2::theme(legend.position = "none")
  }
  if (!is.null(xlim) || !is.null(ylim)) {
    picture <- picture + ggplot2::coord_cartesian(xlim = xlim, ylim = ylim)
  }
  print(picture)
  invisible(picture)
}

#' @rdname plot.gym_bandit_learning
#' @export
plot.gym_bandit_learning <- show_picture

#' @rdname plot.gym_comparison
#' @export
plot.gym_comparison <- show_picture

#' @rdname plot.gym_decision_map
#' @export
plot.gym_decision_map <- show_picture

#' @rdname plot.gym_evaluation
#' @export
plot.gym_evaluation <- show_picture

#' @rdname plot.gym_frame
#' @export
plot.gym_frame <- show_picture

#' @rdname plot.gym_offline
#' @export
plot.gym_offline <- show_picture

#' @rdname plot.gym_policy_network
#' @export
plot.gym_policy <- show_picture

#' @rdname plot.gym_rollout
#' @export
plot.gym_rollout <- show_picture

#' @rdname plot.gym_search
#' @export
plot.gym_search <- show_picture

#' @rdname plot.gym_solution
#' @export
plot.gym_solution <- show_picture

#' @rdname plot.gym_state_map
#' @export
plot.gym_state_map <- show_picture

#' @rdname sweep_agent
#' @export
plot.gym_sweep <- show_picture

#' @rdname plot.gym_training
#' @export
plot.gym_training <- show_picture

#' @rdname plot.gym_trainings
#' @export
plot.gym_trainings <- show_picture
