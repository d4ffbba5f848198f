test_that("a JSON answer has no tensors, whatever the server calls a field", {
  content <- charToRaw('{"reward":1,"tensors":{"observation":["text"]}}')
  response <- list(status_code = 200L, type = json_type, content = content)
  expect_identical(parsed_body(response), list(reward = 1L))
})
