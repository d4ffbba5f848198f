# Differences that make a comparison of trainings unfair: targets, budgets, environments or rules of
# evaluation.

# The arguments that a training keeps for this, in addition to the target.
kept_rules <- c("iterations", "total_steps", "max_steps", "eval_every", "eval_episodes",
                "eval_episodes_curve", "evaluate")

#' Name the differences between trainings in one environment
#' @param trainings A list of trainings, or of trainings with many seeds, with names.
#' @return A string for each kind of difference, such as `"targets differ: A: 475; B: 490"`. With
#'   several environments it names the one, as in `"targets differ in CartPole-v1: ..."`.
#' @noRd
unequal_rules <- function(trainings) {
  by_env <- split(trainings, vapply(trainings, function(x) x$env_id, ""))
  unlist(lapply(names(by_env), function(id) {
    those <- by_env[[id]]
    where <- if (length(by_env) > 1L) paste(" in", id)
    unequal <- function(what, names) unequal_text(paste0(what, " differ", where), rules, names)
    rules <- lapply(those, function(x) {
      one <- each_training(x)[[1L]]
      c(list(target = one$target %||% Inf), one$rules, environment_settings(one))
    })
    c(
      unequal("targets", "target"),
      unequal("budgets", c("total_steps", "iterations")),
      unequal("environments", c("arguments", "wrappers")),
      unequal("rules of evaluation", kept_rules[-(1:2)])
    )
  }))
}

# What `env_id` does not say of a training's environment, strings.
environment_settings <- function(one) {
  kwargs <- one$kwargs
  values <- vapply(kwargs, describe_value, "")
  list(
    arguments = if (length(kwargs)) toString(paste(names(kwargs), "=", values)),
    wrappers = if (length(one$provenance$wrappers)) toString(one$provenance$wrappers)
  )
}

# `NULL` if all trainings have the same rules.
unequal_text <- function(what, rules, names) {
  value <- function(of_one, name) {
    value <- of_one[[name]]
    if (is.null(value)) {
      return(paste("no", name))
    }
    text <- if (is.numeric(value)) marked_text(value, scientific = FALSE) else value
    if (name == "target") text else paste(name, text)
  }
  differ <- Filter(function(name) {
    length(unique(vapply(rules, value, "", name))) > 1L
  }, names)
  if (length(differ)) {
    texts <- vapply(rules, function(of_one) {
      toString(vapply(differ, value, "", of_one = of_one))
    }, "")
    paste0(what, ": ", paste0(names(rules), ": ", texts, collapse = "; "))
  }
}
