# Draws an episode's observations and actions over its steps.

trajectory_picture <- function(x, data) {
  values <- data$values
  panels <- nlevels(values$panel)
  columns <- if (panels > 3L) 2L else 1L
  of_kind <- function(kind) values[values$kind == kind, ]
  named <- setdiff(levels(values$part), "")
  place <- ggplot2::aes(.data$time, .data$value, colour = .data$part)
  ggplot2::ggplot() +
    lapply(names(limit_colours), function(kind) {
      ggplot2::geom_hline(
        ggplot2::aes(yintercept = .data$at),
        data$limits[data$limits$near & data$limits$kind == kind, ], linetype = "dashed",
        colour = limit_colours[[kind]]
      )
    }) +
    ggplot2::geom_vline(xintercept = data$length, colour = ending_colours[[data$ending]]) +
    # A line of one step would be invisible.
    (if (data$length == 1L) {
      ggplot2::geom_point(place, values[values$kind != "choice", ], na.rm = TRUE)
    } else {
      list(
        ggplot2::geom_line(place, of_kind("line"), na.rm = TRUE),
        ggplot2::geom_step(place, of_kind("stairs"), na.rm = TRUE)
      )
    }) +
    choice_layers(of_kind("choice"), data$choices) +
    # The numbers of an action share a panel and have a key. All other lines have the same colour.
    ggplot2::scale_colour_manual(
      name = NULL, breaks = named,
      values = c(stats::setNames(gym_colours[["blue"]], ""), named_colours(named)),
      guide = if (length(named)) rows_of_key(named) else "none"
    ) +
    ggplot2::facet_wrap(
      ggplot2::vars(.data$panel), scales = "free_y", ncol = columns,
      labeller = ggplot2::as_labeller(data$titles, wrapped_strips())
    ) +
    ggplot2::scale_x_continuous(breaks = few_breaks) +
    ggplot2::scale_y_continuous(
      breaks = trajectory_breaks(values), guide = ggplot2::guide_axis(check.overlap = TRUE)
    ) +
    picture_labels(env_text(x), c(policy_subtitle(x), data$subtitle), x = "steps taken", y = NULL) +
    theme_gym_panels() +
    # If the last panel is alone in its row, put the title of the axis below it.
    ggplot2::theme(
      axis.title.x = ggplot2::element_text(hjust = if (panels %% columns) 0.25 else 0.5)
    )
}

limit_colours <- c(failure = gym_colours[["brown"]], goal = gym_colours[["green"]])
ending_colours <- c(terminated = gym_colours[["brown"]], truncated = "grey50")

# Draws discrete actions: a bar for each step, in the action's place and colour. Actions that never
# occur have a place, too.
choice_layers <- function(values, choices) {
  if (is.null(choices)) {
    return(NULL)
  }
  number <- as.character(choices$value)
  labels <- ifelse(choices$label == number, number, paste0(number, ": ", choices$label))
  values$choice <- factor(labels[match(values$value, choices$value)], labels)
  ends <- data.frame(
    time = 0, value = range(choices$value) + c(-0.5, 0.5), panel = values$panel[[1L]]
  )
  list(
    ggplot2::geom_tile(
      ggplot2::aes(.data$time + 0.5, .data$value, fill = .data$choice), values, width = 1,
      height = 0.8
    ),
    ggplot2::geom_blank(ggplot2::aes(.data$time, .data$value), ends),
    ggplot2::scale_fill_manual(
      name = NULL, values = named_colours(labels), limits = labels, guide = rows_of_key(labels)
    )
  )
}

# If a value is constant, its axis has one mark, at this value. ggplot2 passes only the limits of
# the panel, which are 0.05 below and above the constant.
trajectory_breaks <- function(values) {
  shown <- values[values$kind != "choice" & is.finite(values$value), ]
  each <- split(shown$value, shown$panel)
  constants <- unlist(lapply(each, function(value) if (length(unique(value)) == 1L) value[[1L]]))
  function(limits) {
    middle <- mean(limits)
    own <- constants[abs(constants - middle) <= 1e-9 * max(1, abs(middle))]
    if (length(own) && diff(limits) < 0.11) own[[1L]] else few_breaks(limits, 4)
  }
}

most_panels <- 8L
# Each number of an action needs a colour.
most_actions <- length(series_colours)

#' Compute the data of a trajectory
#' @param variables Names of columns, `NULL` for the observation's first.
#' @return A list: `values` (data frame: `panel`, a factor of their labels; `kind` of the panel,
#'   `"line"`, `"stairs"` for whole numbers, or `"choice"` for discrete actions; `name`, the column;
#'   `part`, a factor of the names of an action's numbers, `""` where there are not several; `step`;
#'   `time`, the number of steps before; `value`), `limits` (data frame: `panel`, `at`, `kind`,
#'   `text`, and `near`, whether the values come near), `titles` (of the panels, named by them),
#'   `choices` (data frame `value`, `label`, of discrete actions, otherwise `NULL`), `length` and
#'   `ending`, `"terminated"` or `"truncated"`, `subtitle`.
#' @noRd
trajectory_plot_data <- function(x, episode = 1, variables = NULL, candidate = 1,
                                 call = rlang::caller_env()) {
  row <- episode_row(x, episode, candidate, call)
  if (is.null(x$steps)) {
    abort_wrong("x", x, call, "This rollout was played without its steps being kept.",
                i = "`rollout(..., steps = TRUE)` keeps them in a table.")
  }
  own <- x$episodes[row, ]
  ending <- if (own$terminated) "terminated" else "truncated"
  in_own <- x$steps$episode == episode & (x$steps$candidate %||% candidate) == candidate
  steps <- x$steps[in_own, ]
  shown <- trajectory_columns(steps, variables, call)
  values <- as.list(steps)[c(shown$observed, shown$actions)]
  choices <- action_choices(x, values[shown$actions])
  labels <- c(
    observation_labels(described_id(x), shown$observed),
    rep(action_title(described_id(x, "Action"), shown$actions), length(shown$actions))
  )
  kinds <- vapply(values, function(value) if (all_whole(value)) "stairs" else "line", "")
  kinds[shown$actions] <- if (!is.null(choices)) "choice" else kinds[shown$actions]
  kind <- unname(kinds)[match(labels, labels)]
  # The numbers of an action are told apart by their colours.
  parts <- rep("", length(values))
  if (length(shown$actions) > 1L) {
    parts[names(values) %in% shown$actions] <- action_parts(x$env_id, length(shown$actions))
  }
  limits <- trajectory_limits(described_id(x), values[shown$observed], labels)
  ends <- limits$text[match(unique(labels), limits$panel)]
  n <- nrow(steps)
  list(
    values = data.frame(
      panel = factor(rep(labels, each = n), unique(labels)), kind = rep(kind, each = n),
      name = rep(names(values), each = n),
      part = factor(rep(parts, each = n), unique(c("", parts))), step = steps$step,
      time = steps$step - 1L, value = as.numeric(unlist(lapply(values, as.numeric)))
    ),
    limits = limits,
    # The titles have the values at which episodes end.
    titles = stats::setNames(
      paste0(unique(labels), ifelse(is.na(ends), "", paste0(", ", ends))), unique(labels)
    ),
    choices = choices, length = n, ending = ending,
    subtitle = paste0(
      if (!is.null(own$candidate)) paste0("candidate ", own$candidate, ", "), "episode ",
      own$episode, ": return ", number_text(own$return), ", ", ending, " after ",
      count_of(own$length, "step")
    )
  )
}

# The row of an episode in the table of episodes. Each candidate's episodes are numbered from 1.
episode_row <- function(x, episode, candidate, call) {
  candidates <- x$episodes$candidate %||% rep(1L, nrow(x$episodes))
  check_count(candidate, max = max(candidates, 1L), call = call)
  own <- which(candidates == candidate)
  check_count(episode, max = length(own), call = call)
  own[[episode]]
}

#' Choose the columns to show
#' @return A list: `observed` and `actions`, names of columns.
#' @noRd
trajectory_columns <- function(steps, variables, call) {
  names <- names(steps)
  numbers <- vapply(steps, function(column) is.numeric(column) || is.logical(column), NA)
  is_action <- grepl("^action(_|$)", names)
  actions <- names[is_action & numbers]
  possible <- setdiff(names[!is_action & numbers], c("candidate", "episode", "step"))
  if (is.null(variables)) {
    possible <- setdiff(possible, c("reward", "terminated", "truncated"))
    possible <- possible[!startsWith(possible, "next_")]
    observed <- first_few(possible, most_panels, "numbers of the observation", "variables")
  } else {
    unknown <- setdiff(variables, possible)
    if (!is.character(variables) || length(unknown)) {
      few <- paste0("\"", utils::head(possible, 10L), "\"", collapse = ", ")
      more <- if (length(possible) > 10L) ", ..."
      must <- paste0("names of columns of the steps (", few, more, ")")
      abort_argument(variables, must, "variables", call)
    }
    observed <- unique(variables)
  }
  list(observed = observed, actions = first_few(actions, most_actions, "numbers of the action"))
}

first_few <- function(names, most, what, argument = NULL) {
  if (length(names) <= most) {
    return(names)
  }
  rlang::inform(
    c(paste0("Showing the first ", most, " of ", length(names), " ", what, "."),
      i = if (!is.null(argument)) paste0("`", argument, " = ` chooses others.")),
    class = "gym_message_variables"
  )
  names[seq_len(most)]
}

# Actions ---------------------------------------------------------------------------

# The possible actions, if they are few whole numbers, named as in the environment's documentation.
# NULL for other actions.
action_choices <- function(x, actions) {
  value <- if (length(actions) == 1L) as.numeric(actions[[1L]])
  if (is.null(value) || !all_whole(value)) {
    return(NULL)
  }
  # A function has no action space.
  space <- if (!is.function(x$policy)) x$policy$action_space
  meaning <- action_meaning(x$env_id, space$n)
  possible <- (space$start %||% 0L) + seq_along(meaning) - 1L
  if (length(meaning) > 1L && all(value %in% possible)) {
    data.frame(value = possible, label = meaning)
  } else if (diff(range(value)) < most_choices) {
    value <- seq(min(value), max(value))
    data.frame(value = value, label = as.character(value))
  }
}

most_choices <- 10L

all_whole <- function(value) all(is.finite(value)) && all(value == round(value))

action_title <- function(env_id, names) {
  if (length(names) != 1L) {
    return("actions"[length(names) > 0L])
  }
  part <- action_meaning(env_id, 1L)
  if (is.null(part)) {
    return("action")
  }
  unit <- action_units[[environment_family(env_id), exact = TRUE]]
  paste0("action: ", part, if (!is.null(unit)) paste0(" (", unit, ")"))
}

# Limits -----------------------------------------------------------------------------

trajectory_limits <- function(env_id, observed, labels) {
  limits <- episode_limits[[environment_family(env_id), exact = TRUE]]
  rows <- lapply(which(names(observed) %in% names(limits)), function(i) {
    limit <- limits[[names(observed)[[i]]]]
    data.frame(panel = labels[[i]], limit, near = is_near(limit$at, observed[[i]]))
  })
  none <- data.frame(
    panel = character(), at = numeric(), kind = character(), text = character(), near = logical()
  )
  limits <- do.call(rbind, c(list(none), rows))
  limits$panel <- factor(limits$panel, unique(labels))
  limits
}

# A limit that is far away would flatten the values. They must keep at least about a tenth of the
# height.
is_near <- function(at, value) {
  value <- value[is.finite(value)]
  if (!length(value)) {
    return(logical(length(at)))
  }
  seen <- range(value)
  at >= seen[[1L]] - 5 * diff(seen) & at <= seen[[2L]] + 5 * diff(seen)
}
