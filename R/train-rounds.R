# Rounds of a search: which episodes are theirs, and which of them decides.

#' Start to keep what comes of rounds of episodes
#'
#' Episodes of many rounds are played at once and end in any order. The rounds are judged
#' in their own order all the same: the first whose mean return reaches the target ends
#' the search, and nothing of the rounds after it counts.
#' @param on_round Called when rounds have ended, with how many, from the first, and the
#'   best of their mean returns.
#' @return A record, as [new_record()] returns it, with `policies`, a list with the
#'   policies of the rounds that have begun.
#' @noRd
new_rounds <- function(rounds, episodes, target, on_round) {
  record <- new_record(as.numeric(rounds) * episodes, end_round_episodes)
  record$size <- episodes
  record$target <- target
  record$on_round <- on_round
  record$policies <- list()
  record$returns <- numeric()
  record$means <- numeric()
  record$open <- integer()
  record
}

#' Take note that episodes have ended
#'
#' A round that reaches the target makes all later ones needless: they are not waited
#' for. Rounds before it are, as one of them may reach it, too.
#' @noRd
end_round_episodes <- function(record, episodes, returns) {
  record$returns[episodes] <- returns
  counts <- table_of_rounds(record, episodes)
  left <- record$open[counts$round] - counts$n
  ended <- counts$round[left == 0L]
  # First what they came to: an interrupt must not find rounds that have ended without.
  record$means[ended] <- vapply(ended, mean_of_round, 0, record = record)
  record$open[counts$round] <- left
  if (length(ended)) {
    reached <- ended[vapply(record$means[ended], reaches, NA, target = record$target)]
    record$wanted <- min(record$wanted, reached * record$size)
    finished <- count_finished(record)
    if (finished > 0) {
      record$on_round(finished, max(-Inf, record$means[seq_len(finished)], na.rm = TRUE))
    }
  }
}

table_of_rounds <- function(record, episodes) {
  round <- round_of(record, episodes)
  list(round = unique(round), n = tabulate(match(round, unique(round))))
}

round_of <- function(record, episodes) (episodes - 1L) %/% record$size + 1L

mean_of_round <- function(record, round) {
  mean(record$returns[(round - 1L) * record$size + seq_len(record$size)])
}

# Rounds that have ended, and all before them too.
count_finished <- function(record) {
  open <- which(record$open > 0L)
  finished <- if (length(open)) open[[1L]] - 1L else length(record$open)
  min(finished, record$wanted %/% record$size)
}

reaches <- function(mean_return, target) !is.null(target) && isTRUE(mean_return >= target)

#' Draw the policies of the rounds that begin among some episodes
#' @return What plays these episodes, for [act_sub_envs()].
#' @noRd
draw_policies <- function(record, template, episodes) {
  round <- round_of(record, episodes)
  for (new in setdiff(round, seq_along(record$policies))) {
    record$policies[[new]] <- policy_resample(template)
    record$open[[new]] <- as.integer(record$size)
  }
  candidates_of(record$policies[unique(round)], match(round, unique(round)))
}
