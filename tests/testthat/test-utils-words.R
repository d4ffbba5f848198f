test_that("numbers are rounded for printing, one by one where they stand apart", {
  expect_identical(number_text(12345.678), "12,346")
  expect_identical(number_text_each(c(5e4, 1e5, 1e12)), c("50,000", "100,000", "1e+12"))
  expect_identical(number_text_each(c(a = 1, b = 0.125)), c("1", "0.125"))
  expect_identical(percent_text(0.331), "33%")
  expect_identical(se_text(0.5), " (standard error 0.5)")
  expect_null(se_text(NA_real_))
})

test_that("what is counted has its plural, and long times are minutes", {
  expect_identical(count_of(1, "step"), "1 step")
  expect_identical(count_of(0, "step"), "0 steps")
  expect_identical(count_of(1e6, "step"), "1,000,000 steps")
  expect_identical(seconds_text(3), "3.0 s")
  expect_identical(seconds_text(600), "10 min")
})

test_that("thousands are not marked by the session's decimal mark", {
  withr::local_options(OutDec = ",", warn = 2)
  expect_identical(number_text(12345.678), "12.346")
  expect_identical(number_text(0.125), "0,125")
  expect_identical(count_of(1e6, "step"), "1.000.000 steps")
  expect_output(print(schedule_linear(1, 0.5, 10000)), "to 0,5 in 10.000 steps", fixed = TRUE)
  withr::local_options(scipen = -10)
  expect_identical(count_of(1e6, "step"), "1.000.000 steps")
})

test_that("ids and names of arguments keep their case at the start of a sentence", {
  expect_identical(sentence("instance lost"), "Instance lost.")
  expect_identical(sentence("it's full, sorry"), "It's full, sorry.")
  for (text in c("phys2d/CartPole-v1 needs jax.", "frame_skip must be 1.", "walker-v0 is gone.",
                 "max_steps is missing.", "step() needs an episode.")) {
    expect_identical(sentence(text), text)
  }
})

test_that("other libraries' names of arguments lead to ours", {
  ppo <- names(formals(agent_ppo))
  expect_identical(nearest_name("lr", ppo), "learning_rate")
  expect_identical(nearest_name("n_steps", ppo), "batch_steps")
  expect_identical(nearest_name("batch_size", ppo), "batch")
  expect_identical(nearest_name("discount", ppo), "gamma")
  expect_identical(nearest_name("alpha", names(formals(agent_q))), "learning_rate")
  expect_identical(nearest_name("n", names(formals(rollout))), "episodes")
  # A name of ours is not replaced by one that is there, too.
  expect_identical(nearest_name("stepsize", names(formals(agent_ars))), "step_size")
  # Each leads to an argument that some function has.
  exported <- mget(getNamespaceExports("gym"), asNamespace("gym"), "function", list(NULL))
  known <- unlist(lapply(Filter(is.function, exported), function(f) names(formals(f))))
  expect_identical(setdiff(unlist(other_names), known), character())
  expect_identical(names(other_names), plain_name(names(other_names)))
})

test_that("nothing is left that a terminal obeys", {
  escapes <- c(
    "\033[31mred\033[0m", "\033]0;title\007end", "\033]8;;http://x\033\\link\033]8;;\033\\",
    "a\bb\rc\ad", "\u009b31mC1", "right\u202eto\u2066left\u200f", "\177"
  )
  shown <- shown_text(escapes)
  codes <- unlist(lapply(shown, utf8ToInt))
  expect_false(any(codes < 32 | codes %in% c(127:159, 0x202a:0x202e, 0x2066:0x2069)))
  expect_identical(shown[[1]], "red")
  expect_identical(shown[[6]], "righttoleft")
})

test_that("ordinary text stays as it is, with its names", {
  text <- c(i = "Zwei Zeilen,\nein\tTab: \u00e4\u00f6\u00fc \u2713 {not evaluated}", "")
  expect_identical(shown_text(text), text)
  expect_identical(shown_line("a\n\tb"), "a b")
  expect_null(shown_text(NULL))
})

test_that("long text is cut, invalid text is shown", {
  expect_identical(nchar(shown_text(strrep("\u00e4", 1e6))), longest_shown + 3L)
  expect_identical(shown_text("a\xffb"), "a<ff>b")
})

test_that("an error shows no server's escapes, however long it is", {
  nasty <- paste0("\\u001b[2J\\u001b]0;x\\u0007{stop('run')} \\u202egnp", strrep("x", 1e5))
  problem <- sprintf('{"message":"%s","code":"\\u001b[2Jbad","hint":"%s","extra":[1]}',
                     nasty, nasty)
  server <- local_canned_server(
    list("/v1/envs/" = list(status = 400, text = problem))
  )
  error <- expect_error(env_list_all(server), class = "gym_error_http_400")
  message <- conditionMessage(error)
  expect_false(grepl("[\u001b\u0007\u202e]", message))
  expect_match(message, "{stop('run')}", fixed = TRUE)
  expect_lt(nchar(message), 1e4)
  expect_identical(error$code, "bad")
  expect_false(grepl("[\u001b\u202e]", paste(capture.output(print(error)), collapse = "\n")))
})

test_that("what a program calls itself shows no escapes", {
  expect_identical(server_name(list(headers = list(server = "\033[2JFish\a/1.0"))), "Fish/1.0")
})

test_that("what is printed of an environment shows no server's escapes", {
  server <- local_bad_environment(
    env_id = "\u001b[2JCart\u202ePole\n", autoreset_mode = "\u001b[2J",
    vectorization_mode = "\u0007",
    num_envs = 2
  )
  env <- gym_make("CartPole-v1", client = server)
  expect_false(any(grepl("[\u001b\u0007\u202e]", capture.output(print(env)))))
  expect_identical(env$spec$id, "CartPole ")
  space <- new_space(list(name = "Dict", spaces = list(list(
    key = "\033[2Jkey", space = list(name = "Discrete", n = 2L)
  ))))
  expect_identical(format(space), "<Dict (key: Discrete 2)>")
  # A key is data: it stays what it is.
  expect_named(space$spaces, "\033[2Jkey")
})

test_that("what is listed shows no server's escapes", {
  instance <- paste0(
    '{"instances":[{"instance_id":"a","env_id":"\\u001b[2Jx","name":"\\u202ey","num_envs":null,',
    '"age_seconds":1,"idle_seconds":0.5,"steps":3,"watched":false}]}'
  )
  server <- local_canned_server(list(
    "/v1/instances/" = list(text = instance),
    "/v1/envs/" = list(text = '{"all_envs":{"a":"\\u001b[2Jx"}}')
  ))
  listed <- env_list(server)
  expect_identical(c(listed$env_id, listed$name), c("x", "y"))
  expect_identical(env_list_all(server), list(a = "x"))
})
