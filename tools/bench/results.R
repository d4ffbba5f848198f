# The data that the bench makes, its summary, and the goals that it is held against.

# One value that was measured: a row of the data.
measured <- function(part, lanes, contender, called, turn, value, unit) {
  data.frame(
    part = part, lanes = lanes, contender = contender, called = called, turn = turn,
    value = value, unit = unit
  )
}

# The data file: a table, before it what is known of the run as comments.
write_results <- function(rows, run, file) {
  con <- file(file, "w", encoding = "UTF-8")
  on.exit(close(con))
  writeLines(paste0("# ", names(run), ": ", run), con)
  rows$value <- signif(rows$value, 6L)
  utils::write.csv(rows, con, row.names = FALSE)
}

read_results <- function(file) {
  lines <- readLines(file, encoding = "UTF-8")
  comments <- sub("^# ", "", grep("^# ", lines, value = TRUE))
  list(
    rows = utils::read.csv(text = lines, comment.char = "#"),
    run = stats::setNames(sub("^[^:]*: ", "", comments), sub(":.*", "", comments))
  )
}

values_of <- function(rows, part, contender, lanes = 0, unit = NULL) {
  found <- rows[rows$part == part & rows$contender == contender & rows$lanes == lanes, ]
  if (!is.null(unit)) found <- found[found$unit == unit, ]
  found$value[order(found$turn)]
}

# Turn by turn, what is better by how many times; what was measured once stands for each turn.
ratios <- function(gym, other, unit) {
  if (unit == "s") other / gym else gym / other
}

own <- c(single = "gym, env$step()", lanes = "gym, env$step()", search = "gym, search_random()")

# One row for each contender and number of lanes.
summarise <- function(rows) {
  what <- rows[c("part", "lanes", "contender", "unit")]
  keys <- what[!duplicated(what), ]
  keys <- keys[order(match(keys$part, unique(keys$part)), keys$lanes), ]
  do.call(rbind, lapply(seq_len(nrow(keys)), function(i) {
    key <- keys[i, ]
    values <- values_of(rows, key$part, key$contender, key$lanes, key$unit)
    reference <- own[key$part]
    ratio <- NA
    if (!is.na(reference) && reference != key$contender && key$unit != "steps") {
      gym <- values_of(rows, key$part, reference, key$lanes, key$unit)
      ratio <- stats::median(ratios(gym, values, key$unit))
    }
    called <- rows$called[rows$part == key$part & rows$contender == key$contender &
                            rows$lanes == key$lanes][1L]
    data.frame(
      key, called = called, median = stats::median(values), low = min(values),
      high = max(values), turns = length(values), ratio = ratio, row.names = NULL
    )
  }))
}

# The goals ----------------------------------------------------------------------

goal <- function(text, value, at_least = NULL, at_most = NULL, digits = 3) {
  data.frame(
    goal = text, measured = signif(value, digits),
    reached = if (is.null(at_most)) value >= at_least else value <= at_most
  )
}

times <- function(rows, other, lanes = 0, part = if (lanes) "lanes" else "single",
                  other_part = part) {
  gym <- values_of(rows, part, own[[part]], lanes)
  stats::median(gym / values_of(rows, other_part, other, if (other_part == "lanes") lanes else 0))
}

check_goals <- function(rows) {
  parts <- unique(rows$part)
  do.call(rbind, c(
    if ("single" %in% parts) single_goals(rows),
    if ("lanes" %in% parts) lanes_goals(rows),
    if ("search" %in% parts) search_goals(rows),
    if ("memory" %in% parts) memory_goals(rows)
  ))
}

reticulates <- function(rows) {
  unique(grep("^reticulate, NumPy [0-9]+$", rows$contender, value = TRUE))
}

single_goals <- function(rows) {
  c(
    lapply(reticulates(rows), function(name) {
      goal(paste0("single steps: at least 1 times ", name, ", env$step() (stretch: 1.5)"),
           times(rows, name), at_least = 1)
    }),
    list(goal("single steps: at least 20 times the classic pattern",
              times(rows, "classic pattern"), at_least = 20))
  )
}

lanes_goals <- function(rows) {
  sizes <- sort(unique(rows$lanes[rows$part == "lanes"]))
  against <- lapply(reticulates(rows), function(name) {
    lapply(sizes[sizes >= 32], function(lanes) {
      wanted <- if (lanes == 1024) 1.5 else 1
      goal(sprintf("%.0f lanes: at least %s times %s", lanes, wanted, name),
           times(rows, name, lanes), at_least = wanted)
    })
  })
  c(
    unlist(against, recursive = FALSE),
    if (8192 %in% sizes) {
      list(goal("8192 lanes: at least 0.4 of Python in process",
                times(rows, "Python", 8192), at_least = 0.4))
    },
    if (1024 %in% sizes && "single" %in% rows$part) {
      list(goal("1024 lanes: at least 8 times Python's loop over one environment",
                times(rows, "Python", 1024, other_part = "single"), at_least = 8))
    }
  )
}

search_goals <- function(rows) {
  gym <- values_of(rows, "search", own[["search"]], unit = "s")
  classic <- values_of(rows, "search", "the tutorial's way", unit = "s")
  list(
    goal("random search: at least 100 times faster than the tutorial's way",
         stats::median(classic / gym), at_least = 100),
    goal("search in a fresh R session, server's start included: within 3 s",
         stats::median(values_of(rows, "fresh", own[["search"]])), at_most = 3)
  )
}

# Beyond this many MB a process counts as grown.
noise <- 5

memory_goals <- function(rows) {
  grown <- function(which) {
    sizes <- rows[rows$part == "memory" & startsWith(rows$contender, paste(which, "after")), ]
    goal(paste0(which, ": MB more after the last env step than after 10,000, at most ", noise),
         sizes$value[nrow(sizes)] - sizes$value[1L], at_most = noise, digits = 2)
  }
  many <- rows$value[rows$contender == "server for 8192 lanes"]
  list(
    grown("R's objects"), grown("R"), grown("server"),
    goal("an instance of 8192 lanes: at most 100 MB of the server", many, at_most = 100)
  )
}
