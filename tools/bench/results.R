# The data that the bench makes, and its summary.

# One value that was measured: a row of the data.
measured <- function(part, num_envs, contender, called, turn, value, unit,
                     env_id = "CartPole-v1") {
  data.frame(
    part = part, env_id = env_id, num_envs = num_envs, contender = contender, called = called,
    turn = turn, value = value, unit = unit
  )
}

# The data file: comments about the run, then a table.
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

values_of <- function(rows, part, contender, num_envs = 0, unit = NULL, env_id = NULL) {
  found <- rows[rows$part == part & rows$contender == contender & rows$num_envs == num_envs, ]
  if (!is.null(unit)) found <- found[found$unit == unit, ]
  if (!is.null(env_id)) found <- found[found$env_id == env_id, ]
  found$value[order(found$turn)]
}

# For each turn, how many times better the first is. A value that was measured once counts for all
# turns.
ratios <- function(gym, other, unit) {
  if (unit %in% c("s", "microseconds")) other / gym else gym / other
}

own <- c(
  single = "gym, env$step()", vector = "gym, env$step()", search = "gym, search_random()",
  env_rollouts = "gym, rollout()", candidates = "gym, rollout()", wire = "gym, env$step()",
  gradients = "gym, learn_ppo()", tables = "gym, learn_q()", data = "gym, learn_q(data)",
  stream = "gym, this build"
)

# One row for each contender and number of sub-environments.
summarise <- function(rows) {
  what <- rows[c("part", "env_id", "num_envs", "contender", "unit")]
  keys <- what[!duplicated(what), ]
  keys <- keys[order(match(keys$part, unique(keys$part)),
                     match(keys$env_id, unique(keys$env_id)), keys$num_envs), ]
  do.call(rbind, lapply(seq_len(nrow(keys)), function(i) {
    key <- keys[i, ]
    values <- values_of(rows, key$part, key$contender, key$num_envs, key$unit, key$env_id)
    reference <- own[key$part]
    ratio <- NA
    if (!is.na(reference) && reference != key$contender && key$unit != "steps") {
      gym <- values_of(rows, key$part, reference, key$num_envs, key$unit, key$env_id)
      # If both failed, there is no ratio.
      ratio <- stats::median(ratios(gym, values, key$unit), na.rm = TRUE)
    }
    called <- rows$called[rows$part == key$part & rows$contender == key$contender &
                            rows$env_id == key$env_id & rows$num_envs == key$num_envs &
                            rows$unit == key$unit][1L]
    data.frame(
      key, called = called, median = stats::median(values), low = min(values),
      high = max(values), turns = length(values), ratio = ratio, row.names = NULL
    )
  }))
}
