# How far a learner looks ahead: one step, n steps, or all of them by eligibility traces.

#' Make the function that moves a value towards its target
#' @return A function of `x` and `column`, whose value moves; `reward`; `ahead`, the value of the
#'   next state, 0 if the episode terminated; `ended`; `sub_env`; and `taken`, the steps so far.
#' @noRd
lookahead <- function(agent, store) {
  rate <- rate_of(agent$learning_rate)
  if (isTRUE(agent$lambda > 0)) {
    trace_lookahead(agent, store, rate)
  } else if (isTRUE(agent[["n"]] > 1L)) {
    n_step_lookahead(agent, store, rate)
  } else {
    toward <- store$toward
    discount <- agent$discount
    function(x, column, reward, ahead, ended, sub_env, taken) {
      toward(x, column, reward + discount * ahead, rate(taken))
    }
  }
}

# Each sub-environment gets its own result of `make()`, which holds the state of its episode.
for_each_sub_env <- function(make) {
  made <- list()
  function(sub_env) {
    while (length(made) < sub_env) made[[length(made) + 1L]] <<- make()
    made[[sub_env]]
  }
}

# Traces smaller than this are dropped. They would move a weight by a hundred millionth of the
# error.
least_trace <- 1e-8

#' Remember which weights were used, and move all of them
#'
#' Traces are replacing for tables and tiles, and accumulating for a user's features (Sutton and
#' Barto 2018, sections 12.2 and 12.7).
#' @param decay The factor by which a trace fades in each step.
#' @param sparse Whether features are 1 or 0, so that small traces can be dropped.
#' @return A list of functions: `pass(cells, gradient, by)`, which adds these weights and moves all
#'   that have a trace by `by` times the trace, and `clear()`, for the end of an episode.
#' @noRd
new_trace <- function(store, decay, replacing, sparse = replacing) {
  strength <- numeric()
  active <- numeric()
  least <- if (sparse) least_trace else 0
  list(
    pass = function(cells, gradient, by) {
      faded <- decay * strength[active]
      strong <- abs(faded) > least
      if (!all(strong)) {
        strength[active[!strong]] <<- 0
        active <<- active[strong]
        faded <- faded[strong]
      }
      strength[active] <<- faded
      before <- strength[cells]
      before[is.na(before)] <- 0
      # `cells` is empty if all features are 0, or if the state has a single action.
      if (length(strength) < max(0, cells)) {
        strength <<- c(strength, numeric(length(store$get()) - length(strength)))
      }
      active <<- c(active, cells[before == 0])
      strength[cells] <<- if (replacing) gradient else before + gradient
      store$add(active, by * strength[active])
    },
    clear = function() {
      strength[active] <<- 0
      active <<- numeric()
    }
  )
}

trace_lookahead <- function(agent, store, rate) {
  discount <- agent$discount
  decay <- discount * agent$lambda
  replacing <- !is.null(agent$basis$each)
  trace_of <- for_each_sub_env(function() new_trace(store, decay, replacing))
  function(x, column, reward, ahead, ended, sub_env, taken) {
    trace <- trace_of(sub_env)
    error <- reward + discount * ahead - store$value(x, column)
    by <- rate(taken) / store$each * error
    trace$pass(store$cells(x, column), store$gradient(x), by)
    if (ended) trace$clear()
  }
}

# Sutton and Barto 2018, sections 7.1 and 7.2.
n_step_lookahead <- function(agent, store, rate) {
  n <- agent$n
  discount <- agent$discount
  powers <- discount^(seq_len(n) - 1L)
  learner_of_one <- for_each_sub_env(function() {
    seen <- list()
    columns <- integer()
    rewards <- numeric()
    learn_first <- function(ahead, rate) {
      count <- length(rewards)
      target <- sum(powers[seq_len(count)] * rewards) + discount^count * ahead
      store$toward(seen[[1L]], columns[[1L]], target, rate)
      seen <<- seen[-1L]
      columns <<- columns[-1L]
      rewards <<- rewards[-1L]
    }
    function(x, column, reward, ahead, ended, rate) {
      count <- length(rewards) + 1L
      seen[[count]] <<- x
      columns[[count]] <<- column
      rewards[[count]] <<- reward
      if (ended) {
        # At the end of an episode the targets of all remaining steps are known.
        while (length(rewards)) learn_first(ahead, rate)
      } else if (count == n) {
        learn_first(ahead, rate)
      }
    }
  })
  function(x, column, reward, ahead, ended, sub_env, taken) {
    learner_of_one(sub_env)(x, column, reward, ahead, ended, rate(taken))
  }
}
