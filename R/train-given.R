# Functions that compare results take them as arguments. Here each result gets a name.

#' Take the arguments of the calling function, each result with a name
#'
#' The picture shows each result under the name of its argument, of its variable, or under a label
#' of its own. Other arguments need a name.
#' @param first The function's first argument, a symbol. It is missing if the user has named the
#'   first result, as its row or line in the picture.
#' @noRd
arguments_as_written <- function(first, frame = rlang::caller_env(), call = frame) {
  listed <- as.call(c(quote(list), if (!eval(call("missing", first), frame)) first, quote(...)))
  values <- eval(listed, frame)
  if (!any(vapply(values, is_comparable, NA))) {
    return(values)
  }
  written <- as.list(eval(call("substitute", listed), frame))[-1L]
  for (value in values[!nzchar(rlang::names2(values))]) {
    if (!inherits(value, c("gym_rollout", "gym_training", "gym_trainings"))) {
      must <- "a result like the others, or have a name, such as `type = `"
      abort_argument(value, must, "...", call)
    }
  }
  name_results(values, written)
}

# A result without a name gets that of its variable, or a label of its own.
name_results <- function(values, written) {
  names <- rlang::names2(values)
  for (i in which(!nzchar(names))) {
    names[[i]] <- attr(values[[i]], "label") %||%
      if (is.name(written[[i]])) as.character(written[[i]]) else result_label(values[[i]])
  }
  stats::setNames(values, names)
}

is_comparable <- function(x) {
  inherits(x, c("gym_rollout", "gym_training", "gym_trainings")) && !inherits(x, "gym_search")
}

result_label <- function(x) {
  if (inherits(x, "gym_rollout")) {
    policy_label(x$policy)
  } else if (rlang::is_string(x)) {
    tools::file_path_sans_ext(basename(x))
  } else if (inherits(x, c("gym_training", "gym_trainings"))) {
    training_label(x)
  } else {
    ""
  }
}

training_label <- function(x) sub(":.*", "", format(x$agent))

#' Return the results among the arguments of a picture, and refuse all other arguments
#' @param unique Make the names in each environment different? (Each environment has its own panel.)
#' @return The results, a list with names.
#' @noRd
only_results <- function(values, class, call = rlang::caller_env(), unique = TRUE) {
  are <- vapply(values, inherits, NA, class)
  rlang::exec(check_dots_empty, !!!values[!are], call = call)
  values <- values[are]
  if (unique) {
    ids <- vapply(values, function(x) x$env_id %||% "", "")
    names(values) <- stats::ave(rlang::names2(values), ids, FUN = function(x) make.unique(x, " "))
  }
  values
}

given_trainings <- function(values, call = rlang::caller_env(), unique = TRUE) {
  abort_if(
    any(vapply(values, inherits, NA, "gym_search")), "...", NULL, call,
    "A search by `search_random()` has no evaluations to compare with those of a
     training.",
    i = "`train_agent(agent_random(), ...)` makes a training that has them."
  )
  only_results(values, c("gym_training", "gym_trainings"), call, unique)
}

# The training of each seed.
each_training <- function(x) if (inherits(x, "gym_trainings")) unname(x$trainings) else list(x)

# Different rules ----------------------------------------------------------------------

# Differences that make a comparison of trainings unfair: targets, budgets, environments or rules of
# evaluation.

# These arguments of train_agent() are compared, in addition to the target.
kept_rules <- c("iterations", "total_steps", "max_steps", "eval_every", "eval_episodes",
                "eval_episodes_curve", "evaluate")

#' Name the differences between trainings in one environment
#' @param trainings A list of trainings, or of trainings with many seeds, with names.
#' @return A string for each kind of difference, such as `"targets differ: A: 475; B: 490"`. With
#'   several environments it names the environment: `"targets differ in CartPole-v1: ..."`.
#' @noRd
unequal_rules <- function(trainings) {
  by_env <- split(trainings, vapply(trainings, function(x) x$env_id, ""))
  unlist(lapply(names(by_env), function(id) {
    those <- by_env[[id]]
    where <- if (length(by_env) > 1L) paste(" in", id)
    unequal <- function(what, names) unequal_text(paste0(what, " differ", where), rules, names)
    rules <- lapply(those, function(x) {
      one <- each_training(x)[[1L]]
      kwargs <- vapply(one$kwargs, describe_value, "")
      wrappers <- one$provenance$wrappers
      c(
        list(
          target = one$target %||% Inf,
          arguments = if (length(kwargs)) toString(paste(names(kwargs), "=", kwargs)),
          wrappers = if (length(wrappers)) toString(wrappers)
        ),
        one$rules
      )
    })
    c(
      unequal("targets", "target"),
      unequal("budgets", c("total_steps", "iterations")),
      unequal("environments", c("arguments", "wrappers")),
      unequal("rules of evaluation", kept_rules[-(1:2)])
    )
  }))
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
