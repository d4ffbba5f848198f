# Some policies are only data, numbers and a few words. A server can play them without R. Arrays are
# sent in C order, and each network's weights in the order of coef().

#' Convert a policy to data
#'
#' @param policy A policy that is bound to the environment, or several candidates.
#' @param env The environment, for its action space.
#' @return A list: `document`, a list for JSON, and `tensors`, a named list of numeric vectors and
#'   arrays. `NULL` for a policy that is not data: a function, a model, a policy with a memory, a
#'   user's class, or a table for actions of several parts.
#' @noRd
policy_data <- function(policy, env) {
  # Look at the first class alone, because a subclass may have its own method of act().
  switch(
    class(policy)[[1L]],
    gym_policy_network = network_data(policy, rbind(weight_vector(policy))),
    gym_policy_candidates = if (class(policy$policy)[[1L]] == "gym_policy_network") {
      network_data(policy$policy, policy$weights)
    },
    gym_policy_random = random_data(policy, env),
    gym_policy_table = if (inherits(env$action_space, "gym_space_discrete")) {
      list(
        document = list(kind = "table", epsilon = policy$epsilon, temperature = policy$temperature),
        tensors = list(q = policy$q)
      )
    },
    gym_policy_list = list_data(policy, env)
  )
}

# `weights` has a row for each candidate.
network_data <- function(policy, weights) {
  of_layers <- sum(lengths(policy$weights))
  normalizes <- !is.null(policy$moments$mean)
  list(
    document = c(
      list(
        kind = "network", sizes = as.list(policy$sizes), activation = as.list(policy$activation),
        bias = isTRUE(policy$bias), output = policy$output
      ),
      if (policy$output == "epsilon-greedy") policy["epsilon"],
      if (normalizes && isTRUE(policy$clip_obs < Inf)) policy["clip_obs"]
    ),
    tensors = c(
      list(weights = unname(weights[, seq_len(of_layers), drop = FALSE])),
      if (is_gaussian(policy)) {
        list(deviation = unname(exp(weights[, -seq_len(of_layers), drop = FALSE])))
      },
      if (normalizes) policy$moments[c("mean", "scale")]
    )
  )
}

random_data <- function(policy, env) {
  own <- policy$action_space
  narrower <- !identical(own, env$action_space)
  if (is.null(policy$possible) && (!narrower || inherits(own, "gym_space_discrete"))) {
    document <- c(
      list(kind = "random"), if (narrower) list(action_space = own[c("n", "start")])
    )
    list(document = document, tensors = list())
  }
}

list_data <- function(policy, env) {
  each <- lapply(unname(unclass(policy)), policy_data, env = env)
  if (any(vapply(each, is.null, NA))) {
    return(NULL)
  }
  tensors <- lapply(seq_along(each), function(i) {
    own <- each[[i]]$tensors
    stats::setNames(own, paste0(i - 1L, "/", names(own), recycle0 = TRUE))
  })
  list(
    document = list(kind = "list", policies = lapply(each, `[[`, "document")),
    tensors = unlist(tensors, recursive = FALSE)
  )
}
