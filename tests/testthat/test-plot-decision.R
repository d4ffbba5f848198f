autoplot <- ggplot2::autoplot

map_of <- function(policy = policy_network(c(2, 1)), env = NULL, ..., xlim = c(-2, 2),
                   ylim = c(-1, 1)) {
  decision_map(env, policy, ..., x = 1, y = 2, xlim = xlim, ylim = ylim, size = 21)
}

rising <- policy_network(c(2, 1), weights = list(matrix(c(1, 0), 1)))

plane <- function(actions) {
  fake_environment(observation_space = box_space(c(-1, -1), c(1, 1)), action_space = actions)
}

test_that("the field has the outputs in their places, the border at one half", {
  map <- map_of(rising)
  picture <- drawn(autoplot(map))
  expect_equal(picture$data$shown, stats::plogis(picture$data$x))
  expect_identical(range(picture$data$y), c(-1, 1))
  expect_equal(unique(round(layers_of(picture, "GeomContour")[[1]]$x, 6)), 0)
  # The colours reach as far as the outputs do.
  limits <- ggplot2::ggplot_build(picture)$plot$scales$get_scales("fill")$get_limits()
  expect_equal(limits, 0.5 + c(-1, 1) * (stats::plogis(2) - 0.5))
})

test_that("regions have the names of their actions, inside of them, and then no key", {
  regions <- layers_of(autoplot(map_of(rising)), "GeomText")[[1]]
  expect_identical(regions$label, c("0", "1"))
  expect_lt(regions$x[1], -0.5)
  expect_gt(regions$x[2], 0.5)
  always <- map_of(policy_network(c(2, 1), weights = list(matrix(0, 1, 2))))
  expect_identical(layers_of(drawn(autoplot(always)), "GeomText")[[1]]$label, "0")
  choice <- function(left, below) {
    two <- function(observation) ifelse(observation[, 1] < left & observation[, 2] < below, 0L, 2L)
    one <- map_of(two, plane(discrete_space(3L)))
    ggplot2::ggplot_build(drawn(autoplot(one)))$plot$scales$get_scales("fill")$guide
  }
  expect_identical(choice(0, 2), "none")
  # A sliver has no room for its name.
  expect_false(identical(choice(-1.5, -0.95), "none"))
})

test_that("names of regions do not cover the path, and are not cut at the edge", {
  across <- data.frame(obs_1 = c(-2, 2), obs_2 = 0)
  picture <- drawn(autoplot(map_of(rising, path = across)))
  names <- layers_of(picture, "GeomText")[[1]]
  expect_identical(names$label, c("0", "1"))
  expect_true(all(abs(names$y) > 0.1))
  # A long name in a narrow region is in the key.
  narrow <- region_labels(
    expand.grid(x = seq(0, 1, length.out = 21), y = seq(0, 1, length.out = 21)),
    rep(rep(1:2, c(2, 19)), 21), c("a very long name", "b")
  )
  expect_identical(narrow$label, "b")
  room <- room_for_name(matrix(TRUE, 101, 101), strrep("n", 20))
  half <- 101 * 0.042 * 20 / 3.2
  expect_gte(min(which(room[, 51])), half)
  expect_lte(max(which(room[, 51])), 101 - half)
})

test_that("maps of actions that are numbers or many are drawn, and so are paths", {
  box <- plane(box_space(-2, 2))
  drawn(autoplot(map_of(policy_network(c(2, 1), c("tanh", "tanh")), box)))
  flat <- policy_network(c(2, 1), c("tanh", "tanh"), list(matrix(0, 1, 2)))
  drawn(autoplot(map_of(flat, box)))
  drawn(autoplot(map_of(policy_network(c(2, 18)), plane(discrete_space(18L)))))
  path <- data.frame(obs_1 = c(0, 0.5, 1), obs_2 = c(0, 1, 0.5))
  picture <- drawn(autoplot(map_of(path = path)))
  expect_identical(layers_of(picture, "GeomPath")[[1]]$x, path$obs_1)
  ends <- layers_of(picture, "GeomPoint")
  expect_identical(c(ends[[1]]$x, ends[[2]]$x), c(0, 1))
  drawn(autoplot(map_of(path = path[1, ])))
})

test_that("CartPole: an episode of the real environment lies on the map of its policy", {
  client <- test_client()
  policy <- search_random(rounds = 3, seed = 1, client = client)$policy
  map <- decision_map("CartPole-v0", policy, x = "pole_angle", y = "pole_angular_velocity",
                      path = TRUE, seed = 1, client = client)
  drawn(autoplot(map))
  played <- rollout("CartPole-v0", policy, seed = 1, steps = TRUE, client = client)
  expect_identical(map$path$x, played$steps$pole_angle)
  expect_identical(map$actions, c("0: push left", "1: push right"))
})
