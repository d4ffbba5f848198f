# The data that the bench makes, its summary, and the goals that it is held against.

# One value that was measured: a row of the data.
measured <- function(part, num_envs, contender, called, turn, value, unit) {
  data.frame(
    part = part, num_envs = num_envs, contender = contender, called = called, turn = turn,
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

values_of <- function(rows, part, contender, num_envs = 0, unit = NULL) {
  found <- rows[rows$part == part & rows$contender == contender & rows$num_envs == num_envs, ]
  if (!is.null(unit)) found <- found[found$unit == unit, ]
  found$value[order(found$turn)]
}

# Turn by turn, what is better by how many times; what was measured once stands for each turn.
ratios <- function(gym, other, unit) {
  if (unit == "s") other / gym else gym / other
}

own <- c(single = "gym, env$step()", vector = "gym, env$step()", search = "gym, search_random()")

# One row for each contender and number of sub-environments.
summarise <- function(rows) {
  what <- rows[c("part", "num_envs", "contender", "unit")]
  keys <- what[!duplicated(what), ]
  keys <- keys[order(match(keys$part, unique(keys$part)), keys$num_envs), ]
  do.call(rbind, lapply(seq_len(nrow(keys)), function(i) {
    key <- keys[i, ]
    values <- values_of(rows, key$part, key$contender, key$num_envs, key$unit)
    reference <- own[key$part]
    ratio <- NA
    if (!is.na(reference) && reference != key$contender && key$unit != "steps") {
      gym <- values_of(rows, key$part, reference, key$num_envs, key$unit)
      ratio <- stats::median(ratios(gym, values, key$unit))
    }
    called <- rows$called[rows$part == key$part & rows$contender == key$contender &
                            rows$num_envs == key$num_envs][1L]
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

times <- function(rows, other, num_envs = 0, part = if (num_envs) "vector" else "single",
                  other_part = part) {
  gym <- values_of(rows, part, own[[part]], num_envs)
  num_envs <- if (other_part == "vector") num_envs else 0
  stats::median(gym / values_of(rows, other_part, other, num_envs))
}

check_goals <- function(rows) {
  parts <- unique(rows$part)
  do.call(rbind, c(
    if ("single" %in% parts) single_goals(rows),
    if ("vector" %in% parts) vector_goals(rows),
    if ("r_env" %in% parts) r_env_goals(rows),
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

vector_goals <- function(rows) {
  sizes <- sort(unique(rows$num_envs[rows$part == "vector"]))
  against <- lapply(reticulates(rows), function(name) {
    lapply(sizes[sizes >= 32], function(num_envs) {
      wanted <- if (num_envs == 1024) 1.5 else 1
      goal(sprintf("%.0f sub-environments: at least %s times %s", num_envs, wanted, name),
           times(rows, name, num_envs), at_least = wanted)
    })
  })
  c(
    unlist(against, recursive = FALSE),
    if (8192 %in% sizes) {
      list(goal("8192 sub-environments: at least 0.4 of Python in process",
                times(rows, "Python", 8192), at_least = 0.4))
    },
    if (1024 %in% sizes && "single" %in% rows$part) {
      list(goal("1024 sub-environments: at least 8 times Python's loop over one environment",
                times(rows, "Python", 1024, other_part = "single"), at_least = 8))
    }
  )
}

r_env_goals <- function(rows) {
  steps <- values_of(rows, "r_env", r_env_names[["vectorized"]], 256)
  list(goal("a vectorised environment in R: at least 100,000 steps a second",
            stats::median(steps), at_least = 1e5))
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
  many <- rows$value[rows$contender == "server for 8192 sub-environments"]
  list(
    grown("R's objects"), grown("R"), grown("server"),
    goal("an instance of 8192 sub-environments: at most 100 MB of the server", many, at_most = 100)
  )
}
