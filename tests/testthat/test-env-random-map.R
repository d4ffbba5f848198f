random_lake <- function(play, ...) {
  play("FrozenLake-v1", ..., desc = NULL, map_name = NULL, client = test_client())
}

test_that("a random map follows from the seed, whatever plays", {
  maps <- lapply(c(1, 1, 2), function(seed) {
    played <- random_lake(rollout, policy_random(), episodes = 2, seed = seed)
    provenance(played)$kwargs$desc
  })
  expect_identical(nchar(maps[[1L]]), rep(8L, 8))
  expect_identical(maps[[2L]], maps[[1L]])
  expect_false(identical(maps[[3L]], maps[[1L]]))
  env <- random_lake(gym_make, seed = 1)
  on.exit(env$close())
  expect_identical(env$spec$kwargs$desc, maps[[1L]])
  # It is the map by which the environment moves.
  cells <- strsplit(paste(maps[[1L]], collapse = ""), "")[[1L]]
  moves <- as.data.frame(env_model(env))
  expect_setequal(
    unique(moves$next_state[moves$terminated]), which(cells %in% c("H", "G")) - 1
  )
})

test_that("what is learned on a random map is judged on the same", {
  skip_unless_all()
  learned <- random_lake(learn_q, total_steps = 500, seed = 1, is_slippery = FALSE,
                         max_steps = 100)
  lake <- env_model(
    "FrozenLake-v1", desc = provenance(learned)$kwargs$desc, is_slippery = FALSE,
    client = test_client()
  )
  exact <- evaluate_policy(lake, learned$policy, max_steps = 100)$mean_return
  expect_identical(learned$final$mean_return, exact)
})

test_that("a way leads to the goal of every map", {
  ice <- matrix(c(TRUE, FALSE, TRUE, TRUE), 2)
  expect_true(has_way(ice))
  expect_false(has_way(ice & row(ice) == col(ice)))
  expect_true(all(vapply(1:50, function(seed) {
    map <- with_generator(new_generator(seed), draw_lake())
    has_way(do.call(rbind, strsplit(map, "")) != "H")
  }, NA)))
})
