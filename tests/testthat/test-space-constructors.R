# A space as new_space() makes it from the server's JSON.
described <- function(json) new_space(from_json(json))

test_that("a space made in R is the object that the server's description makes", {
  expect_identical(
    space_box(c(-1, -Inf), c(1, Inf)),
    described('{"name": "Box", "shape": [2], "dtype": "float64", "low": [-1.0, -1e100],
                "high": [1.0, 1e100]}')
  )
  expect_identical(
    space_box(0, 255, shape = c(2, 2), dtype = "uint8"),
    described('{"name": "Box", "shape": [2, 2], "dtype": "uint8", "low": [0, 0, 0, 0],
                "high": [255, 255, 255, 255]}')
  )
  expect_identical(
    space_discrete(3, start = -1),
    described('{"name": "Discrete", "n": 3, "start": -1, "dtype": "int64"}')
  )
  expect_identical(
    space_discrete(2^53 - 1),
    described('{"name": "Discrete", "n": 9007199254740991, "start": 0, "dtype": "int64"}')
  )
  expect_identical(
    space_multi_discrete(c(5, 2), start = c(0, 1)),
    described('{"name": "MultiDiscrete", "shape": [2], "dtype": "int64", "nvec": [5, 2],
                "start": [0, 1]}')
  )
  expect_identical(
    space_multi_binary(c(2, 3)),
    described('{"name": "MultiBinary", "shape": [2, 3], "dtype": "int8"}')
  )
  expect_identical(
    space_text(5, characters = "zab"),
    described('{"name": "Text", "dtype": null, "min_length": 1, "max_length": 5,
                "characters": "abz"}')
  )
  expect_identical(
    space_tuple(space_discrete(2), space_text(3, 0, c("b", "a"))),
    described('{"name": "Tuple", "dtype": null, "spaces": [
                {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"},
                {"name": "Text", "dtype": null, "min_length": 0, "max_length": 3,
                 "characters": "ab"}]}')
  )
  expect_identical(
    space_dict(b = space_discrete(2), a = space_multi_binary(1)),
    described('{"name": "Dict", "dtype": null, "spaces": [
                {"key": "b", "space": {"name": "Discrete", "n": 2, "start": 0, "dtype": "int64"}},
                {"key": "a", "space": {"name": "MultiBinary", "shape": [1], "dtype": "int8"}}]}')
  )
})

test_that("values that are drawn from a space made in R belong to it", {
  withr::local_seed(3)
  spaces <- list(
    space_box(-1, 1), space_box(-Inf, 3, shape = integer()), space_box(0, 1, c(2, 3, 4)),
    space_box(FALSE, TRUE, 3, "bool"), space_box(-2^63, 2^62, 2, "int64"),
    space_box(-1, 1, dtype = "float16"), space_discrete(4, 7),
    space_multi_discrete(matrix(1:6, 2), matrix(-1:-6, 2)), space_multi_binary(3), space_text(4),
    space_tuple(), space_dict(), space_dict(a = space_tuple(space_discrete(2), space_box(0, 1)))
  )
  for (space in spaces) {
    expect_true(space_contains(space, space_sample(space)), info = format(space))
    expect_length(batch_value(space, sample_batch(space, 3), 2), length(space_sample(space)))
  }
})

test_that("the bounds of an array lie where its numbers lie", {
  low <- matrix(1:6, 2)
  space <- space_box(low, low + 0.5)
  expect_identical(space$shape, c(2L, 3L))
  expect_true(space_contains(space, low))
  expect_false(space_contains(space, matrix(1:6, 2, byrow = TRUE)))
  cube <- array(1:24, 2:4)
  expect_true(space_contains(space_box(cube, cube), cube))
  expect_true(space_contains(space_multi_discrete(low), low - 1))
  expect_false(space_contains(space_multi_discrete(low), matrix(5:0, 2)))
})

test_that("a single bound counts for all numbers", {
  expect_identical(space_box(0, 1:3)$low, c(0, 0, 0))
  expect_identical(space_box(0, 1)$shape, 1L)
  expect_identical(space_box(0, 1, shape = integer())$shape, integer())
  expect_identical(space_multi_discrete(c(2, 3), start = 1)$start, c(1L, 1L))
})

test_that("the bounds have the precision of the dtype", {
  expect_identical(space_box(-1.2, 0.6)$low, -1.2)
  expect_identical(space_box(-1.2, 0.6, dtype = "float32")$low, -1.2000000476837158)
})

test_that("the names of the bounds are those of the numbers", {
  expect_identical(space_box(c(x = -1, v = -2), c(1, 2))$names, c("x", "v"))
  expect_identical(space_box(-1, c(x = 1, v = 2))$names, c("x", "v"))
  expect_identical(space_box(c(x = 0), 1)$names, "x")
  expect_null(space_box(c(0, 1), 1)$names)
})

test_that("a space from other arguments is an error that names them", {
  skip_unless_all()
  wrong <- function(object, message) {
    expect_error(object, message, fixed = TRUE, class = "gym_error_argument")
  }
  wrong(space_box("a", 1), "`low` must be numbers, none of them missing, not \"a\".")
  wrong(space_box(0, NaN), "`high` must be numbers, none of them missing, not NaN.")
  wrong(space_box(2, 1), "`low` must be at most `high`, which is 1, not 2.")
  wrong(space_box(c(1, 2), c(1, 2, 3)), "`high` must be a single number or of length 2, not")
  wrong(space_box(1:6, 7, c(2, 3)), "`low` must be a single number or an array with dim 2 x 3")
  wrong(space_box(0, 1, 1.5), "`shape` must be a vector of whole numbers, one for each dimension")
  wrong(space_box(0, 1, dtype = "single"), "`dtype` must be one of \"float64\"")
  wrong(space_box(0, 256, dtype = "uint8"),
        "`high` must be a whole number from 0 to 255 where the dtype is \"uint8\", not 256.")
  wrong(space_box(-Inf, 1, dtype = "int8"), "`low` must be a whole number from -128 to 127")
  wrong(space_box(0, 0.5, dtype = "int8"), "not 0.5.")
  wrong(space_box(0, 1e40, dtype = "float32"),
        "`high` must be infinite, or a number that it can hold where the dtype is \"float32\"")
  wrong(space_box(c(x = 1, 2), 3), "`names(low)` must be a name of its own for each number")
  wrong(space_box(c(x = 0, x = 0), 3), "`names(low)` must be")
  wrong(space_box(c(x = 0), 3, shape = 2), "`names(low)` must be")
  wrong(space_box(c(x = 0), c(y = 1)), "`names(high)` must be those of `low`, not \"y\".")
  wrong(space_discrete(0), "`n` must be a whole number from 1")
  wrong(space_discrete(1.5), "not 1.5.")
  wrong(space_discrete(2, "a"), "`start` must be")
  wrong(space_multi_discrete(c(2, 0)), "`nvec` must be an array of whole numbers from 1")
  wrong(space_multi_discrete(character()), "`nvec` must be")
  wrong(space_multi_discrete(c(2, 2), start = 1:3),
        "`start` must be a single whole number or, as `nvec`, of length 2, not")
  wrong(space_multi_binary(-1), "`shape` must be")
  wrong(space_text(-1), "`max_length` must be a whole number of at least 0, not -1.")
  wrong(space_text(2, min_length = 3), "`min_length` must be a whole number from 0 to 2, not 3.")
  wrong(space_text(2, characters = c("ab", "c")), "`characters` must be a string, or a vector of")
  wrong(space_text(2, characters = ""), "`characters` must be")
  wrong(space_tuple(space_discrete(2), 3), "`..2` must be a space, not 3.")
  wrong(space_tuple(a = space_discrete(2)),
        "The spaces of a Tuple have no names: `space_dict()` makes a space of spaces with names.")
  wrong(space_dict(space_discrete(2)), "Further arguments need names")
  wrong(space_dict(a = 1), "`a` must be a space, not 1.")
  wrong(space_dict(a = space_discrete(2), a = space_discrete(3)), "more than once")
})

test_that("the numbers of a MultiDiscrete space keep their names, wherever they are seen", {
  space <- space_multi_discrete(c(suit = 4, rank = 13), start = 1)
  expect_identical(space$names, c("suit", "rank"))
  expect_error(space_multi_discrete(c(a = 2, a = 2)), "`names(nvec)`", fixed = TRUE,
               class = "gym_error_argument")
  cards <- gym_env(
    function(self) c(1, 13),
    function(self, action) list(observation = action, reward = 0, terminated = TRUE),
    space, space, max_episode_steps = 5
  )
  expect_identical(cards$reset(), c(suit = 1, rank = 13))
  expect_identical(cards$step(c(rank = 7, suit = 2))$observation, c(suit = 2, rank = 7))
  steps <- rollout(cards, policy_random(), seed = 1, steps = TRUE)$steps
  expect_true(all(c("suit", "rank", "action_suit", "action_rank") %in% names(steps)))
  expect_output(print(cards), "observations: .*: `suit`, `rank`\n.*actions: .*: `suit`, `rank`")
})
