# Connections that are cut at any byte of a request or of an answer; every 61st here, each with
# GYM_TEST_CUTS=all (make soak).

cut_every <- function() if (identical(Sys.getenv("GYM_TEST_CUTS"), "all")) 1L else 61L

# `tell()` says where the next step is to be cut and returns how often that was done so far, and
# the sizes of the last request and answer that passed whole.
local_cutter <- function(server, way = NULL, frame = parent.frame()) {
  script <- file.path(system.file("server", package = "gym"), "tests", "cutting.py")
  if (!file.exists(script)) {
    script <- test_path("..", "..", "inst", "server", "tests", "cutting.py")
  }
  skip_if_not(file.exists(script), "the server's tests are not here")
  python <- the_session$servers[[server$remote_base]]$python
  proxy <- processx::process$new(
    python, c(script, sub(".*:", "", server$remote_base), way), stdin = "|", stdout = "|",
    stderr = NULL
  )
  withr::defer(proxy$kill(), envir = frame)
  read <- function() {
    repeat {
      proxy$poll_io(10000)
      line <- proxy$read_output_lines(1)
      if (length(line)) return(scan(text = line, quiet = TRUE))
      stopifnot(proxy$is_alive())
    }
  }
  port <- read()
  list(
    client = create_GymClient(paste0("http://127.0.0.1:", port), timeout = 20,
                              token = token_of(server)),
    tell = function(...) {
      proxy$write_input(paste0(paste(...), "\n"))
      read()
    }
  )
}

# Plays with cuts at the bytes of requests and answers, or of a stream's messages.
expect_taken_once <- function(way) {
  server <- local_server(allow_module = "odd_environments")
  cutter <- local_cutter(server, way)
  places <- c(request = 0, answer = 0)
  for (sub_envs in list(NULL, 3L)) {
    env <- local_env("CartPole-v1", seed = 7, num_envs = sub_envs, client = cutter$client)
    twin <- local_env("CartPole-v1", seed = 7, num_envs = sub_envs, client = server)
    env$reset()
    twin$reset()
    steps <- 0
    play <- function(where, after = "") {
      before <- cutter$tell(where, after)
      action <- rep(steps %% 2, max(sub_envs, 1L))
      out <- env$step(action)
      expect_identical(out, twin$step(action), info = paste(where, after))
      steps <<- steps + 1
      if (is.null(sub_envs) && (out$terminated || out$truncated)) {
        env$reset()
        twin$reset()
      }
      cutter$tell("none") - before
    }
    play("none")
    sizes <- cutter$tell("none")[2:3] + 8
    names(sizes) <- names(places)
    for (where in names(places)) {
      for (after in seq(0, sizes[[where]], by = cut_every())) {
        expect_equal(play(where, after)[[1]], 1, info = paste(where, after))
        places[[where]] <- places[[where]] + 1
      }
    }
    counted <- get_request(server, paste0("/v1/envs/", env$instance_id, "/"))$steps
    expect_equal(counted, steps * max(sub_envs, 1L))
  }
  if (nzchar(Sys.getenv("GYM_TEST_CUTS"))) {
    cat(sprintf("\ncuts-r%s: at %.0f bytes of requests and %.0f of answers, lost or doubled 0\n",
                way %||% "", places[["request"]], places[["answer"]]))
  }
}

test_that("a step by HTTP that was cut at any byte is taken once", {
  skip_unless_all()
  expect_taken_once(NULL)
})

test_that("a message of a stream that was cut at any byte is taken once", {
  skip_unless_all()
  expect_taken_once("stream")
})
