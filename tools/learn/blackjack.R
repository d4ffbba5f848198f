# Gymnasium's Blackjack-v1 as a model, which evaluates learned policies exactly: an infinite deck, a
# dealer who sticks at 17, and a natural that wins unless the dealer has one, too (sab = TRUE, as
# Gymnasium registers it).
#
# A state is a row of the table of observations (the sum, the dealer's card, a usable ace), counted
# from 0. The observation does not distinguish a natural from 21 with more cards. So naturals are
# separate states, from 704 on, in which the policy acts as at 21.

chance <- c(rep(1, 9), 4) / 13

# A hand after a card: its sum and whether an ace counts 11.
with_card <- function(hand, card) {
  total <- hand[[1L]] + card
  ace <- hand[[2L]]
  if (card == 1 && total + 10 <= 21) {
    c(total + 10, 1)
  } else if (total > 21 && ace) {
    c(total - 10, 0)
  } else {
    c(total, ace)
  }
}

# The probability that the dealer ends with each sum from 1 to 21, or (the last one) above 21.
dealer_ends <- function(hand) {
  ends <- numeric(22)
  if (hand[[1L]] >= 17) {
    ends[[min(hand[[1L]], 22)]] <- 1
    return(ends)
  }
  for (card in 1:10) ends <- ends + chance[[card]] * dealer_ends(with_card(hand, card))
  ends
}

state_of <- function(hand, shown) (hand[[1L]] * 11 + shown) * 2 + hand[[2L]]
natural_state <- function(shown) 704 + shown

moves_from <- function(hand, shown, ends) {
  state <- state_of(hand, shown)
  total <- hand[[1L]]
  win <- sum(ends[seq_len(total - 1)]) + ends[[22L]]
  lose <- sum(ends[1:21 > total])
  stick <- data.frame(
    state = state, action = 0, next_state = 0, reward = c(1, -1, 0), terminated = TRUE,
    probability = c(win, lose, 1 - win - lose)
  )
  hits <- lapply(1:10, function(card) {
    after <- with_card(hand, card)
    bust <- after[[1L]] > 21
    data.frame(
      state = state, action = 1, next_state = if (bust) 0 else state_of(after, shown),
      reward = -bust, terminated = bust, probability = chance[[card]]
    )
  })
  rbind(stick, do.call(rbind, hits))
}

moves_with <- function(shown) {
  first <- with_card(c(0, 0), shown)
  ends <- dealer_ends(first)
  hands <- rbind(cbind(4:21, 0), cbind(12:21, 1))
  moves <- do.call(rbind, apply(hands, 1L, moves_from, shown, ends, simplify = FALSE))
  # Sticking to a natural wins unless the dealer's second card makes one, too.
  other <- switch(as.character(shown), "1" = chance[[10L]], "10" = chance[[1L]], 0)
  from_21 <- moves[moves$state == state_of(c(21, 1), shown) & moves$action == 1, ]
  from_21$state <- natural_state(shown)
  stick <- data.frame(
    state = natural_state(shown), action = 0, next_state = 0, reward = c(1, 0),
    terminated = TRUE, probability = c(1 - other, other)
  )
  rbind(moves, from_21, stick)
}

blackjack_model <- function() {
  moves <- do.call(rbind, lapply(1:10, moves_with))
  moves <- stats::aggregate(probability ~ ., moves[moves$probability > 0, ], sum)
  start <- numeric(natural_state(10) + 1)
  for (first in 1:10) for (second in 1:10) for (shown in 1:10) {
    hand <- with_card(with_card(c(0, 0), first), second)
    state <- if (hand[[1L]] == 21) natural_state(shown) else state_of(hand, shown)
    likely <- chance[[first]] * chance[[second]] * chance[[shown]]
    start[[state + 1]] <- start[[state + 1]] + likely
  }
  gym::gym_model(moves, start = start, id = "Blackjack-v1")
}

# The expected return of a table that was learned in Blackjack-v1.
blackjack_value <- function(policy) {
  at_21 <- vapply(0:10, function(shown) state_of(c(21, 1), shown), 0) + 1
  table <- gym::policy_table(rbind(policy$q, policy$q[at_21, ]))
  gym::evaluate_policy(blackjack_model(), table)$mean_return
}
