# A report of a session of which all that takes time is known.
report <- function(problem = NULL, frame = parent.frame()) {
  local_functions(
    python_candidates = function(python = NULL) python %||% "/some/python3",
    python_problem = function(...) problem,
    installed_server = function() NULL,
    find_uv = function(...) NULL,
    frame = frame
  )
  withr::local_envvar(GYM_PYTHON = NA, GYM_SERVER_URL = NA,
                      R_USER_CACHE_DIR = withr::local_tempdir(.local_envir = frame),
                      .local_envir = frame)
  local_session(servers = list(), client = NULL, frame = frame)
}

sitrep <- function() {
  found <- NULL
  lines <- capture.output(found <- gym_sitrep())
  list(found = found, lines = lines, text = paste(lines, collapse = "\n"))
}

test_that("where all is well the report says so on one screen", {
  report()
  seen <- sitrep()
  expect_s3_class(seen$found, "gym_sitrep")
  expect_named(seen$found, c("topic", "what", "finding", "state", "fix"))
  expect_false(any(seen$found$state == "wrong"))
  expect_lte(length(seen$lines), 25)
  expect_match(seen$text, "Nothing is wrong", fixed = TRUE)
  expect_match(seen$text, "/some/python3: runs the server", fixed = TRUE)
  expect_match(seen$text, paste0("gym: ", packageVersion("gym")), fixed = TRUE)
  expect_identical(capture.output(print(seen$found)), seen$lines)
})

test_that("without a Python the report names the call that fixes it", {
  report("No module named 'flask'")
  seen <- sitrep()
  wrong <- seen$found[seen$found$state == "wrong", ]
  expect_identical(wrong$what, "Python")
  expect_identical(wrong$fix, "gym_server_install()")
  expect_match(seen$text, "No module named 'flask'", fixed = TRUE)
  expect_match(seen$text, "1 thing is wrong", fixed = TRUE)
})

test_that("a session that plays on another machine needs no Python", {
  url <- local_server(token = FALSE)$remote_base
  report("No module named 'flask'")
  withr::local_envvar(GYM_SERVER_URL = url)
  seen <- sitrep()
  expect_match(seen$text, "Nothing is wrong", fixed = TRUE)
  expect_match(seen$text, "none, gym_client() uses GYM_SERVER_URL", fixed = TRUE)
})

test_that("a Python that GYM_PYTHON names and that cannot run the server is wrong", {
  report("Python 3.10 or newer is needed")
  withr::local_envvar(GYM_PYTHON = "/some/python3")
  found <- sitrep()$found
  row <- found[startsWith(found$what, "/some/python3"), ]
  expect_identical(row$state, "wrong")
  expect_identical(row$fix, "Sys.unsetenv(\"GYM_PYTHON\")")
})

test_that("the installed environment is reported: complete or damaged", {
  report()
  environment_row <- function() {
    found <- sitrep()$found
    found[found$what == "environment", ]
  }
  expect_identical(environment_row()$state, "note")
  dir.create(environment_folder(), recursive = TRUE)
  expect_match(environment_row()$finding, "damaged")
  expect_identical(environment_row()$fix, "gym_server_install()")
  local_functions(
    installed_server = function() list(python = "p", folder = "/some", extras = "box2d")
  )
  expect_identical(environment_row()$finding, "/some (extras: box2d)")
})

test_that("an installed Python that cannot run the server is wrong", {
  report("RuntimeError: damaged by hand")
  python <- file.path(install_root(), "0ff", "bin", "python")
  local_functions(python_candidates = function(...) python)
  found <- sitrep()$found
  row <- found[startsWith(found$what, python), ]
  expect_identical(row$state, "wrong")
  expect_identical(row$fix, "gym_server_install()")
  expect_identical(sum(found$state == "wrong"), 1L)
})

test_that("the session's server is reported with its environments, also when it died", {
  server <- test_client()
  known <- the_session$servers
  python <- known[[server$remote_base]]$python
  report()
  local_session(servers = known[server$remote_base], client = server)
  id <- env_create(server, "CartPole-v1")
  withr::defer(env_close(server, id))
  server_row <- function() {
    found <- sitrep()$found
    found[found$topic == "servers", ]
  }
  row <- server_row()
  expect_match(row$what, server$remote_base, fixed = TRUE)
  # Tests of other files may have left some.
  count <- length(env_list_all(server))
  expect_match(row$finding, paste0(
    "^", count, " environments?, pid [0-9]+, server .*, Gymnasium .*, Python 3"
  ))
  expect_identical(row$state, "ok")

  other <- gym_server_start(python = python)
  the_session$servers[[other$remote_base]]$process$kill()
  local_session(servers = the_session$servers[other$remote_base], client = other)
  row <- server_row()
  expect_match(row$finding, "has ended: It was killed")
  expect_identical(row$state, "wrong")
  expect_identical(row$fix, "gym_server_log()")
})

test_that("the server that GYM_SERVER_URL names is looked at, its password kept", {
  report()
  port <- free_port()
  withr::local_envvar(GYM_SERVER_URL = paste0("http://127.0.0.1:", port))
  found <- sitrep()$found
  row <- found[grepl("(GYM_SERVER_URL)", found$what, fixed = TRUE), ]
  expect_identical(row$state, "wrong")
  expect_identical(row$fix, paste0("gym_server_start(port = ", port, ")"))
  withr::local_envvar(GYM_SERVER_URL = paste0("http://ann:secret@127.0.0.1:", port))
  seen <- sitrep()
  expect_no_match(seen$text, "secret")
  withr::local_envvar(GYM_SERVER_URL = "127.0.0.1:5000")
  expect_match(sitrep()$text, "is not the address of a server", fixed = TRUE)
})

test_that("what goes wrong in finding out is a finding", {
  report()
  local_functions(
    find_uv = function(...) gym_abort("GYM_UV names no uv.", class = "gym_error_install"),
    environment_folder = function() stop("the disk is gone"),
    python_problem = function(...) stop("no processes")
  )
  seen <- sitrep()
  expect_match(seen$text, "the disk is gone", fixed = TRUE)
  expect_match(seen$text, "no processes", fixed = TRUE)
  expect_match(seen$text, "GYM_UV names no uv", fixed = TRUE)
})

test_that("the real report asks nothing, changes nothing and takes no server", {
  withr::local_options(rlang_interactive = TRUE)
  local_functions(
    read_answer_line = function(prompt) stop("asked: ", prompt),
    gym_server_install = function(...) stop("installed")
  )
  cache <- withr::local_tempdir()
  withr::local_envvar(R_USER_CACHE_DIR = cache, GYM_PYTHON = NA)
  servers <- the_session$servers
  set.seed(1)
  before <- .Random.seed
  seen <- sitrep()
  expect_identical(.Random.seed, before)
  expect_lte(length(seen$lines), 25)
  expect_identical(the_session$servers, servers)
  expect_identical(list.files(cache, recursive = TRUE, include.dirs = TRUE), character())
})

test_that("what could not be found out is wrong", {
  report()
  local_functions(sitrep_own_servers = function(...) stop("Unknown option: timeout_ms"))
  seen <- sitrep()
  expect_match(seen$text, "could not be determined: Unknown option", fixed = TRUE)
  expect_no_match(seen$text, "Nothing is wrong", fixed = TRUE)
})

test_that("a slow BLAS is named, with what a faster one brings", {
  slow <- c("", "/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.11.0", "/opt/R/lib/libRblas.so")
  for (file in slow) {
    expect_match(sitrep_blas(file)$finding, "OpenBLAS .* about twice as fast")
    expect_identical(sitrep_blas(file)$state, "note")
  }
  fast <- paste0("/usr/lib/x86_64-linux-gnu/openblas-pthread/",
                 c("libopenblasp-r0.3.21.so", "libblas.so.3"))
  for (file in fast) {
    expect_identical(sitrep_blas(file)[c("finding", "state")],
                     data.frame(finding = file, state = "ok"))
  }
  expect_identical(sum(sitrep()$found$what == "BLAS"), 1L)
})
