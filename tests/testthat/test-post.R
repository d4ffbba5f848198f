# The scripts of the post, unchanged, as ../shared/seed beside the checkout has
# them. They name port 5000.
post_script <- function(name) {
  folders <- c(Sys.getenv("GYM_SEED"), file.path(test_path(), "../../../shared/seed"))
  path <- file.path(folders, name)
  path <- path[file.exists(path)]
  skip_if(!length(path), "no shared/seed beside the checkout, which has the post's scripts")
  path[1]
}

local_server_5000 <- function(frame = parent.frame()) {
  tryCatch(
    local_server(port = 5000, frame = frame),
    gym_error_server_start = function(cnd) {
      testthat::skip(paste("port 5000 is taken:", conditionMessage(cnd)))
    }
  )
}

test_that("the post's search with a neural network runs as it is", {
  script <- post_script("random_search_nn.R")
  skip_if_not_installed("sigmoid")
  server <- local_server_5000()
  # The script seeds no environment. The first network of this seed is a good one: it
  # kept the pole up in 15 episodes of 15.
  set.seed(126)
  scope <- new.env(parent = globalenv())
  output <- capture.output(suppressMessages(sys.source(script, envir = scope)))
  expect_match(output, "^\\[1\\] \"Solved after: [0-9]+ rounds\"$")
  expect_length(env_list_all(server), 0)
})

test_that("the post's random policy runs as it is", {
  script <- post_script("random_policy.R")
  scope <- new.env(parent = globalenv())
  scope$server <- test_client()
  scope$instance_id <- env_create(scope$server, "CartPole-v0", seed = 1)
  withr::defer(env_close(scope$server, scope$instance_id))
  scope$i <- 1
  sys.source(script, envir = scope)
  expect_named(
    scope$dfEyes,
    c("Obs1", "Obs2", "Obs3", "Obs4", "iteration", "Reward", "Done", "action", "round")
  )
  expect_true(tail(scope$dfEyes$Done, 1))
  expect_true(all(scope$dfEyes$action[-1] %in% 0:1))
  expect_false(anyNA(scope$dfEyes[, 1:4]))
})
