# The site's articles, vignettes/articles/, are built by `make site` only.

article <- function(name) {
  file <- file.path(test_path(), "../../vignettes/articles", paste0(name, ".Rmd"))
  skip_if_not(file.exists(file), "not a source tree")
  lines <- readLines(file, encoding = "UTF-8")
  # What stands between four backticks is shown as text.
  shown <- cumsum(grepl("^````", lines)) %% 2 == 1 | grepl("^````", lines)
  shorter <- withr::local_tempfile(lines = lines[!shown], .local_envir = parent.frame())
  page_chunks(shorter)
}

# Runs the code of some chunks as somebody does who copies them, in the article's folder. Trainings
# are short.
run_chunks <- function(chunks) {
  withr::local_dir(file.path(test_path(), "../../vignettes/articles"))
  withr::local_pdf(NULL)
  made <- new.env(parent = globalenv())
  code <- sub("total_steps = [0-9]+", "total_steps = 2000", unlist(lapply(chunks, `[[`, "code")))
  utils::capture.output(suppressMessages(
    source(exprs = parse(text = code, keep.source = FALSE), local = made, print.eval = TRUE)
  ))
  made
}

test_that("a network of Stable-Baselines3 plays in R as in Python", {
  chunks <- article("together")
  made <- run_chunks(chunks[grepl("sb3", vapply(chunks, `[[`, "", "header"))])
  # What model.predict(deterministic=True) returned.
  states <- rbind(c(0.1, -0.2, 0.03, 0.4), c(0, 1, -0.05, -0.6))
  expect_identical(act(made$policy, states), c(1L, 1L))
  played <- evaluate_policy("CartPole-v1", made$policy, episodes = 20, seed = 1,
                            client = test_client())
  expect_identical(played$mean_return, 500)
})

test_that("recipes of the gallery run alone", {
  skip_unless_all()
  chunks <- article("gallery")
  names <- vapply(chunks, function(chunk) sub("^```[{]r *([a-z]*).*", "\\1", chunk$header), "")
  # One more trains for a minute.
  for (name in c("compare", "imitate", "pid", "own", "shape", "animation", "class")) {
    expect_error(run_chunks(chunks[names == name]), NA)
  }
  expect_setequal(setdiff(names, c("setup", "")),
                  c("moon", "compare", "imitate", "pid", "own", "shape", "animation", "class"))
})
