# Regressions of the value of an action in a state: a table of means, a linear model, or any other
# model that R can fit and predict with.
#
# Each is a list of functions. `block(states)` prepares states once, because their values are
# computed many times. `rows(states, action)` prepares steps. `fit(rows, target, weight)` returns a
# fit. `values(fit, block)` returns a matrix with a row for each state and a column for each action.
# `fixed(...)`, which not all of them have, solves the equations of a policy's values at once.

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

# Is a table possible? Then its states are few enough that each of its values has some steps.
is_table_like <- function(steps) {
  countable <- vapply(steps$state, function(x) is.factor(x) || !is.double(x), NA)
  if (!all(countable)) {
    return(FALSE)
  }
  pairs <- !duplicated(data.frame(steps$state, steps$action))
  # On average at least five steps for each pair.
  length(pairs) >= 5L * sum(pairs)
}

# The response is named `value`. Without a user's formula, each action has its own coefficients in a
# linear model, and any other model gets all columns.
value_formula <- function(formula, steps, linear, call) {
  if (is.null(formula)) {
    columns <- sprintf("`%s`", names(steps$state))
    of_state <- paste(columns, collapse = " + ")
    right <- if (!linear) {
      paste("action +", of_state)
    } else if (nrow(steps$actions) > 1L) {
      paste0("action * (", of_state, ")")
    } else {
      of_state
    }
    return(stats::as.formula(paste("value ~", right), globalenv()))
  }
  right <- formula[[length(formula)]]
  known <- unique(c("action", names(steps$actions), names(steps$state)))
  unknown <- setdiff(all.vars(right), c(known, "."))
  unknown <- unknown[!vapply(unknown, exists, NA, envir = environment(formula))]
  abort_if(
    length(unknown), "formula", formula, call,
    "`formula` has {quoted_names(unknown)}, which the data does not have.",
    i = did_you_mean(unknown[[1L]], known), i = "It has {quoted_names(known)}."
  )
  stats::reformulate(deparse1(right), "value", env = environment(formula))
}

# The data frame for a formula: states, and an action for each. `action` is a factor, and an action
# of several parts also has a column for each part. (Selecting rows of a data frame twice makes row
# names, which takes long. So this selects from each column.)
with_action <- function(states, action, actions, rows = seq_along(action)) {
  states <- list2DF(lapply(states, function(x) x[rows]))
  if (length(actions) > 1L) {
    states[names(actions)] <- lapply(actions, function(part) {
      if (is.character(part)) part <- factor(part)
      part[action]
    })
  }
  states$action <- structure(action, levels = row_texts(actions), class = "factor")
  states
}

# A table -------------------------------------------------------------------------------

# A fit is a matrix with a row for each state, and `NA` where an action was never taken. The rows of
# steps are places in this matrix.
table_regression <- function(steps) {
  states <- sorted_rows(unique(
    rbind(unique(steps$state), unique(steps$after[steps$known, , drop = FALSE]))
  ))
  keys <- row_keys(states)
  count <- nrow(states)
  many <- nrow(steps$actions)
  block <- function(states) match(row_keys(states), keys)
  list(
    label = paste0("a table of ", count_of(count, "state"), " and ", count_of(many, "action")),
    states = states, block = block,
    rows = function(states, action) block(states) + count * (action - 1L),
    fit = function(rows, target, weight) {
      sums <- rowsum(cbind(weight, weight * target), rows, reorder = FALSE)
      fit <- matrix(NA_real_, count, many)
      used <- sums[, 1L] > 0
      fit[as.integer(rownames(sums))[used]] <- sums[used, 2L] / sums[used, 1L]
      fit
    },
    values = function(fit, block) fit[block, , drop = FALSE],
    fixed = function(rows, after, reward, go_on, p_next, weight, call) {
      used <- weight > 0
      own <- unique(rows[used])
      from <- match(rows[used], own)
      sums <- rowsum(cbind(weight, weight * reward)[used, , drop = FALSE], from, reorder = FALSE)
      share <- (weight * go_on * p_next)[used, , drop = FALSE] / sums[from, 1L]
      to <- match(outer(after[used], count * (seq_len(many) - 1L), `+`), own)
      some <- which(!is.na(to) & share > 0)
      moves <- flow_matrix(rep(from, many)[some], to[some], share[some], length(own))
      ending <- from[go_on[used] < 1 | rowSums(is.na(to) & share > 0) > 0]
      fit <- matrix(NA_real_, count, many)
      fit[own] <- chain_values(moves, sums[, 2L] / sums[, 1L], ending, call)
      fit
    }
  )
}

# A text for each row; equal states have equal texts.
row_keys <- function(states) row_texts(states, sep = "\r")

# The values of states by the probabilities `moves` from each to each; episodes may end in the
# states `ending`.
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

# Least squares by normal equations. They are set up once, because only the response changes between
# iterations. A fit consists of the coefficients.
linear_regression <- function(formula, steps, call) {
  actions <- steps$actions
  many <- nrow(actions)
  # Terms such as poly() keep what they learned from the data.
  first <- with_action(steps$state, steps$action, actions)
  first$value <- 0
  basis <- tryCatch(
    stats::delete.response(stats::terms(stats::model.frame(formula, first))),
    error = function(cnd) abort_regression(cnd, call)
  )
  design <- function(states, action) {
    frame <- with_action(states, action, actions)
    if (many == 1L) frame$action <- 1
    stats::model.matrix(basis, stats::model.frame(basis, frame, na.action = stats::na.pass))
  }
  x <- design(steps$state, steps$action)
  decomposed <- qr(x)
  kept <- sort(decomposed$pivot[seq_len(decomposed$rank)])
  names <- colnames(x)[kept]
  rows <- function(states, action) design(states, action)[, kept, drop = FALSE]
  # Scale all columns to the same size, which loses the fewest digits.
  size <- sqrt(colSums(x[, kept, drop = FALSE]^2))
  square <- function(rows, others) crossprod(rows, others) / outer(size, size)
  memory <- rlang::env()
  list(
    label = paste("linear,", deparse1(formula[-2L])), rows = rows,
    coefficients = function(fit) stats::setNames(fit, names),
    block = function(states) {
      known <- which(stats::complete.cases(states))
      some <- states[known, , drop = FALSE]
      lapply(seq_len(many), function(action) {
        own <- matrix(0, nrow(states), length(kept))
        own[known, ] <- rows(some, rep(action, length(known)))
        own
      })
    },
    fit = function(rows, target, weight) {
      # Rows and weights are the same in every iteration, so factor the equations once.
      of <- list(rows, weight)
      if (!identical(memory$of, of)) {
        memory$of <- of
        memory$qr <- qr(square(rows, weight * rows), tol = 1e-12)
      }
      found <- qr.coef(memory$qr, crossprod(rows, weight * target) / size)[, 1L] / size
      # As lm() does, leave out terms that depend linearly on others in these steps.
      found[is.na(found)] <- 0
      found
    },
    values = function(fit, block) do.call(cbind, lapply(block, function(rows) rows %*% fit)),
    fixed = function(rows, after, reward, go_on, p_next, weight, call) {
      ahead <- Reduce(`+`, lapply(seq_along(after), function(i) after[[i]] * p_next[, i]))
      right <- crossprod(rows, weight * reward) / size
      tryCatch(
        solve(square(rows, weight * (rows - go_on * ahead)), right, tol = 1e-18)[, 1L] / size,
        error = function(cnd) {
          abort_wrong(
            "formula", NULL, call, "The linear model has no solution.",
            i = "Give a `discount` below 1 or a `horizon`, or a `formula` with fewer terms."
          )
        }
      )
    }
  )
}

# Any model -----------------------------------------------------------------------------

any_regression <- function(formula, model, steps) {
  actions <- steps$actions
  many <- nrow(actions)
  list(
    label = paste("a model,", deparse1(formula[-2L])),
    block = function(states) list(states = states, known = stats::complete.cases(states)),
    rows = function(states, action) with_action(states, action, actions),
    fit = function(rows, target, weight) {
      # A weight is how often a row was drawn.
      rows$value <- target
      drawn <- rep(seq_along(target), round(weight))
      data <- list2DF(lapply(rows, function(x) x[drawn]))
      tryCatch(model(formula, data = data), error = function(cnd) abort_regression(cnd, NULL))
    },
    values = function(fit, block) {
      some <- which(block$known)
      values <- matrix(0, length(block$known), many)
      if (length(some)) {
        asked <- with_action(
          block$states, rep(seq_len(many), each = length(some)), actions, rep(some, many)
        )
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
