# Vector environments through a real server.

test_that("sub-environments play the same in R as in Python, in every vectorization mode", {
  skip_unless_all()
  client <- test_client()
  python <- the_session$servers[[client$remote_base]]$python
  cases <- list(
    list(id = "CartPole-v1", n = 8L, mode = "vector_entry_point", autoreset = "NextStep"),
    list(id = "CartPole-v1", n = 3L, mode = "sync", autoreset = "NextStep"),
    list(id = "CartPole-v1", n = 3L, mode = "sync", autoreset = "SameStep"),
    list(id = "CartPole-v1", n = 1L, mode = "sync", autoreset = "SameStep"),
    list(id = "Pendulum-v1", n = 2L, mode = "sync", autoreset = "NextStep")
  )
  for (case in cases) {
    withr::local_seed(3)
    env <- local_env(case$id, num_envs = case$n, vectorization_mode = case$mode,
                     autoreset_mode = case$autoreset, client = client)
    actions <- lapply(1:300, function(i) space_sample(env$action_space))
    lines <- withr::local_tempfile()
    file <- withr::local_tempfile()
    writeLines(vapply(actions, function(a) paste(sprintf("%.17g", a), collapse = " "), ""), lines)
    processx::run(
      python, c(test_path("reference_sub_envs.py"), case$id, case$n, case$mode, case$autoreset,
                length(actions), file),
      stdin = lines, env = c("current", PYTHONWARNINGS = "ignore")
    )
    flat <- function(out) {
      as.numeric(c(row_major(out$observation), out$reward, out$terminated, out$truncated,
                   row_major(out$next_observation)))
    }
    played <- row_major(env$reset(seed = 7))
    ended <- 0L
    steps <- lapply(actions, function(action) {
      out <- env$step(action)
      ended <<- ended + sum(out$done)
      flat(out)
    })
    expected <- readBin(file, "double", file.size(file) / 8, endian = "little")
    expect_identical(c(played, unlist(steps)), expected, info = paste(case, collapse = " "))
    expect_gt(ended, 0)
  }
})

test_that("the modes that were chosen can be read, and are printed in one line", {
  env <- local_env("CartPole-v1", num_envs = 256)
  expect_output(print(env),
                "<gym_env: CartPole-v1, 256 sub-environments (vector_entry_point, NextStep)>",
                fixed = TRUE)
  expect_output(print(env), "<Box float32 [256, 4]>", fixed = TRUE)
  expect_equal(env$num_envs, 256)
  one <- local_env("CartPole-v1", num_envs = 1, autoreset_mode = "Disabled")
  expect_output(print(one), "1 sub-environment (sync, Disabled)", fixed = TRUE)
  one$close()
  expect_output(print(one), "Disabled), closed>", fixed = TRUE)
  single <- local_env("CartPole-v1")
  expect_null(single$num_envs)
  expect_null(single$autoreset_mode)
  expect_identical(single$single_action_space, single$action_space)
  expect_output(print(single), "<gym_env: CartPole-v1>", fixed = TRUE)
})

test_that("the first dimension of the spaces counts sub-environments, as on the server", {
  env <- local_env("CartPole-v1", num_envs = 3)
  asked <- function(which) {
    new_space(get_request(env$client, paste0("/v1/envs/", env$instance_id, "/", which, "/"))$info)
  }
  for (which in c("action_space", "observation_space")) {
    from_server <- asked(which)
    expect_identical(env[[which]][names(from_server)], unclass(from_server)[names(from_server)])
    expect_identical(env[[which]]$shape[[1L]], 3L)
  }
  expect_identical(env_action_space_info(env$client, env$instance_id), env$action_space)
  expect_identical(env$single_observation_space$shape, 4L)
  drawn <- env_action_space_sample(env$client, env$instance_id)
  expect_true(space_contains(env$action_space, drawn))
  member <- function(value) env_action_space_contains(env$client, env$instance_id, value)
  expect_true(member(drawn))
  for (value in list(c(0, 1), c(0, 1, 2), 0, "a", NULL)) expect_false(member(value))
  observed <- function(value) env_observation_space_contains(env$client, env$instance_id, value)
  expect_true(observed(env$reset()))
  expect_false(observed(env$reset()[1:2, ]))
})

test_that("each part of a result has a row for each sub-environment, also when there is one", {
  for (n in c(1L, 3L)) {
    env <- local_env("CartPole-v1", num_envs = n, seed = 1)
    expect_identical(dim(env$reset()), c(n, 4L))
    out <- env$step(rep(1L, n))
    expect_named(out, c("observation", "reward", "done", "info", "terminated", "truncated",
                        "next_observation"))
    expect_identical(dim(out$observation), c(n, 4L))
    expect_identical(out$reward, rep(1, n))
    for (flag in c("done", "terminated", "truncated")) expect_identical(out[[flag]], logical(n))
    expect_identical(out$info, structure(list(), names = character()))
    both <- env$reset(return_info = TRUE)
    expect_identical(dim(both$observation), c(n, 4L))
    expect_length(both$info, 0)
  }
})

test_that("with a seed for each, a sub-environment gets its own; NA leaves its generator", {
  seeds <- c(11, 12, 13)
  env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", seed = seeds)
  single <- local_env("CartPole-v1")
  alone <- t(vapply(seeds, function(seed) single$reset(seed = seed), numeric(4)))
  expect_identical(env$reset(), alone)
  again <- env$reset(seed = c(13, NA, 11))
  expect_identical(again[c(1, 3), ], alone[c(3, 1), ])
  single$reset(seed = 12)
  expect_identical(again[2, ], single$reset())
  # One seed for all is counted up, as Gymnasium does.
  expect_identical(env$reset(seed = 11), alone)
  chosen <- local_env("CartPole-v1", num_envs = 3, seed = seeds)
  expect_identical(chosen$vectorization_mode, "sync")
})

test_that("only the sub-environments that `which` picks step, and have rows", {
  env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", seed = 1)
  twin <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", seed = 1)
  env$reset()
  twin$reset()
  some <- env$step(c(1, 0), which = c(1, 3))
  all <- twin$step(c(1, 1, 0))
  expect_identical(some$observation, all$observation[c(1, 3), ])
  expect_identical(some$reward, c(1, 1))
  expect_identical(some$done, c(FALSE, FALSE))
  expect_identical(env$step(1, which = 2)$observation, all$observation[2, , drop = FALSE])
  expect_identical(env$step(c(0, 0, 0), which = 1:3), twin$step(c(0, 0, 0)))
})

test_that("a mask resets only the sub-environments that it picks", {
  env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", seed = 1)
  env$reset()
  before <- env$step(c(1, 1, 1))$observation
  after <- env$reset(mask = c(FALSE, TRUE, FALSE))
  expect_identical(after[-2, ], before[-2, ])
  expect_false(identical(after[2, ], before[2, ]))
})

test_that("with SameStep the step that ends an episode begins one and keeps its observation", {
  env <- local_env("CartPole-v1", num_envs = 3, autoreset_mode = "SameStep", seed = 1)
  single <- local_env("CartPole-v1")
  env$reset(seed = c(1, 2, 3))
  single$reset(seed = 1)
  # The first pole falls soon, the others stay up longer.
  repeat {
    out <- env$step(c(1, 0, 1), which = 1:3)
    last <- single$step(1)
    if (any(out$done)) break
    expect_null(out$info$final_obs)
  }
  final <- out$info$final_obs
  expect_length(final, 3)
  expect_identical(vapply(final, is.null, NA), !out$done)
  expect_true(out$done[[1]])
  expect_identical(final[[1]], last$observation)
  expect_false(identical(out$observation[1, ], final[[1]]))
  # What the step led to: the last observation where an episode ended, elsewhere what is observed.
  expect_identical(out$next_observation[out$done, , drop = FALSE],
                   do.call(rbind, final[out$done]))
  expect_identical(out$next_observation[!out$done, ], out$observation[!out$done, ])
  expect_false(any(startsWith(names(out$info), "_")))
})

test_that("with autoreset disabled a sub-environment needs a reset after its episode's end", {
  env <- local_env("CartPole-v1", num_envs = 2, autoreset_mode = "Disabled")
  twin <- local_env("CartPole-v1", num_envs = 2, autoreset_mode = "Disabled")
  env$reset(seed = c(1, 2))
  twin$reset(seed = c(1, 2))
  # Pushed to one side a pole falls soon, pushed to and fro it stands longer.
  at <- 0
  repeat {
    at <- at + 1
    out <- env$step(c(1, at %% 2))
    twin$step(c(1, at %% 2))
    if (any(out$done)) break
  }
  expect_identical(out$done, c(TRUE, FALSE))
  error <- expect_error(env$step(c(0, 0)), "sub-environment 0 ended", class = "gym_error_http_400")
  expect_identical(error$code, "reset_needed")
  expect_identical(env$step(0, which = 2), twin$step(0, which = 2))
  env$reset(mask = out$done)
  expect_equal(env$step(c(0, 0))$reward, c(1, 1))
})

test_that("with autoreset in the next step no warning comes of stepping on", {
  env <- local_env("CartPole-v1", num_envs = 2, seed = 1)
  env$reset()
  expect_no_warning({
    repeat if (any(env$step(c(1, 1))$done)) break
    out <- env$step(c(1, 1))
  })
  expect_true(0 %in% out$reward)
})

test_that("in processes of their own, sub-environments play as in one process", {
  sync <- local_env("CartPole-v1", num_envs = 2, vectorization_mode = "sync")
  async <- local_env("CartPole-v1", num_envs = 2, vectorization_mode = "async")
  expect_identical(async$vectorization_mode, "async")
  expect_identical(async$reset(seed = 5), sync$reset(seed = 5))
  for (i in 1:30) expect_identical(async$step(c(1, 0)), sync$step(c(1, 0)))
})

test_that("a `num_envs` that is no number is refused before anything is made", {
  client <- test_client()
  before <- length(env_list_all(client))
  for (bad in list(0, -1, 2.5, NA, NaN, Inf, "2", c(2, 3), TRUE, list(2))) {
    expect_error(gym_make("CartPole-v1", num_envs = bad, client = client), "num_envs",
                 class = "gym_error_argument")
    expect_error(env_create(client, "CartPole-v1", num_envs = bad), "num_envs",
                 class = "gym_error_argument")
  }
  error <- expect_error(gym_make("CartPole-v1", num_envs = 1e6, client = client), "1000000",
                        class = "gym_error_http_429")
  expect_identical(error$code, "too_many_sub_envs")
  expect_length(env_list_all(client), before)
})

test_that("unknown modes, and modes without `num_envs`, are refused", {
  client <- test_client()
  make <- function(...) gym_make("CartPole-v1", ..., client = client)
  for (bad in list("fast", "Sync", NA, 1, c("sync", "async"))) {
    expect_error(make(num_envs = 2, vectorization_mode = bad), "vectorization_mode.*async",
                 class = "gym_error_argument")
  }
  for (bad in list("never", "next_step", TRUE)) {
    expect_error(make(num_envs = 2, autoreset_mode = bad), "autoreset_mode.*SameStep",
                 class = "gym_error_argument")
  }
  expect_error(make(vectorization_mode = "sync"), "num_envs", class = "gym_error_argument")
  expect_error(make(autoreset_mode = "Disabled"), "num_envs", class = "gym_error_argument")
  expect_error(make(seed = c(1, 2)), "seed", class = "gym_error_argument")
  error <- expect_error(
    make(num_envs = 2, vectorization_mode = "vector_entry_point", autoreset_mode = "Disabled"),
    class = "gym_error_http_400"
  )
  expect_identical(error$code, "not_supported")
  expect_match(error$hint, "sync")
})

test_that("seeds, masks and `which` that do not fit are refused, and nothing moves", {
  make <- function() {
    env <- local_env("CartPole-v1", num_envs = 3, vectorization_mode = "sync", seed = 1,
                     frame = parent.frame(2))
    env$reset()
    env
  }
  env <- make()
  twin <- make()
  for (bad in list(1:2, c(1, 2, -3), c(1, 2, 0.5), c(1, 2, NaN), c("1", "2", "3"), list(1, 2, 3),
                   c(1, 2, Inf), NA, integer())) {
    expect_error(env$reset(seed = bad), "seed", class = "gym_error_argument")
  }
  for (bad in list(TRUE, c(TRUE, FALSE), c(TRUE, NA, FALSE), logical(3), c(1, 0, 0), "TRUE",
                   rep(TRUE, 4))) {
    expect_error(env$reset(mask = bad), "mask", class = "gym_error_argument")
  }
  for (bad in list(0, 4, c(1, 1), c(2, 1), 1.5, NA, "1", integer(), c(TRUE, FALSE, TRUE), Inf)) {
    expect_error(env$step(1, which = bad), "which", class = "gym_error_argument")
  }
  expect_identical(env$step(c(1, 0, 1)), twin$step(c(1, 0, 1)))
  single <- local_env("CartPole-v1")
  single$reset()
  expect_error(single$reset(mask = TRUE), "num_envs", class = "gym_error_argument")
  expect_error(single$step(1, which = 1), "which", class = "gym_error_argument")
})

test_that("actions that do not fit are refused, naming the sub-environment, and nothing moves", {
  make <- function(id, mode, frame) {
    env <- local_env(id, num_envs = 4, vectorization_mode = mode, frame = frame)
    env$reset(seed = 1)
    env
  }
  frame <- environment()
  for (mode in c("vector_entry_point", "sync")) {
    env <- make("CartPole-v1", mode, frame)
    twin <- make("CartPole-v1", mode, frame)
    for (bad in list(c(0, 1, NA, 0), c(0, 1, 0.5, 0))) {
      expect_error(env$step(bad), "Sub-environment 3: .*<Discrete 2>", class = "gym_error_space")
    }
    for (bad in list(1, c(0, 1, 1), rep(1, 5))) {
      expect_error(env$step(bad), paste("4, not", length(bad)), class = "gym_error_space")
    }
    for (bad in list(NULL, data.frame(a = rep(1, 4)), matrix(1, 4, 1), list(1, 1, 1, 1))) {
      expect_error(env$step(bad), class = "gym_error_space")
    }
    # Bounds are the server's, which counts sub-environments from 0.
    expect_error(env$step(c(0, 1, 2, 0)), "2 at [2]", fixed = TRUE, class = "gym_error_space")
    expect_identical(env$step(c(1, 0, 1, 0)), twin$step(c(1, 0, 1, 0)))
  }
  env <- make("Pendulum-v1", "sync", frame)
  twin <- make("Pendulum-v1", "sync", frame)
  expect_error(env$step(matrix(0, 3, 1)), "4, not 3", class = "gym_error_space")
  expect_error(env$step(matrix(0, 4, 2)), "4 x 1", class = "gym_error_space")
  expect_error(env$step(c(0, 0, NA, 0)), "Sub-environment 3", class = "gym_error_space")
  expect_error(env$step(c(0, 0, 0, NaN)), "[3]", fixed = TRUE, class = "gym_error_space")
  expect_identical(env$step(c(0.5, 1, -1, 0)), twin$step(matrix(c(0.5, 1, -1, 0))))
  expect_identical(env$step(c(-3, 3, 0, 2)), twin$step(c(-2, 2, 0, 2)))
})

test_that("what an implementation cannot do is refused, and says what can", {
  env <- local_env("CartPole-v1", num_envs = 2, vectorization_mode = "vector_entry_point")
  env$reset(seed = 1)
  for (call in list(
    function() env$reset(seed = 1:2), function() env$reset(mask = c(TRUE, FALSE)),
    function() env$step(1, which = 2)
  )) {
    error <- expect_error(call(), class = "gym_error_http_400")
    expect_identical(error$code, "not_supported")
    expect_match(error$hint, "sync")
  }
  expect_error(env_monitor_start(env$client, env$instance_id, "tmp"), class = "gym_error_http_400")
})

test_that("a step before the first reset is an error, and a closed environment stays closed", {
  env <- local_env("CartPole-v1", num_envs = 2)
  error <- expect_error(env$step(c(0, 1)), class = "gym_error_http_400")
  expect_identical(error$code, "reset_needed")
  env$close()
  expect_error(env$step(c(0, 1)), "was closed", class = "gym_error_argument")
})

test_that("values of vector environments travel as tensors where their space has them", {
  env <- local_env("CartPole-v1", num_envs = 2)
  instance <- known_instance(env$client, env$instance_id)
  expect_true(instance$sends_tensors)
  sequence <- new_space(list(name = "Sequence", space = describe_box(0, 1)))
  expect_false(travels_as_tensors(sequence, 2))
  expect_false(travels_as_tensors(new_space(list(name = "Tuple", spaces = list())), 2))
})

test_that("the info of a reset has entries for each sub-environment", {
  skip_if_not(env_registry(test_client(), "FrozenLake-v1")$available[1], "the extra toy-text")
  env <- local_env("FrozenLake-v1", num_envs = 2)
  both <- env$reset(return_info = TRUE)
  expect_identical(both, list(observation = c(0L, 0L), info = list(prob = c(1L, 1L))))
})

test_that("the classic calls play a vector environment", {
  client <- test_client()
  id <- env_create(client, "CartPole-v1", seed = 1, num_envs = 2, vectorization_mode = "sync")
  withr::defer(env_close(client, id))
  expect_identical(env_list_all(client)[[id]], "CartPole-v1")
  expect_identical(dim(env_reset(client, id)), c(2L, 4L))
  expect_length(env_step(client, id, c(1, 0))$reward, 2)
  expect_length(env_step(client, id, 1, which = 2)$reward, 1)
  expect_identical(dim(env_reset(client, id, mask = c(TRUE, FALSE))), c(2L, 4L))
  expect_identical(env_action_space_info(client, id)$nvec, c(2L, 2L))
})

test_that("kwargs and wrappers reach every sub-environment", {
  env <- local_env("CartPole-v1", num_envs = 2, sutton_barto_reward = TRUE)
  env$reset()
  expect_identical(env$step(c(1, 1))$reward, c(0, 0))
  short <- "CartPole-v1" |>
    gym_wrap("TimeLimit", max_episode_steps = 2) |>
    local_env(num_envs = 2)
  short$reset()
  short$step(c(0, 1))
  expect_identical(short$step(c(0, 1))$truncated, c(TRUE, TRUE))
  expect_identical(short$vectorization_mode, "sync")
})

test_that("an error about a wrong action names the sub-environment, with `which` too", {
  env <- local_env("FrozenLake-v1", num_envs = 5, autoreset_mode = "Disabled")
  env$reset()
  error <- expect_error(env$step(c(0, NA), which = c(2, 4)), "Sub-environment 4",
                        class = "gym_error_space")
  expect_identical(error$sub_env, 4)
})

test_that("by default the step after an end begins the next episode, without reward or end", {
  env <- local_env("CartPole-v1", num_envs = 2, vectorization_mode = "sync", seed = 1)
  env$reset()
  for (step in 1:500) {
    out <- env$step(c(1, 0))
    if (out$done[[1]]) break
  }
  began <- env$step(c(1, 0))
  expect_identical(began$reward[[1]], 0)
  expect_false(began$terminated[[1]] || began$truncated[[1]])
  # Where CartPole begins; a step moves the cart's velocity further than that.
  expect_lt(max(abs(began$observation[1, ])), 0.05)
})

# Infos -----------------------------------------------------------------------------------

by_sub_env <- function(json, n) info_by_sub_env(from_json(json), n)

test_that("each key has an entry for each sub-environment, missing where there is no value", {
  info <- by_sub_env('{"x":[0,2,0],"_x":[false,true,false],"ok":[true,false,false],
    "_ok":[true,true,false],"word":[null,"b",null],"_word":[false,true,false],
    "half":[0.5,0.0,"NaN"],"_half":[true,false,true]}', 3)
  expect_identical(
    info,
    list(x = c(NA, 2L, NA), ok = c(TRUE, FALSE, NA), word = c(NA, "b", NA), half = c(0.5, NA, NaN))
  )
})

test_that("the first dimension of arrays counts sub-environments, other values are in a list", {
  info <- by_sub_env('{"place":[[0,0],[1,2]],"_place":[false,true],
    "grid":[[[1,2],[3,4]],[[5,6],[7,8]]],"_grid":[true,true],
    "mixed":[null,{"a":1}],"_mixed":[false,true]}', 2)
  expect_identical(info$place, rbind(c(NA, NA), 1:2))
  expect_identical(info$grid[2, , ], rbind(5:6, 7:8))
  expect_identical(info$mixed, list(NULL, list(a = 1L)))
})

test_that("infos inside of infos have entries for each sub-environment, too", {
  info <- by_sub_env('{"episode":{"r":[9,0],"_r":[true,false],"l":[9,0],"_l":[true,false]},
    "_episode":[true,false],"final_info":{"lives":[0,3],"_lives":[false,true]},
    "_final_info":[false,true]}', 2)
  expect_identical(info$episode, list(r = c(9L, NA), l = c(9L, NA)))
  expect_identical(info$final_info, list(lives = c(NA, 3L)))
  expect_named(info, c("episode", "final_info"))
})

test_that("a single sub-environment has entries too, and values without a mask stay as they are", {
  json <- '{"x":[5],"_x":[true],"gone":[null],"_gone":[false],"seed":[1,2],"_free":7}'
  info <- by_sub_env(json, 1)
  expect_identical(info, list(x = 5L, gone = list(NULL), seed = 1:2, `_free` = 7L))
  expect_identical(by_sub_env("{}", 3), structure(list(), names = character()))
})
