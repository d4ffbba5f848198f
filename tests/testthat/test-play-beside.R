# Episodes beside the environment. That it makes no difference how they are cut, in what order
# answers come, and who plays.

# Cutting and putting together, without a server ---------------------------------------------

described <- function(group = NULL, num_envs = 7L) {
  list(num_envs = num_envs, description = list(group = group), call = quote(rollout()))
}

# An episode's return is made of what it is a function of.
return_of <- function(episodes, at) {
  seed <- as.numeric(episodes$seed)[at]
  row <- if (is.null(episodes$row)) 0 else episodes$row[at]
  seed %% 1000 + (seed %% 97 + 1) * row + episodes$candidate[at]
}

# Plays with answers that come in any order, some of them with fewer episodes than asked for.
play_by_chance <- function(play, chance, fails = integer()) {
  open <- list()
  withr::with_seed(chance, repeat {
    play$size <- sample.int(5L, 1L)
    while (length(open) < 2L && !is.null(piece <- take_piece(play))) {
      open <- c(open, list(piece))
    }
    i <- sample.int(length(open), 1L)
    piece <- open[[i]]
    open <- open[-i]
    at <- piece$first:piece$last
    short <- runif(1) < 0.3 && is.null(play$episodes$row)
    if (short) at <- at[seq_len(sample.int(length(at), 1L))]
    error <- NULL
    if (any(at %in% fails)) {
      at <- at[at < min(at[at %in% fails])]
      error <- list(
        status_code = 400L, url = "http://localhost/",
        answer = list(message = "it fell", code = "environment_error")
      )
    }
    batch <- c(lapply(play$episodes, `[`, at), list(return = return_of(play$episodes, at)))
    if (take_played(play, piece, batch, error)) break
  })
}

entered <- function(candidates, each, chance, group = NULL, common = FALSE, ..., fails = integer(),
                    most = 4L) {
  history <- new_history(candidates, each, new_streams(1), common_seeds = common)
  vector_env <- described(group)
  play <- new_play(
    vector_env, list_episodes(vector_env, history, most), NULL, Inf, character(), most = most,
    each = history$episodes, ..., enter = function(batch) enter_batch(history, batch)
  )
  error <- tryCatch(
    {
      play_by_chance(play, chance, fails)
      NULL
    },
    gym_error_http = identity
  )
  columns <- names(history$batches[[1L]])
  columns <- lapply(stats::setNames(nm = columns), function(name) {
    unlist(lapply(history$batches, `[[`, name))
  })
  list(columns = columns, error = error)
}

test_that("it makes no difference how episodes are cut, and in what order answers come", {
  first <- entered(6, 5, 1)$columns
  expect_identical(first$candidate, rep(1:6, each = 5))
  expect_identical(first$episode, rep(1:5, 6))
  expect_identical(first$sub_env, rep_len(1:7, 30))
  for (chance in 2:20) {
    expect_identical(entered(6, 5, chance, most = chance)$columns, first)
  }
})

test_that("a group is consecutive episodes with one seed, and no piece divides it", {
  first <- entered(20, 3, 1, group = 8L, most = 20L)$columns
  expect_identical(first$row, rep_len(0:7, 60))
  expect_identical(lengths(rle(first$seed)), c(lengths = 8L, values = 8L))
  expect_identical(first$sub_env, first$row + 1L)
  for (chance in 2:10) {
    expect_identical(entered(20, 3, chance, group = 8L, most = 20L)$columns, first)
  }
  history <- new_history(20, 3, new_streams(1))
  play <- new_play(described(8L), list_episodes(described(8L), history, 20L), NULL, Inf, "", NULL)
  while (!is.null(piece <- take_piece(play, 3L))) {
    expect_identical(play$episodes$row[[piece$first]], 0L)
    expect_true(piece$last == 60 || play$episodes$row[[piece$last]] == 7L)
  }
})

test_that("candidates that are to play the same episodes have the same seeds and rows", {
  for (group in list(NULL, 4L)) {
    columns <- entered(3, 10, 1, group = group, common = TRUE)$columns
    each <- split(as.data.frame(columns[intersect(c("seed", "row", "episode"), names(columns))]),
                  columns$candidate)
    row.names(each[[2]]) <- row.names(each[[3]]) <- NULL
    expect_identical(each[[2]], each[[1]])
    expect_identical(each[[3]], each[[1]])
    alone <- entered(1, 10, 1, group = group, common = TRUE)$columns
    expect_identical(alone$seed, each[[1]]$seed)
  }
})

test_that("the first candidate that reaches the target is the last one, whatever came before", {
  all <- entered(12, 3, 1)$columns
  means <- colMeans(matrix(all$return, 3))
  for (target in sort(means)[c(3, 8, 12)]) {
    winner <- which(means >= target)[[1L]]
    for (chance in 1:15) {
      columns <- entered(12, 3, chance, target = target)$columns
      expect_identical(columns, lapply(all, utils::head, 3 * winner))
    }
  }
})

test_that("an error in the middle keeps the episodes before it, and comes when they are known", {
  all <- entered(6, 5, 1)$columns
  for (chance in 1:10) {
    failed <- entered(6, 5, chance, fails = c(19L, 23L))
    expect_identical(failed$columns, lapply(all, utils::head, 18L))
    expect_s3_class(failed$error, "gym_error_http_400")
    expect_identical(failed$error$code, "environment_error")
  }
})

test_that("an error after the candidate that reached the target appears nowhere", {
  all <- entered(12, 3, 1)$columns
  means <- colMeans(matrix(all$return, 3))
  winner <- which.max(means[1:6])
  for (chance in 1:10) {
    played <- entered(12, 3, chance, target = means[[winner]], fails = 3L * winner + 1L)
    expect_null(played$error)
    expect_identical(max(played$columns$candidate), winner)
  }
})

test_that("a request has no more candidates than fit", {
  history <- new_history(9, 2, new_streams(1))
  play <- new_play(described(), list_episodes(described(), history, 3L), NULL, Inf, "", NULL,
                   most = 3L)
  pieces <- list()
  while (!is.null(piece <- take_piece(play, 100L))) pieces <- c(pieces, list(piece))
  expect_identical(vapply(pieces, function(piece) piece$last, 1), c(6, 12, 18))
  play <- new_play(described(), list_episodes(described(), history, 3L), NULL, Inf, "", NULL)
  expect_identical(take_piece(play, 100L)$last, 2L)
})

test_that("thousands of episodes of a small policy have a seed and a row each", {
  columns <- list_episodes(described(256L), new_history(1, 3000, new_streams(1)), 1000000L)
  expect_identical(columns$row, rep_len(0:255, 3000))
  expect_identical(length(unique(columns$seed)), 12L)
})

test_that("pieces take as long as wanted, and grow step by step", {
  expect_identical(next_size(10, 1, 0.25), 2L)
  expect_identical(next_size(10, 0.0001, 0.25), 80L)
  expect_identical(next_size(1, 100, 0.25), 1L)
})

# With a server ------------------------------------------------------------------------------

linear <- function(inputs, outputs) {
  policy_linear(weights = matrix(sin(1:(inputs * outputs)), outputs))
}

# The parts of a rollout that say what was played.
played <- function(...) rollout(...)[c("episodes", "steps", "num_envs", "seed")]

way <- function(x) provenance(x)$way

# A client whose first three requests for episodes are cut, but not that for the description.
local_cut_rollouts <- function(server, when, frame = parent.frame()) {
  ask <- gym:::ask_description
  local_functions(ask_description = function(client, ...) {
    described <- ask(server, ...)
    described$client <- client
    described
  }, frame = frame)
  local_cut_client(server, when, "rollouts", times = 3, frame = frame)
}

# Requests that all have so many episodes, or groups, until the test ends.
local_pieces <- function(size, frame = parent.frame()) {
  local_functions(
    first_size = function(play) size, next_size = function(units, seconds, wanted) size,
    frame = frame
  )
}

test_that("what is named by its id and played by data is played beside the environment", {
  client <- test_client()
  acrobot <- function(policy, ...) {
    rollout("Acrobot-v1", policy, 2, max_steps = 5, seed = 1, client = client, ...)
  }
  beside <- "beside the environment"
  expect_identical(way(acrobot(policy_random())), beside)
  expect_identical(way(acrobot(linear(6, 3))), beside)
  expect_identical(way(acrobot(list(linear(6, 3), policy_random()), steps = TRUE)), beside)
  expect_true(all(c("gymnasium", "numpy") %in% names(provenance(acrobot(policy_random()))$server)))
  expect_identical(way(rollout(gym_wrap("Acrobot-v1", "TimeLimit", max_episode_steps = 3),
                               policy_random(), seed = 1, client = client)), beside)
  steps <- "step by step"
  still <- function(observation) rep(0L, nrow(observation))
  expect_identical(way(acrobot(still)), steps)
  expect_identical(way(acrobot(list(still, policy_random()))), steps)
  expect_identical(way(rollout(local_env("Acrobot-v1"), policy_random(), max_steps = 5)), steps)
  # Without any limit, and with as many sub-environments as no group has.
  along_the_cliff <- matrix(0, 48, 4)
  along_the_cliff[cbind(c(37, 25:35, 36), c(1, rep(2, 11), 3))] <- 1
  walk <- rollout("CliffWalking-v1", policy_table(along_the_cliff), seed = 1, client = client)
  expect_identical(walk$episodes$return, -13)
  expect_identical(way(walk), steps)
  expect_identical(way(rollout("Blackjack-v1", policy_random(), seed = 1, client = client)), beside)
  expect_identical(
    way(rollout("CartPole-v1", policy_random(), num_envs = 3, seed = 1, client = client)), steps
  )
})

test_that("no instance is made for what is played beside the environment", {
  skip_unless_all()
  client <- local_server()
  local_functions(create_instance = function(...) stop("an instance was made"))
  rollout("Acrobot-v1", policy_random(), 3, max_steps = 5, client = client)
  expect_length(env_list_all(client), 0)
})

test_that("the server is asked for a description once", {
  skip_unless_all()
  client <- local_server()
  asked <- 0L
  local_functions(ask_description = local({
    ask <- gym:::ask_description
    function(...) {
      asked <<- asked + 1L
      ask(...)
    }
  }))
  for (i in 1:3) rollout("Acrobot-v1", policy_random(), max_steps = 5, client = client)
  expect_identical(asked, 1L)
  rollout("Pendulum-v1", policy_random(), max_steps = 5, client = client)
  expect_identical(asked, 2L)
})

test_that("results are the same however many episodes a request has, and how many are under way", {
  client <- test_client()
  table <- policy_table(matrix(sin(1:64), 16), epsilon = 0.3)
  play <- function() {
    list(
      played("FrozenLake-v1", table, 40, seed = 1, steps = TRUE, next_observation = TRUE,
             client = client),
      played("CartPole-v1", list(policy_random(), linear(4, 1)), 300, seed = 2, max_steps = 30,
             client = client),
      played("Acrobot-v1", policy_candidates(linear(6, 3), rbind(sin(1:18), cos(1:18))), 9,
             seed = 3, max_steps = 20, steps = TRUE, client = client)
    )
  }
  whole <- play()
  for (size in c(1L, 7L, 1000L)) {
    local_pieces(size)
    expect_identical(play(), whole, label = paste("pieces of", size))
  }
  local_functions(perform_several = local({
    send <- gym:::perform_several
    function(..., at_once = 2L) send(..., at_once = 5L)
  }))
  expect_identical(play(), whole)
})

test_that("a training is the same with any number of processes, through broken connections, too", {
  skip_unless_all()
  train <- function(client) {
    what_counts(train_agent(
      agent_ars(directions = 4, top = 2), "Acrobot-v1", policy_linear(normalize = TRUE),
      iterations = 3, seed = 3, eval_episodes = 10, eval_every = 2, max_steps = 60, client = client
    ))
  }
  alone <- train(local_server(max_processes = 1))
  withr::local_envvar(PYTHON_CPU_COUNT = 3)
  several <- local_server()
  expect_identical(train(several), alone)
  expect_identical(train(local_cut_rollouts(several, "answered")), alone)
})

# The processes that a server's processes have started last: those that play are among them.
last_processes <- function(pid) {
  children <- suppressWarnings(as.integer(system2("pgrep", c("-P", pid), stdout = TRUE)))
  if (length(children)) unlist(lapply(children, last_processes)) else pid
}

test_that("processes that are killed in the middle change nothing", {
  skip_unless_all()
  skip_on_os("windows")
  server <- local_server()
  server_pid <- the_session$servers[[server$remote_base]]$pid
  play <- function() {
    played("Acrobot-v1", policy_random(), 60, seed = 1, max_steps = 100, client = server)
  }
  whole <- play()
  local_pieces(12L)
  killed <- 0L
  local_functions(read_played = local({
    read <- gym:::read_played
    function(play, piece, response) {
      if (piece$first %in% c(13L, 37L)) {
        killed <<- killed + 1L
        tools::pskill(last_processes(server_pid), tools::SIGKILL)
      }
      read(play, piece, response)
    }
  }))
  expect_identical(play(), whole)
  expect_identical(killed, 2L)
})

test_that("connections that are lost in the middle change nothing", {
  skip_unless_all()
  server <- local_server()
  play <- function(client) {
    local_pieces(4L)
    played("Acrobot-v1", policy_random(), 30, seed = 1, max_steps = 20, client = client)
  }
  whole <- play(server)
  expect_identical(play(local_cut_rollouts(server, "answered")), whole)
  expect_identical(play(local_cut_rollouts(server, "unsent")), whole)
})

test_that("steps are those of the same policy by hand, from the same seed", {
  skip_unless_all()
  client <- test_client()
  policy <- policy_linear(weights = rbind(c(3, -2), c(-1, 4), c(0, 50)))
  rolled <- rollout("MountainCar-v0", policy, 2, seed = 5, steps = TRUE, next_observation = TRUE,
                    max_episode_steps = 60, client = client)
  env <- local_env("MountainCar-v0", max_episode_steps = 60)
  for (episode in 1:2) {
    own <- rolled$steps[rolled$steps$episode == episode, ]
    observation <- env$reset(seed = rolled$episodes$seed[[episode]])
    for (step in seq_len(nrow(own))) {
      expect_identical(unlist(own[step, c("position", "velocity")]), observation)
      action <- act(policy_bind(policy, env), observation)
      expect_identical(own$action[[step]], action)
      out <- env$step(action)
      observation <- out$observation
      expect_identical(
        unname(unlist(own[step, c("next_position", "next_velocity")])), unname(observation)
      )
      expect_identical(own$reward[[step]], out$reward)
    }
    expect_identical(out$done, TRUE)
    expect_identical(rolled$episodes$length[[episode]], nrow(own))
  }
})

test_that("a network plays beside the environment as a function that acts as it does from R", {
  client <- test_client()
  for (id in c("Acrobot-v1", "Pendulum-v1", "FrozenLake-v1")) {
    policy <- policy_bind(policy_linear(), known <- known_spaces(id, client))
    coef(policy) <- sin(seq_along(coef(policy)))
    from_r <- function(observation) act(policy, observation)
    play <- function(policy) {
      rollout(id, policy, 10, seed = 4, max_steps = 30, steps = TRUE, client = client)
    }
    beside <- play(policy)
    stepped <- play(from_r)
    expect_identical(c(way(beside), way(stepped)), c("beside the environment", "step by step"))
    expect_equal(beside$steps, stepped$steps, tolerance = 1e-6)
    expect_equal(beside$episodes, stepped$episodes, tolerance = 1e-6)
    expect_identical(vapply(beside$steps, typeof, ""), vapply(stepped$steps, typeof, ""))
  }
})

test_that("an episode of a group is that of its row in a vector environment, by hand", {
  client <- test_client()
  policy <- linear(4, 1)
  rolled <- rollout("CartPole-v1", policy, 260, seed = 5, max_steps = 12, client = client)
  expect_identical(rolled$num_envs, 256L)
  expect_identical(rolled$episodes$sub_env, c(1:256, 1:4))
  env <- local_env("CartPole-v1", num_envs = 256)
  for (seed in unique(rolled$episodes$seed)) {
    observation <- env$reset(seed = seed)
    returns <- numeric(256)
    going <- rep(TRUE, 256)
    for (step in 1:12) {
      out <- env$step(act(policy_bind(policy, env), observation))
      returns <- returns + going * out$reward
      going <- going & !out$terminated
      observation <- out$observation
    }
    own <- rolled$episodes[rolled$episodes$seed == seed, ]
    expect_identical(own$return, returns[own$sub_env])
    expect_identical(own$terminated, !going[own$sub_env])
  }
})

test_that("moments are those of the observations that were acted on", {
  client <- test_client()
  each <- function(history) unlist(lapply(history$batches, `[[`, "moments"), recursive = FALSE)
  with_vector_env("Acrobot-v1", 6, function(vector_env) {
    history <- new_history(2, 3, new_streams(1))
    policy <- policy_bind(policy_random(), vector_env)
    play_batches(vector_env, history, function(these) policy, max_steps = 20, keep_moments = TRUE,
                 keep_steps = TRUE)
    expect_length(each(history), 6)
    episodes <- episodes_table(history$batches, several = TRUE)
    steps <- steps_table(history$batches, episodes, vector_env, several = TRUE)
    observed <- unname(as.matrix(steps[grep("theta", names(steps))]))
    expect_equal(Reduce(merge_moments, each(history)), moments_of(observed))
    own <- steps$candidate == 1 & steps$episode == 2
    expect_equal(each(history)[[2]], moments_of(observed[own, ]))
  }, client = client)
})

test_that("a search ends with the first round that reaches the target, and shows no later one", {
  client <- test_client()
  search <- function(...) search_random("CartPole-v1", rounds = 60, seed = 3, client = client, ...)
  found <- search(target = 100)
  expect_true(found$solved)
  expect_identical(found$round, nrow(found$rounds))
  expect_true(all(utils::head(found$rounds$mean_return, -1) < 100))
  expect_identical(found$episodes, utils::head(search(target = Inf)$episodes, nrow(found$episodes)))
})

test_that("an environment that fails in the middle keeps the episodes that were finished", {
  skip_unless_all()
  server <- odd_server()
  cnd <- expect_error(
    rollout("odd_environments:FailsLater-v0", policy_random(), 50, seed = 1, max_steps = 10,
            client = server),
    class = "gym_error_rollout"
  )
  expect_s3_class(cnd, "gym_error_http")
  finished <- cnd$result$episodes
  expect_gt(nrow(finished), 0L)
  expect_true(all(finished$seed %% 5 != 0))
  local_pieces(1L)
  again <- expect_error(
    rollout("odd_environments:FailsLater-v0", policy_random(), 50, seed = 1, max_steps = 10,
            client = server),
    class = "gym_error_rollout"
  )
  expect_identical(again$result$episodes, finished)
})

test_that("an interrupt keeps what was played before it, and the client goes on", {
  client <- test_client()
  play <- function() {
    rollout("Acrobot-v1", policy_random(), 40, seed = 1, max_steps = 20, client = client)
  }
  whole <- play()
  local({
    local_pieces(3L)
    local_functions(read_played = local({
      read <- gym:::read_played
      function(play, piece, response) {
        if (piece$first > 15) rlang::interrupt()
        read(play, piece, response)
      }
    }))
    expect_message(short <<- play(), class = "gym_message_interrupted")
  })
  expect_true(short$interrupted)
  expect_gt(nrow(short$episodes), 0L)
  expect_identical(short$episodes, utils::head(whole$episodes, nrow(short$episodes)))
  expect_identical(play(), whole)
})

test_that("where the server plays no whole episodes R steps, from the same seeds", {
  client <- test_client()
  play <- function() {
    rollout("Acrobot-v1", linear(6, 3), 9, seed = 1, max_steps = 20, client = client)
  }
  beside <- play()
  local_functions(known_description = function(...) NULL)
  stepped <- play()
  expect_identical(way(stepped), "step by step")
  expect_equal(stepped$episodes, beside$episodes)
})
