# Solves the linear equations of a policy's values: by sweeps if a few are enough, otherwise
# directly.

# Up to this number of states, solving the equations directly is faster than sweeps.
unswept_states <- 100L

#' Prepare to solve `values = rewards + weight %*% values`
#'
#' @param weight A square matrix, full or sparse, without negative numbers.
#' @return A function of rewards, which must not be negative. So each value is accurate relative to
#'   its own size, even if it is tiny compared with the others.
#' @noRd
chain_solver <- function(weight, call) {
  solver <- NULL
  function(rewards) {
    if (all(rewards == 0)) {
      return(rewards)
    }
    swept <- if (length(rewards) > unswept_states) swept_values(weight, rewards)
    if (!is.null(swept)) {
      return(swept)
    }
    tryCatch({
      solver <<- solver %||% if (is.matrix(weight)) {
        equations <- diag(nrow(weight)) - weight
        function(rewards) solve(equations, rewards, tol = 0)
      } else {
        sparse_solver(weight)
      }
      solved_values(weight, rewards, solver)
    }, error = function(e) {
      abort_wrong(
        "discount", NULL, call,
        'The equations of {count_of(length(rewards), "state")} cannot be solved: they need too much
         memory, or episodes hardly ever end.',
        i = "Give a lower `discount`, or a `horizon`."
      )
    })
  }
}

#' Apply a policy's equations until the values do not change any more
#'
#' The sweeps start from values of 0. They stop when the error is small, by one of two bounds. If
#' after k sweeps no value grows by more than a share e of itself, none grows by more than a share
#' of about 2 k e in the next k sweeps, and so on. Often growth_bounds() finds sooner that little
#' growth remains.
#' @return The values, or `NULL` if so many sweeps are needed that solving the equations is faster.
#' @noRd
swept_values <- function(weight, rewards) {
  enough <- 1e-15
  most <- 500L
  every <- 25L
  bounded <- growth_bounds(weight)
  ahead <- if (is.matrix(weight)) {
    used <- which(t(weight) > 0, arr.ind = TRUE)
    padded_product(used[, 2L], used[, 1L], weight[used[, 2:1, drop = FALSE]], nrow(weight))
  } else {
    function(x) times(weight, x)
  }
  values <- rewards
  before <- Inf
  for (sweep in seq_len(most)) {
    new <- rewards + ahead(values)
    growth <- new - values
    values <- new
    share <- max(growth / pmax(values, .Machine$double.xmin))
    final <- if (share <= enough) values else bounded(values, growth)
    if (!is.null(final)) {
      return(final)
    }
    if (sweep %% every == 0L) {
      # The number of further sweeps if growth continues to decrease at this rate.
      if (share >= before || every * log(enough / share) / log(share / before) > most - sweep) {
        return(NULL)
      }
      before <- share
    }
  }
}

# Makes a function that multiplies a sparse matrix by a vector. The matrix is given by its non-zero
# numbers, row by row. They are moved to the left into a narrow full matrix.
padded_product <- function(row, column, number, rows) {
  at <- cbind(row, sequence(rle(row)$lengths))
  shape <- c(rows, max(at[, 2L], 1L))
  columns <- array(1L, shape)
  columns[at] <- column
  left <- array(0, shape)
  left[at] <- number
  function(x) .rowSums(left * x[columns], shape[[1L]], shape[[2L]])
}

#' Prepare to estimate values from their growth in a sweep
#'
#' The remaining growth lies between the least and the greatest growth times the remaining steps
#' (MacQueen 1966, A modified dynamic programming method for Markovian decision problems).
#' @return A function of values and their growth that returns the values plus the middle of these
#'   bounds, or `NULL` if the bounds are too far apart.
#' @noRd
growth_bounds <- function(weight) {
  goes_on <- range(times(weight, rep(1, nrow(weight))))
  to_go <- goes_on / (1 - goes_on)
  rounding <- 8 * .Machine$double.eps / (1 - goes_on[[2L]])
  if (goes_on[[2L]] >= 1 || rounding >= tie_tolerance) {
    return(function(values, growth) NULL)
  }
  function(values, growth) {
    to_come <- to_go * range(growth)
    if (diff(to_come) <= max(sweep_tolerance, rounding) * min(values)) values + mean(to_come)
  }
}

solved_values <- function(weight, rewards, solver) {
  values <- solver(rewards)
  # The residual of the solution is solved again, until only rounding is left in every state.
  for (round in 1:3) {
    left <- rewards + times(weight, values) - values
    if (all(abs(left) <= 8 * .Machine$double.eps * values)) break
    values <- pmax(values + solver(left), 0)
  }
  values
}

sparse_solver <- function(weight) {
  all <- seq_len(nrow(weight))
  equations <- Matrix::sparseMatrix(
    i = c(all, weight@i + 1L), j = c(all, rep(all, diff(weight@p))),
    x = c(rep(1, length(all)), -weight@x), dims = dim(weight)
  )
  # With this tolerance the pivots are on the diagonal. They are accurate if all other numbers are
  # negative, and leave more zeros.
  factors <- Matrix::lu(equations, tol = 1e-300)
  function(rewards) {
    values <- numeric(length(rewards))
    half <- Matrix::solve(factors@L, rewards[factors@p + 1L])
    values[factors@q + 1L] <- as.vector(Matrix::solve(factors@U, half))
    values
  }
}
