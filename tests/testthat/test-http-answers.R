# As our server writes a file: metadata last, blanks at the end of the header.
file_with <- function(metadata, numbers = 3:4) {
  table <- sprintf('{"observation":{"dtype":"U8","shape":[%d],"data_offsets":[0,%d]}',
                   length(numbers), length(numbers))
  header <- charToRaw(paste0(table, ',"__metadata__":', metadata, "}"))
  header <- c(header, rep(charToRaw(" "), -length(header) %% 64L))
  size <- writeBin(c(length(header), 0L), raw(), endian = "little")
  c(size, header, as.raw(numbers))
}

key_of <- function(number) list(key = "k", number = number)

bare_for <- function(number) {
  sprintf('{"info":"{}","request":"{\\"key\\":\\"k\\",\\"number\\":%d}"}', number)
}

response_of <- function(content, status = 200L, type = tensors_type) {
  list(status_code = status, type = type, content = content)
}

# Notes which way answers are read.
noting_reader <- function(ways, labels = c("a", "b")) {
  new_tensors_reader(
    read_answer = function(answer) {
      ways$all <- c(ways$all, if ("texts" %in% names(answer)) "metadata" else "tensors")
      answer
    },
    labels = labels
  )
}

test_that("an answer like the last one that says nothing more than its tensors is read at once", {
  ways <- new.env()
  read <- noting_reader(ways)
  first <- read(response_of(file_with(bare_for(7))), key_of(7))
  expect_identical(first$tensors, list(observation = c(a = 3L, b = 4L)))
  expect_identical(first$info, empty_object)
  second <- read(response_of(file_with(bare_for(8), 5:6)), key_of(8))
  expect_identical(second$tensors, list(observation = c(a = 5L, b = 6L)))
  expect_identical(ways$all, c("metadata", "tensors"))
})

test_that("metadata are left unread only where they are what was expected", {
  ways <- new.env()
  read <- noting_reader(ways)
  read(response_of(file_with(bare_for(7))), key_of(7))
  info <- '{"info":"{\\"a\\":1}",'
  others <- c(
    sub('{"info":"{}",', info, bare_for(8), fixed = TRUE),
    sub('{"info":"{}",', '{"info":"{}","final_sub_envs":"[0]",', bare_for(8), fixed = TRUE),
    sub('"}$', '","error":"{}"}', bare_for(8)),
    sub("{}", "[]", bare_for(8), fixed = TRUE)
  )
  answers <- lapply(others, function(other) read(response_of(file_with(other)), key_of(8)))
  expect_identical(ways$all, rep("metadata", 5))
  expect_identical(answers[[1]]$info, list(a = 1L))
  expect_identical(answers[[2]]$final_sub_envs, list(0L))
  expect_identical(answers[[3]]$error, empty_object)
})

test_that("an answer of another layout, or cut short, is read by its own header", {
  ways <- new.env()
  read <- noting_reader(ways, labels = NULL)
  content <- file_with(bare_for(7))
  read(response_of(content), key_of(7))
  longer <- read(response_of(file_with(bare_for(8), 1:9)), key_of(8))
  expect_identical(longer$tensors$observation, 1:9)
  cut <- utils::head(content, -1)
  expect_error(read(response_of(cut), key_of(7)), class = "gym_error_connection")
  expect_null(read(response_of(content, 400L), key_of(7)))
  expect_identical(ways$all, c("metadata", "metadata"))
})

test_that("the layout of a long header is not remembered", {
  entries <- sprintf(
    '"%d":{"dtype":"U8","shape":[1],"data_offsets":[%d,%d]}', 1:2000, 0:1999, 1:2000
  )
  header <- charToRaw(paste0("{", paste(entries, collapse = ","), "}"))
  content <- c(writeBin(c(length(header), 0L), raw(), endian = "little"), header, raw(2000))
  read <- noting_reader(new.env())
  read(response_of(content), key_of(1))
  expect_null(environment(read)$layout)
})

test_that("the server's answer to a step of sub-environments is read at once", {
  env <- local_env(num_envs = 2)
  env$reset()
  env$step(c(0, 1))
  local_functions(tensors_answer = function(...) stop("it was parsed"))
  expect_identical(dim(env$step(c(0, 1))$observation), c(2L, 4L))
})

test_that("a JSON answer has no tensors, whatever the server calls a field", {
  content <- charToRaw('{"reward":1,"tensors":{"observation":["text"]}}')
  response <- response_of(content, type = json_type)
  expect_identical(new_json_reader(identity)(response, NULL), list(reward = 1L))
  expect_identical(parsed_body(response), list(reward = 1L))
})
