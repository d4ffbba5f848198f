# The table of solved environments, which tools/solve-table.R makes.

read_solved <- function(name) {
  file <- system.file("extdata", name, package = "gym")
  utils::read.csv(file, colClasses = c(kwargs = "character"), na.strings = "NA")
}

# Searches of an environment are one job, whose first choice may have been another method.
job_of <- function(rows) {
  paste(rows$env_id, rows$kwargs, ifelse(rows$method %in% c("ars", "cem"), "search", rows$method))
}
task_of <- function(rows) paste(job_of(rows), rows$seed)

# The seeds of a first choice of settings begin at 1001, those of a second one at 2001.
choice_of <- function(rows) rows$seed %/% 1000L

test_that("each seed has one row, without a gap, failures included", {
  table <- read_solved("solve-table.csv.gz")
  for (own in split(table, job_of(table))) {
    choice <- choice_of(own)
    expect_identical(unique(choice), seq_len(max(choice)))
    expect_identical(own$seed, 1000L * choice + sequence(rle(choice)$lengths))
  }
  expect_identical(table$reached, table$mean_return >= table$target)
  expect_true(all(table$lower <= table$mean_return & table$mean_return <= table$upper))
  expect_true(all(table$episodes == 100))
  expect_false(anyNA(table[c("steps", "seconds", "gym", "R", "gymnasium", "BLAS")]))
  # No paths of a machine.
  expect_false(any(grepl("/", table$BLAS)))
})

test_that("the curves end with the final evaluations of the table", {
  table <- read_solved("solve-table.csv.gz")
  curves <- read_solved("solve-curves.csv.gz")
  final <- curves[curves$kind == "final", ]
  expect_identical(task_of(final), task_of(table))
  expect_equal(final$mean_return, table$mean_return, tolerance = 0.005 / 10)
  expect_identical(final$steps, table$steps)
  expect_true(all(final$iteration == table$iterations))
})

test_that("its settings are the presets, by which a row can be made again", {
  table <- read_solved("solve-table.csv.gz")
  presets <- agent_presets()
  for (own in split(table, job_of(table))) {
    own <- own[choice_of(own) == max(choice_of(own)), ]
    expect_length(unique(own$agent), 1)
    kwargs <- if (nzchar(own$kwargs[[1]])) paste0("{\"", own$kwargs[[1]], "\":true}") else ""
    preset <- presets[presets$env_id == own$env_id[[1]] & presets$kwargs == kwargs &
                        presets$agent == own$method[[1]], ]
    expect_identical(nrow(preset), 1L)
    expect_length(unique(own$train_target), 1)
    expect_true(all(own$train_target >= own$target))
    expect_identical(unique(own$agent), format(preset_agent(preset)))
  }
})

test_that("a training of the table comes out the same again", {
  skip_unless_all()
  table <- read_solved("solve-table.csv.gz")
  row <- table[task_of(table) == "CartPole-v1  search 1001", ]
  trained <- suppressMessages(search_ars("CartPole-v1", target = row$train_target, seed = 1001,
                                         client = test_client()))
  expect_equal(trained$steps, row$steps)
  expect_equal(trained$final$mean_return, row$mean_return)
  expect_identical(nrow(trained$history), row$iterations)
})
