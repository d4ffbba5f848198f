# Learners of tables. Compares learning from the model in R with a plain Python loop and a NumPy
# table. Also measures learning on the server and from whole episodes, and compares an older gym, if
# GYM_OLD names a checkout of it that was set up:
#
#   git worktree add ../old e8cd8bf && (cd ../old && tools/setup test)
#   GYM_OLD=../old make bench PARTS=tables
#
# R plays in a table, and Python in an environment. Results are steps per CPU second of R and the
# server together.

table_names <- c(
  gym = "gym, learn_q()", python = "Python, NumPy table", server = "gym, on the server",
  tiles = "gym, learn_sarsa(), tiles", blackjack = "gym, learn_monte_carlo()", pages = "book pages"
)
old_name <- function(name) paste0("older ", name)

start_learner <- function(folder = ".") {
  start_worker(
    file.path(folder, "tools/in-env"), c("Rscript", "--no-init-file", "tools/bench/learner.R")
  )
}

compare_tables <- function(python, turns, blackjack_turns) {
  old <- Sys.getenv("GYM_OLD")
  learners <- c(list(start_learner()), if (nzchar(old)) list(start_learner(old)))
  loop <- start_worker(python, "tools/bench/q_learning.py")
  on.exit(for (worker in c(learners, list(loop))) end_worker(worker))
  called <- function(i, name) if (i > 1L) old_name(table_names[[name]]) else table_names[[name]]
  rate <- function(i, name, task, env_id, turn) {
    told <- ask(learners[[i]], task)
    row <- measured("tables", 0, called(i, name), "", turn, told$steps / told$seconds, "steps/s",
                    env_id)
    list(row = row, steps = told$steps)
  }
  steps_of <- function(turn) {
    progress("tables, turn ", turn, " of ", turns)
    by_id <- lapply(c("Taxi-v4", "FrozenLake8x8-v1"), function(env_id) {
      own <- rate(1L, "gym", env_id, env_id, turn)
      steps <- min(own$steps, 1e5)
      told <- ask(loop, sprintf("{\"env_id\": \"%s\", \"steps\": %d, \"seed\": %d}", env_id,
                                as.integer(steps), turn))
      rbind(own$row, measured("tables", 0, table_names[["python"]], "", turn,
                              steps / told$seconds, "steps/s", env_id))
    })
    on_server <- lapply(seq_along(learners), function(i) {
      rbind(rate(i, "server", "server", "Taxi-v4", turn)$row,
            rate(i, "tiles", "tiles", "MountainCar-v0", turn)$row)
    })
    do.call(rbind, c(by_id, on_server))
  }
  # The first run is not counted.
  for (learner in learners) ask(learner, "server")
  rows <- do.call(rbind, lapply(seq_len(turns), steps_of))
  blackjack <- lapply(seq_len(blackjack_turns), function(turn) {
    told <- ask(learners[[1L]], "blackjack")
    name <- table_names[["blackjack"]]
    rbind(measured("tables", 0, name, "", turn, told$passed, "s", "Blackjack-v1"),
          measured("tables", 0, name, "", turn, told$seconds, "processor s", "Blackjack-v1"))
  })
  pages <- lapply(c(".", Filter(nzchar, old)), function(folder) {
    name <- if (folder == ".") table_names[["pages"]] else old_name(table_names[["pages"]])
    measured("tables", 0, name, "", 1L, page_seconds(folder), "processor s", "chapters")
  })
  do.call(rbind, c(list(rows), blackjack, pages))
}

# The CPU seconds of the code of all chapters that both checkouts have.
page_seconds <- function(folder) {
  code <- paste(
    "started <- proc.time();",
    "for (page in sprintf('book-%02d', c(2, 4:8, 10))) {",
    "  file <- list.files('vignettes', paste0('^', page, '.*Rmd$'), full.names = TRUE);",
    "  script <- knitr::purl(file, tempfile(), quiet = TRUE, documentation = 0);",
    "  grDevices::pdf(NULL);",
    "  lines <- grep('pictures', readLines(script), value = TRUE, invert = TRUE);",
    "  utils::capture.output(source(exprs = parse(text = lines), local = new.env()))",
    "};",
    "cat(sum((proc.time() - started)[1:2]))"
  )
  told <- processx::run(
    file.path(normalizePath(folder), "tools/in-env"), c("Rscript", "--no-init-file", "-e", code),
    wd = folder
  )
  as.numeric(utils::tail(strsplit(told$stdout, "\n")[[1L]], 1L))
}

table_goals <- function(rows) {
  took <- function(name, env_id, unit = "steps/s") {
    values_of(rows, "tables", name, unit = unit, env_id = env_id)
  }
  has_old <- any(startsWith(rows$contender, "older "))
  against_old <- function(name, env_id, text, at_least) {
    own <- took(table_names[[name]], env_id)
    goal(text, stats::median(own / took(old_name(table_names[[name]]), env_id)), at_least)
  }
  pages <- took(table_names[["pages"]], "chapters", "processor s")
  c(
    lapply(c("Taxi-v4", "FrozenLake8x8-v1"), function(env_id) {
      ratio <- took(table_names[["gym"]], env_id) / took(table_names[["python"]], env_id)
      goal(paste0("learn_q() by id, ", env_id, ": at least 1.2 of Python's loop with a table"),
           stats::median(ratio), at_least = 1.2)
    }),
    if (has_old) {
      list(
        against_old("server", "Taxi-v4", "32 sub-environments on the server: at least 2", 2),
        against_old("tiles", "MountainCar-v0", "Sarsa(lambda) with tiles: at least 4", 4),
        goal("pages of the book: at most half of the time",
             pages / took(old_name(table_names[["pages"]]), "chapters", "processor s"),
             at_most = 0.5)
      )
    },
    list(goal("Monte Carlo control of Blackjack, 500,000 episodes: within 20 s",
              stats::median(took(table_names[["blackjack"]], "Blackjack-v1", "s")), at_most = 20))
  )
}
