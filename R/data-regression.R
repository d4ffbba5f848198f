# Regressions of the value of an action in a state: a table of means, a linear model, or any other
# model that R can fit and predict with.
#
# Each is a list of functions. `block(states)` prepares states once, so that values of all actions
# can be computed many times; `fit(block, action, target, weight)` returns a fit; `values(fit,
# block)` returns a matrix with a row for each state and a column for each action. `fixed(...)`, if
# there is one, solves the equations of a policy's values at once.

#' Choose the regression
#'
#' @param formula,model The user's arguments, see [learn_fitted_q()].
#' @return A list with the functions above, and `label`.
#' @noRd
regression_of <- function(steps, formula, model, call) {
  if (!is.null(formula) && !inherits(formula, "formula")) {
    abort_argument(formula, "a formula of `action` and the state, or NULL", "formula", call)
  }
  if (!is.null(model) && !is.function(model)) {
    abort_argument(model, "a function of a formula and data, such as `lm`", "model", call)
  }
  if (is.null(formula) && is.null(model) && is_table_like(steps)) {
    return(table_regression(steps))
  }
  linear <- is.null(model) || identical(model, stats::lm)
  formula <- value_formula(formula, steps, linear, call)
  if (linear) linear_regression(formula, steps, call) else any_regression(formula, model, steps)
}

# Few enough states that a table has some steps for each value.
is_table_like <- function(steps) {
  countable <- vapply(steps$state, function(x) is.factor(x) || !is.double(x), NA)
  if (!all(countable)) {
    return(FALSE)
  }
  pairs <- !duplicated(data.frame(steps$state, steps$action))
  length(pairs) >= least_steps_of_pair * sum(pairs)
}
least_steps_of_pair <- 5L

# The response is called `value`. Without a formula a linear model has coefficients of its own for
# each action, and another model gets all columns.
value_formula <- function(formula, steps, linear, call) {
  if (is.null(formula)) {
    columns <- sprintf("`%s`", names(steps$state))
    of_state <- paste(columns, collapse = " + ")
    several <- length(steps$actions) > 1L
    right <- if (!linear) {
      paste(c("action", columns), collapse = " + ")
    } else if (several) {
      paste0("action * (", of_state, ")")
    } else {
      of_state
    }
    return(stats::as.formula(paste("value ~", right), globalenv()))
  }
  right <- formula[[length(formula)]]
  known <- c("action", names(steps$state))
  unknown <- setdiff(all.vars(right), c(known, "."))
  unknown <- unknown[!vapply(unknown, exists, NA, envir = environment(formula))]
  abort_if(
    length(unknown), "formula", formula, call,
    "`formula` has {quoted_names(unknown)}, which the data does not have.",
    i = did_you_mean(unknown[[1L]], known), i = "It has {quoted_names(known)}."
  )
  stats::reformulate(deparse1(right), "value", env = environment(formula))
}

# A table -------------------------------------------------------------------------------

# The fit is a matrix with a row for each state, and `NA` where an action was never taken.
table_regression <- function(steps) {
  states <- sorted_rows(unique(rbind(steps$state, steps$after[steps$known, , drop = FALSE])))
  keys <- row_keys(states)
  many <- length(steps$actions)
  list(
    label = paste0("a table of ", count_of(nrow(states), "state"), " and ",
                   count_of(many, "action")),
    states = states, block = function(states) match(row_keys(states), keys),
    fit = function(block, action, target, weight) {
      cell <- block + nrow(states) * (action - 1L)
      sums <- rowsum(cbind(weight, weight * target), cell, reorder = FALSE)
      fit <- matrix(NA_real_, nrow(states), many)
      used <- sums[, 1L] > 0
      fit[as.integer(rownames(sums))[used]] <- sums[used, 2L] / sums[used, 1L]
      fit
    },
    values = function(fit, block) fit[block, , drop = FALSE],
    fixed = function(here, after, action, reward, go_on, p_next, weight, call) {
      used <- weight > 0
      cell <- (here + nrow(states) * (action - 1L))[used]
      own <- unique(cell)
      from <- match(cell, own)
      sums <- rowsum(cbind(weight, weight * reward)[used, , drop = FALSE], from, reorder = FALSE)
      share <- (weight * go_on * p_next)[used, , drop = FALSE] / sums[from, 1L]
      to <- match(outer(after[used], nrow(states) * (seq_len(many) - 1L), `+`), own)
      some <- which(!is.na(to) & share > 0)
      moves <- flow_matrix(rep(from, many)[some], to[some], share[some], length(own))
      ending <- from[go_on[used] < 1 | rowSums(is.na(to) & share > 0) > 0]
      fit <- matrix(NA_real_, nrow(states), many)
      fit[own] <- chain_values(moves, sums[, 2L] / sums[, 1L], ending, call)
      fit
    }
  )
}

# Texts that are the same for the same state.
row_keys <- function(states) row_texts(states, sep = "\r")

# The values of states that lead to each other like this; episodes may end in `ending`.
chain_values <- function(moves, reward, ending, call) {
  leads <- function(reached) times(moves, reached) > 0
  abort_if(
    !all(closure(leads, seq_along(reward) %in% ending)), "discount", NULL, call,
    "The policy's values are infinite: in the data some of its episodes never end.",
    i = "Give a `discount` below 1, or a `horizon`."
  )
  worth <- chain_solver(moves, call)
  worth(pmax(reward, 0)) - worth(pmax(-reward, 0))
}

# A linear model ------------------------------------------------------------------------

# Least squares by normal equations of scaled columns, which are set up once: only the response
# changes between iterations.
linear_regression <- function(formula, steps, call) {
  labels <- as.character(steps$actions)
  levels <- lapply(Filter(is.factor, steps$state), levels)
  terms <- stats::terms(formula, data = data.frame(steps$state, action = steps$action, value = 0,
                                                   check.names = FALSE))
  design <- function(states, action) {
    states$action <- factor(labels[action], labels)
    if (length(labels) == 1L) states$action <- rep(1, nrow(states))
    frame <- stats::model.frame(stats::delete.response(basis), states, na.action = stats::na.pass,
                                xlev = levels)
    stats::model.matrix(stats::delete.response(basis), frame)
  }
  # Terms such as poly() keep what they learned from the data.
  first <- steps$state
  first$action <- if (length(labels) > 1L) factor(labels[steps$action], labels) else 1
  first$value <- 0
  basis <- tryCatch(
    stats::terms(stats::model.frame(terms, first)),
    error = function(cnd) abort_regression(cnd, call)
  )
  x <- design(steps$state, steps$action)
  decomposed <- qr(x)
  kept <- sort(decomposed$pivot[seq_len(decomposed$rank)])
  size <- sqrt(colSums(x[, kept, drop = FALSE]^2))
  block <- function(states) {
    known <- stats::complete.cases(states)
    lapply(seq_along(labels), function(action) {
      rows <- matrix(0, nrow(states), length(kept))
      some <- states[known, , drop = FALSE]
      own <- design(some, rep(action, nrow(some)))[, kept, drop = FALSE]
      rows[known, ] <- own / rep(size, each = nrow(own))
      rows
    })
  }
  taken <- function(block, action) {
    rows <- block[[1L]]
    for (i in seq_along(block)[-1L]) rows[action == i, ] <- block[[i]][action == i, ]
    rows
  }
  solved <- function(gram, right) {
    tryCatch(solve(gram, right, tol = 1e-18), error = function(cnd) {
      abort_wrong(
        "formula", NULL, call, "The linear model has no solution.",
        i = "Give a `discount` below 1 or a `horizon`, or a `formula` with fewer terms."
      )
    })
  }
  memory <- rlang::env()
  list(
    label = paste("linear,", deparse1(formula[-2L])), block = block,
    coefficients = function(fit) stats::setNames(fit / size, colnames(x)[kept]),
    fit = function(block, action, target, weight) {
      # The rows of the actions taken are the same in every iteration.
      of <- list(block, action, weight)
      if (!identical(memory$of, of)) {
        memory$of <- of
        memory$rows <- taken(block, action)
        memory$gram <- crossprod(memory$rows, weight * memory$rows)
      }
      drop(solved(memory$gram, crossprod(memory$rows, weight * target)))
    },
    values = function(fit, block) {
      matrix(vapply(block, function(rows) drop(rows %*% fit), numeric(nrow(block[[1L]]))),
             nrow(block[[1L]]))
    },
    fixed = function(here, after, action, reward, go_on, p_next, weight, call) {
      rows <- taken(here, action)
      ahead <- Reduce(`+`, lapply(seq_along(after), function(i) after[[i]] * p_next[, i]))
      drop(solved(crossprod(rows, weight * (rows - go_on * ahead)),
                  crossprod(rows, weight * reward)))
    }
  )
}

# Any model -----------------------------------------------------------------------------

any_regression <- function(formula, model, steps) {
  labels <- as.character(steps$actions)
  # Rows of a data frame that are selected twice would get names, which takes long.
  with_action <- function(states, rows, action) {
    states <- list2DF(lapply(states, function(x) x[rows]))
    states$action <- factor(labels[action], labels)
    states
  }
  list(
    label = paste("a model,", deparse1(formula[-2L])),
    block = function(states) list(states = states, known = stats::complete.cases(states)),
    fit = function(block, action, target, weight) {
      # A weight is how often a row was drawn.
      rows <- rep(seq_along(target), round(weight))
      data <- with_action(block$states, rows, action[rows])
      data$value <- target[rows]
      tryCatch(model(formula, data = data), error = function(cnd) abort_regression(cnd, NULL))
    },
    values = function(fit, block) {
      some <- which(block$known)
      values <- matrix(0, length(block$known), length(labels))
      if (length(some)) {
        each <- rep(seq_along(labels), each = length(some))
        asked <- with_action(block$states, rep(some, length(labels)), each)
        values[some, ] <- model_values(fit, asked)
      }
      values
    }
  )
}

model_values <- function(fit, newdata) {
  values <- tryCatch(
    stats::predict(fit, newdata), error = function(cnd) abort_regression(cnd, NULL)
  )
  if (is.list(values)) values <- values$predictions
  values <- as.vector(values)
  abort_if(
    !is.numeric(values) || length(values) != nrow(newdata) || anyNA(values), "model", fit, NULL,
    "The model of class {class(fit)[[1L]]} does not predict a number for each row of data.",
    i = "Wrap it in a function of a formula and data whose result `predict()` knows."
  )
  values
}

abort_regression <- function(cnd, call) {
  gym_abort(
    c("The model of values cannot be fitted, or does not predict.",
      i = if (grepl("new level", conditionMessage(cnd))) {
        "A level is only in few episodes: merge it with another level."
      } else {
        "The formula's terms must be known for every state and action of the data."
      }),
    class = "gym_error_argument", argument = "model", call = call, parent = cnd
  )
}
