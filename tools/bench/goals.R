# The goals of the benchmark.

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
  do.call(rbind, as.list(c(
    if ("single" %in% parts) single_goals(rows),
    if ("vector" %in% parts) vector_goals(rows),
    if ("r_env" %in% parts) r_env_goals(rows),
    if ("search" %in% parts) search_goals(rows),
    if ("env_rollouts" %in% parts) rollout_goals(rows),
    if ("candidates" %in% parts) list(candidates_goal(rows)),
    if ("beside" %in% parts) beside_goals(rows),
    if ("wire" %in% parts) wire_goals(rows),
    if ("stream" %in% parts) stream_goals(rows),
    if ("gradients" %in% parts) gradient_goals(rows),
    if ("tables" %in% parts) table_goals(rows),
    if ("data" %in% parts) data_goals(rows),
    if ("memory" %in% parts) memory_goals(rows)
  )))
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

# Whole episodes ----------------------------------------------------------------------

# For each turn, the ratio of its steps a second to those of another contender.
rollout_ratios <- function(rows, env_id, other, part = "env_rollouts") {
  values_of(rows, part, rollout_names[["gym"]], env_id = env_id) / other
}

rollout_goals <- function(rows) {
  played <- tasks[intersect(names(tasks), rows$env_id[rows$part == "env_rollouts"])]
  c(
    lapply(played, function(task) {
      other <- values_of(rows, "env_rollouts", "Python", env_id = task$env_id)
      goal(sprintf("rollout() of %s: at least %s of Python's own loop", task$env_id, task$goal),
           stats::median(rollout_ratios(rows, task$env_id, other)), at_least = task$goal)
    }),
    lapply(Filter(function(task) task$reticulate, played), function(task) {
      wanted <- if (task$stack) 1 else 2.2
      goal(sprintf("rollout() of %s: at least %s times reticulate (the faster NumPy)", task$env_id,
                   wanted),
           stats::median(rollout_ratios(rows, task$env_id, faster_reticulate(rows, task$env_id))),
           at_least = wanted)
    })
  )
}

# Steps a second with the NumPy that is faster over all turns.
faster_reticulate <- function(rows, env_id) {
  rates <- lapply(reticulates(rows), function(name) {
    values_of(rows, "env_rollouts", name, env_id = env_id)
  })
  rates[[which.max(vapply(rates, stats::median, 0))]]
}

candidates_goal <- function(rows) {
  other <- values_of(rows, "candidates", "Python")
  goal("32 episodes of 16 candidates, LunarLander-v3: at least 1.2 of Python's own loop",
       stats::median(rollout_ratios(rows, NULL, other, "candidates")), at_least = 1.2)
}

beside_goals <- function(rows) {
  median_of <- function(name) stats::median(values_of(rows, "beside", rollout_names[[name]]))
  through <- values_of(rows, "beside", rollout_names[["network"]]) /
    values_of(rows, "beside", rollout_names[["gym"]])
  goals <- list(
    goal("search_random(), 50 rounds of CartPole, none solved: at most 40 ms",
         1000 * median_of("search"), at_most = 40),
    goal("4,096 episodes of CartPole-v1 that balance: at least 5 million steps a second",
         median_of("balancing"), at_least = 5e6),
    goal("256 episodes of LunarLander through a network of 20 ms: at most 1.1 times as long",
         stats::median(through), at_most = 1.1),
    goal("private MB of server and processes after LunarLander rollouts, above an idle server",
         median_of("memory"), at_most = 80)
  )
  if (any(rows$contender == rollout_names[["preset"]])) {
    goals <- c(goals, list(
      goal("LunarLander's preset to its target, seed 1001: within 45 s", median_of("preset"),
           at_most = 45)
    ))
  }
  goals
}

# The step ---------------------------------------------------------------------------

# The median over the turns of the ratio of their times.
step_ratio <- function(rows, name, num_envs, other, other_envs = num_envs) {
  took <- function(name, num_envs) values_of(rows, "wire", wire_names[[name]], num_envs)
  stats::median(took(name, num_envs) / took(other, other_envs))
}

wire_goals <- function(rows) {
  c(
    list(goal("env$step(): at most 1.3 times a bare handle that parses and checks the same bytes",
              step_ratio(rows, "gym", 0, "parsed"), at_most = 1.3)),
    lapply(c(32, 1024, 8192), function(num_envs) {
      goal(sprintf("env$step() of %.0f sub-environments: at most 1.35 times a bare handle",
                   num_envs),
           step_ratio(rows, "gym", num_envs, "bare"), at_most = 1.35)
    }),
    list(
      goal("a bare handle, 32 sub-environments: at most 1.4 times a single environment",
           step_ratio(rows, "bare", 32, "bare", 0), at_most = 1.4)
    )
  )
}

# Memory -----------------------------------------------------------------------------

# A process has grown if it needs more than this many additional MB.
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

# Gradients --------------------------------------------------------------------------

# A training that failed counts as infinitely long. The medians of both are compared.
gradient_goals <- function(rows) {
  gradients <- rows[rows$part == "gradients", ]
  kinds <- unique(gradients[c("env_id", "unit")])
  lapply(seq_len(nrow(kinds)), function(i) {
    took <- lapply(gradient_names, function(name) {
      values_of(rows, "gradients", name, unit = kinds$unit[[i]], env_id = kinds$env_id[[i]])
    })
    if (kinds$unit[[i]] == "s") {
      goal(paste0("PPO, ", kinds$env_id[[i]], ": time to the target, at most 0.6 of ",
                  "Stable-Baselines3"),
           stats::median(took$gym) / stats::median(took$sb3), at_most = 0.6)
    } else {
      at_most <- if (endsWith(kinds$env_id[[i]], reference)) 0.8 else 0.5
      goal(paste0("PPO, ", kinds$env_id[[i]], ": time of a step, at most ", at_most, " of ",
                  "Stable-Baselines3"),
           stats::median(took$gym / took$sb3), at_most = at_most)
    }
  })
}
