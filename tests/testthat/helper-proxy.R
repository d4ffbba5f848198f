# A real nginx in front of a server, with the configuration in inst/examples.

skip_if_no_nginx <- function() {
  for (program in c("nginx", "openssl")) {
    testthat::skip_if_not(nzchar(Sys.which(program)), paste0("there is no ", program, " here"))
  }
}

# Makes a certificate for gym.example.org.
make_certificate <- function(folder) {
  run_quietly(Sys.which("openssl"), c(
    "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2",
    "-keyout", file.path(folder, "privkey.pem"), "-out", file.path(folder, "fullchain.pem"),
    "-subj", "/CN=gym.example.org", "-addext", "subjectAltName=DNS:gym.example.org"
  ))
  file.path(folder, "fullchain.pem")
}

# Writes the package's file with other paths and ports, inside the usual parts of an nginx.conf.
write_nginx_conf <- function(folder, port, server_port, keepalive) {
  ours <- readLines(system.file("examples", "nginx.conf", package = "gym"))
  if (!keepalive) {
    kept <- grepl("^    keepalive( 64|_timeout 10s);$", ours)
    testthat::expect_identical(sum(kept), 2L)
    ours <- ours[!kept]
  }
  changes <- c(
    "/etc/ssl/gym" = folder, "/var/log/nginx" = folder,
    "server 127.0.0.1:5000" = paste0("server 127.0.0.1:", server_port),
    "listen 443 ssl" = paste0("listen 127.0.0.1:", port, " ssl")
  )
  for (there in names(changes)) {
    testthat::expect_true(any(grepl(there, ours, fixed = TRUE)), info = there)
    ours <- gsub(there, changes[[there]], ours, fixed = TRUE)
  }
  file <- file.path(folder, "nginx.conf")
  writeLines(c(
    "daemon off; master_process off;", paste0("pid ", folder, "/nginx.pid;"),
    "events { worker_connections 1024; }", "http {",
    paste0(c("client_body", "proxy", "fastcgi", "uwsgi", "scgi"), "_temp_path ", folder, "/temp;"),
    ours, "}"
  ), file)
  file
}

#' Start an nginx before a server
#' @param keepalive Does nginx keep connections to the server open, as the file advises for a server
#'   without `--users`?
#' @return A list of `url`, `config`, with which httr accepts the certificate and finds the name on
#'   this machine, and `folder`, to which nginx writes.
#' @noRd
local_proxy <- function(server, keepalive = TRUE, frame = parent.frame()) {
  skip_if_no_nginx()
  folder <- withr::local_tempdir(.local_envir = frame)
  port <- free_port()
  certificate <- make_certificate(folder)
  conf <- write_nginx_conf(folder, port, sub(".*:", "", server$remote_base), keepalive)
  nginx <- processx::process$new(
    Sys.which("nginx"), c("-c", conf, "-p", folder),
    stdout = NULL, stderr = file.path(folder, "errors")
  )
  withr::defer(nginx$kill(), envir = frame)
  place <- paste0("gym.example.org:", port)
  list(
    url = paste0("https://", place),
    folder = folder,
    config = httr::config(cainfo = certificate, resolve = paste0(place, ":127.0.0.1"))
  )
}

# Starts an nginx in front of a new server that requires a token. Also returns the server, and a
# client.
local_proxied_server <- function(frame = parent.frame()) {
  server <- local_locked_server(allow_host = "gym.example.org", frame = frame)
  proxy <- local_proxy(server, frame = frame)
  client <- create_GymClient(proxy$url, config = proxy$config, token = token_text)
  expect_identical(await_answer(client)$status, "ok")
  c(proxy, list(server = server, client = client))
}

# Waits until nginx answers.
await_answer <- function(client, seconds = 10) {
  deadline <- Sys.time() + seconds
  repeat {
    health <- tryCatch(get_request(client, "/v1/health/"), gym_error_connection = identity)
    if (!inherits(health, "error") || Sys.time() > deadline) {
      return(health)
    }
    Sys.sleep(0.05)
  }
}

# Lets another process take a step in half a second.
step_soon <- function(server, instance_id) {
  code <- paste(
    "import json, sys, time, urllib.request",
    "time.sleep(0.5)",
    "headers = {'Authorization': 'Bearer ' + sys.stdin.readline().strip()}",
    "body = json.dumps({'action': 1}).encode()",
    "urllib.request.urlopen(urllib.request.Request(sys.argv[1], body, headers)).read()",
    sep = "\n"
  )
  url <- paste0(server$remote_base, "/v1/envs/", instance_id, "/step/")
  process <- processx::process$new(working_python(), c("-c", code, url), stdin = "|")
  processx::conn_write(process$get_input_connection(), paste0(server$token(), "\n"))
  process
}
