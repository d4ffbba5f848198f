test_that("a JSON answer has no tensors, whatever the server calls a field", {
  content <- charToRaw('{"reward":1,"tensors":{"observation":["text"]}}')
  response <- list(status_code = 200L, type = json_type, content = content)
  expect_identical(with_answer(response)$answer, list(reward = 1L))
})

test_that("what is no answer of a Gym server is an error with a class", {
  read <- function(status, body) {
    parse_server_error_or_raise_for_status(structure(
      list(status_code = status, content = charToRaw(body), url = "http://127.0.0.1:1/",
           type = "text/html", request = list(method = "GET")),
      class = "response"
    ))
  }
  expect_error(read(200, "<html>"), class = "gym_error_connection")
  expect_error(read(200, "\"oops\""), class = "gym_error_connection")
  expect_error(read(302, ""), class = "gym_error_connection")
  expect_error(read(520, "\"oops\""), class = "gym_error_http_520")
})

test_that("another kind of server is distinguished from a Gym server", {
  python <- working_python()
  folder <- withr::local_tempdir()
  dir.create(file.path(folder, "v1", "envs"), recursive = TRUE)
  writeLines("<html>", file.path(folder, "v1", "envs", "index.html"))
  log <- file.path(folder, "log")
  process <- processx::process$new(
    python, c("-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", folder),
    stdout = log, stderr = NULL
  )
  withr::defer(process$kill())
  while (process$is_alive() && !length(readLines(log))) Sys.sleep(0.05)
  client <- create_GymClient(sub(".*(http://[0-9.:]+).*", "\\1", readLines(log)[[1]]))
  expect_error(env_list_all(client), "not come from a Gym server", class = "gym_error_connection")
  expect_error(env_create(client, "CartPole-v1"), class = "gym_error_http_501")
})

# The bound is on all that a server may send; what libcurl holds beside it is little.
flooded <- function(how) {
  create_GymClient(local_bad_server("flood", how, frame = parent.frame()), timeout = 30)
}

test_that("an answer without an end is ended", {
  skip_unless_all()
  withr::local_options(gym.max_answer_bytes = 2^24)
  for (how in c("chunks", "length")) {
    client <- flooded(how)
    error <- expect_error(env_list_all(client), "16,777,216 bytes", class = "gym_error_connection")
    expect_match(conditionMessage(error), "gym.max_answer_bytes", fixed = TRUE)
    # It is not taken for an interrupt, and the next call is none the worse.
    expect_error(env_create(client, "CartPole-v1"), "16,777,216", class = "gym_error_connection")
  }
})

test_that("what came packed is not unpacked", {
  skip_unless_all()
  # It would be good JSON.
  client <- create_GymClient(local_bad_server("packed"))
  expect_error(env_list_all(client), "not come from a Gym server", class = "gym_error_connection")
})

test_that("headers without an end are ended", {
  expect_error(env_list_all(flooded("headers")), class = "gym_error_connection")
})

test_that("an answer in JSON may have a sixteenth", {
  server <- local_canned_server(list("/v1/envs/" = list(text = paste0(
    "{\"all_envs\":{}", strrep(" ", 2e5), "}"
  ))))
  expect_identical(env_list_all(server), empty_object)
  withr::local_options(gym.max_answer_bytes = 16e5)
  expect_error(env_list_all(server), "100,000 bytes", class = "gym_error_connection")
})

test_that("the largest answers of our own server fit", {
  env <- local_env("CartPole-v1", num_envs = 10000)
  expect_identical(dim(env$reset(seed = 1)), c(10000L, 4L))
  withr::local_options(gym.max_answer_bytes = 1e5)
  expect_error(env$reset(seed = 1), "100,000 bytes", class = "gym_error_connection")
})

test_that("the option must be a number", {
  withr::local_options(gym.max_answer_bytes = "many")
  env <- local_env("CartPole-v1", num_envs = 10000)
  expect_error(env$reset(), "gym.max_answer_bytes", class = "gym_error_argument")
})

# Types -----------------------------------------------------------------------------------

expect_wrong <- function(object, pattern) {
  expect_error(object, pattern, class = "gym_error_connection")
}

answers <- function(text) list(text = text)
at <- function(route) paste0("/v1/envs/0a1b2c3d/", route)

with_field <- function(fields, ...) {
  given <- list(...)
  fields[names(given)] <- given
  fields
}

# A safetensors file of some tensors, as an answer. Each is a list of dtype, shape and bytes.
tensors_answer_of <- function(tensors, fields = c(info = "{}")) {
  bytes <- write_tensors(tensors, fields)
  list(type = tensors_type, hex = paste(format(bytes), collapse = ""))
}

float64 <- function(numbers, shape = integer()) {
  list(dtype = "F64", shape = shape, bytes = writeBin(as.double(numbers), raw()))
}

flags <- function(values, shape = integer()) {
  list(dtype = "BOOL", shape = shape, bytes = as.raw(values))
}

test_that("an instance id is a string", {
  server <- local_bad_environment()
  for (id in c("[\"a\",\"b\"]", "null", "17", "{\"a\":\"b\"}")) {
    say(server, "/v1/envs/" = answers(sprintf('{"instance_id":%s}', id)))
    expect_wrong(env_create(server, "Bad-v0"), "instance_id")
  }
})

test_that("an old server, which does not describe its environments, is named", {
  server <- local_bad_environment()
  say(server, "/v1/envs/" = answers('{"instance_id":"0a1b2c3d"}'))
  error <- expect_error(env_create(server, "CartPole-v0"), "gym_server_start()", fixed = TRUE,
                        class = "gym_error_http")
  expect_identical(error$code, "not_supported")
  expect_error(gym_make("CartPole-v1", client = server), "old one", class = "gym_error_http")
})

test_that("a step's answer may have numbers that are none", {
  server <- local_bad_environment()
  env_reset(server, "0a1b2c3d")
  words <- good_step(reward = '"NaN"', observation = '["Infinity","NaN"]', info = '{"a":"NaN"}')
  say(server, "/v1/envs/0a1b2c3d/stream/" = answers(words))
  out <- env_step(server, "0a1b2c3d", 1)
  expect_identical(out$reward, NaN)
  expect_identical(out$observation, c(Inf, NaN))
})

test_that("a step's answer says which field is wrong", {
  skip_unless_all()
  server <- local_bad_environment()
  env_reset(server, "0a1b2c3d")
  wrong <- list(
    c(reward = paste0("[", toString(1:16), "]")), c(reward = "null"), c(reward = '"much"'),
    c(terminated = "2"), c(truncated = "[]"), c(info = "3"), c(info = "[1,2]"),
    c(observation = "[0]"), c(observation = "[0,1,2]"), c(observation = '["a","b"]'),
    c(observation = "null")
  )
  for (field in wrong) {
    say(server, "/v1/envs/0a1b2c3d/stream/" = answers(good_step(field)))
    expect_wrong(env_step(server, "0a1b2c3d", 1), names(field))
  }
  say(server, "/v1/envs/0a1b2c3d/stream/" = answers(good_step()))
  expect_identical(env_step(server, "0a1b2c3d", 1)$observation, c(0, 1))
  # A reset is read in the same way.
  say(server, "/v1/envs/0a1b2c3d/stream/" = answers('{"observation":[1],"info":{}}'))
  expect_wrong(env_reset(server, "0a1b2c3d"), "observation")
  say(server, "/v1/envs/0a1b2c3d/stream/" = answers('{"observation":[1,1],"info":"x"}'))
  expect_wrong(env_reset(server, "0a1b2c3d"), "info")
})

test_that("a step's answer of a vector environment has an element for each", {
  server <- local_bad_environment(num_envs = 2L, action_space = list(
    name = "Text", min_length = 0L, max_length = 5L, characters = "abc"
  ), observation_space = list(
    name = "Text", min_length = 0L, max_length = 5L, characters = "abc"
  ))
  step <- function(...) {
    fields <- c(
      observation = '["a","b"]', reward = "[1,2]", done = "[true,false]",
      terminated = "[true,false]", truncated = "[false,false]", info = "{}"
    )
    given <- c(...)
    fields[names(given)] <- given
    route <- list(answers(json_object(fields)))
    names(route) <- at("stream/")
    do.call(say, c(list(server), route))
    env_step(server, "0a1b2c3d", c("a", "b"))
  }
  # Texts alone travel as tensors, too, where they can.
  local_functions(travels_as_tensors = function(...) FALSE)
  out <- step()
  expect_identical(out$observation, c("a", "b"))
  wrong <- list(
    c(reward = "1"), c(reward = '["x",1]'), c(terminated = "[true]"),
    c(truncated = "[true,null]"), c(truncated = "[1,0]"), c(info = "[1]"),
    c(observation = '["a"]'), c(observation = "[1,2]"), c(observation = '"ab"')
  )
  for (field in wrong) expect_wrong(step(field), names(field))
})

test_that("tensors have the shape of their space", {
  box <- list(
    name = "Box", shape = list(10L, 10L, 3L), dtype = "float64", low = list(-1), high = list(1)
  )
  server <- local_bad_environment(observation_space = box)
  good <- list(
    observation = float64(1:300, c(10L, 10L, 3L)), reward = float64(1),
    terminated = flags(FALSE), truncated = flags(FALSE)
  )
  step <- function(...) {
    route <- list(tensors_answer_of(with_field(good, ...)))
    names(route) <- at("stream/")
    do.call(say, c(list(server), route))
    env_step(server, "0a1b2c3d", 1)
  }
  expect_identical(dim(step()$observation), c(10L, 10L, 3L))
  expect_wrong(step(observation = float64(numeric(), c(2e9L, 2e9L, 0L))), "\\[2000000000|2e\\+09")
  expect_wrong(step(observation = float64(1:300, 300L)), "shape")
  expect_wrong(step(observation = float64(1:300, c(3L, 10L, 10L))), "shape")
  expect_wrong(step(reward = float64(1:16, 16L)), "reward")
  expect_wrong(step(reward = flags(TRUE)), "reward")
  expect_wrong(step(terminated = float64(1)), "terminated")
  expect_wrong(step(truncated = flags(c(TRUE, FALSE), 2L)), "truncated")
  without <- list(tensors_answer_of(good[c("observation", "reward", "truncated")]))
  names(without) <- at("stream/")
  do.call(say, c(list(server), without))
  expect_wrong(env_step(server, "0a1b2c3d", 1), "terminated")
})

test_that("tensors of a vector environment have a row for each", {
  server <- local_bad_environment(num_envs = 3L)
  good <- list(
    observation = float64(1:6, c(3L, 2L)), reward = float64(1:3, 3L),
    terminated = flags(logical(3), 3L), truncated = flags(logical(3), 3L)
  )
  step <- function(...) {
    route <- list(tensors_answer_of(with_field(good, ...)))
    names(route) <- at("stream/")
    do.call(say, c(list(server), route))
    env_step(server, "0a1b2c3d", c(0, 1, 0))
  }
  expect_identical(dim(step()$observation), c(3L, 2L))
  expect_wrong(step(observation = float64(1:4, c(2L, 2L))), "shape")
  expect_wrong(step(reward = float64(1:2, 2L)), "reward")
  expect_wrong(step(terminated = flags(logical(4), 4L)), "terminated")
})

test_that("the fields of an environment's description have their types", {
  skip_unless_all()
  about <- function(...) {
    server <- local_bad_environment(...)
    env_action_space_info(server, "0a1b2c3d")
  }
  expect_identical(about()$n, 2L)
  expect_wrong(about(num_envs = "many"), "num_envs")
  expect_wrong(about(num_envs = 2e9), "num_envs")
  expect_wrong(about(num_envs = c(1, 2)), "num_envs")
  expect_wrong(about(env_id = 1:3), "env_id")
  expect_wrong(about(max_episode_steps = "few"), "max_episode_steps")
  expect_wrong(about(reward_threshold = c(1, 2)), "reward_threshold")
  expect_wrong(about(action_space = "Discrete"), "space")
  expect_wrong(about(action_space = list(name = c("Box", "Discrete"))), "space")
  box <- list(name = "Box", shape = list(2), low = list(0), high = list(1), dtype = "float32")
  expect_identical(about(action_space = box)$shape, 2L)
  expect_wrong(about(action_space = list(name = "Dict", spaces = 3)), "cannot be read")
})

test_that("values of nested spaces have their form", {
  box <- list(name = "Box", shape = list(2L), dtype = "float64", low = list(-1), high = list(1))
  discrete <- list(name = "Discrete", n = 3L)
  spaces <- list(
    tuple = new_space(list(name = "Tuple", spaces = list(box, discrete))),
    dict = new_space(list(name = "Dict", spaces = list(list(key = "a", space = box)))),
    oneof = new_space(list(name = "OneOf", spaces = list(box, discrete))),
    sequence = new_space(list(name = "Sequence", space = discrete, stack = FALSE)),
    stacked = new_space(list(name = "Sequence", space = box, stack = TRUE)),
    graph = new_space(list(name = "Graph", node_space = box, edge_space = NULL)),
    bits = new_space(list(name = "MultiBinary", shape = list(2L)))
  )
  wrong <- list(
    tuple = list("[[0,1]]", "3", "[1,[0,1]]", '[[0,1],"a"]', "[[0,1],[1,2]]"),
    dict = list("[[0]]", '{"b":[0,1]}', "3"),
    oneof = list("[2,1]", "[0.5,1]", '["a",1]', "[1]", "[[0],1]"),
    sequence = list("3", "[[1,2]]", '["a"]'),
    stacked = list("[[1,2],[3]]", "[[1,2],[3,null]]"),
    graph = list("3", '{"nodes":[[1]],"edges":null}'),
    bits = list("[1]", '["a","b"]', "[0,null]")
  )
  for (kind in names(wrong)) {
    for (json in wrong[[kind]]) {
      answer <- list(observation = from_json(json))
      expect_wrong(read_observation(spaces[[kind]], answer), "")
    }
  }
})

test_that("what is asked of a space has its types", {
  server <- local_bad_environment()
  id <- "0a1b2c3d"
  for (member in c("1", "[true]", '"true"')) {
    route <- list(answers(sprintf('{"member":%s}', member)))
    names(route) <- at("action_space/contains")
    do.call(say, c(list(server), route))
    expect_wrong(env_action_space_contains(server, id, 1), "member")
  }
  for (action in c("[1,2]", "null", '"a"', "{}")) {
    route <- list(answers(sprintf('{"action":%s}', action)))
    names(route) <- at("action_space/sample")
    do.call(say, c(list(server), route))
    expect_wrong(env_action_space_sample(server, id), "")
  }
})

test_that("lists have columns of their types", {
  server <- local_canned_server()
  listed <- function(...) {
    one <- c(instance_id = '"a"', env_id = '"x"', age_seconds = "1", idle_seconds = "1",
             steps = "3", watched = "false", num_envs = "null", name = "null")
    given <- c(...)
    one[names(given)] <- given
    route <- answers(sprintf('{"instances":[%s]}', json_object(one)))
    say(server, "/v1/instances/" = route)
    env_list(server)
  }
  expect_identical(listed()$steps, 3)
  for (field in list(c(instance_id = "[1]"), c(env_id = "1"), c(steps = '"a"'), c(watched = "1"),
                     c(num_envs = "1.5"), c(age_seconds = "[1,2]"), c(name = "{}"))) {
    expect_wrong(listed(field), names(field))
  }
  for (registry in c('{"environments":3}', '{"environments":[{"id":3}]}',
                     '{"environments":[{"id":"a","max_episode_steps":"b"}]}')) {
    say(server, "/v1/registry/" = answers(registry))
    expect_wrong(env_registry(server), "is invalid")
  }
  for (all_envs in c("3", '{"all_envs":3}', '{"all_envs":["a"]}')) {
    say(server, "/v1/envs/" = answers(all_envs))
    expect_wrong(env_list_all(server), "")
  }
})

test_that("a picture that is much larger when it is unpacked is refused", {
  server <- local_bad_environment()
  huge <- c(as.raw(c(0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a)), raw(8),
            writeBin(c(100000L, 100000L), raw(), endian = "big"), raw(20))
  route <- list(list(type = "image/png", hex = paste(format(huge), collapse = "")))
  names(route) <- at("render/")
  do.call(say, c(list(server), route))
  expect_wrong(png_frame(server, "0a1b2c3d"), "pixels")
})

test_that("a watch page's key cannot change its address", {
  server <- local_bad_environment()
  local_functions(check_viewer = function(...) FALSE)
  for (key in c('"a&b=c d"', "3", '["a"]', '"a\\u001b"')) {
    route <- list(answers(sprintf('{"key":%s}', key)))
    names(route) <- at("watch/key/")
    do.call(say, c(list(server), route))
    expect_wrong(env_watch(server, "0a1b2c3d"), "key")
  }
})

test_that("JSON nested without an end is no crash", {
  server <- local_canned_server(list("/v1/envs/" = list(text = strrep("[", 1e6))))
  expect_wrong(env_list_all(server), "")
})
