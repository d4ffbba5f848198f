test_that("the file has a picture for each frame, at the environment's own pace", {
  skip_if_not_installed("magick")
  played <- short_rollout()
  file <- withr::local_tempfile(fileext = ".gif")
  animation <- animate(played, file)
  expect_s3_class(animation, "gym_animation")
  expect_identical(animation$file, file)
  expect_identical(animation$steps, 0:10)
  # 50 a second, the last for a whole one.
  expect_identical(animation$delays, c(rep(2L, 10), 100L))
  expect_identical(animation$size, c(600L, 400L))
  read <- magick::image_coalesce(magick::image_read(file))
  expect_length(read, 11)
  drawn <- function(image) as.integer(magick::image_data(image, "rgb"))
  frame <- magick::image_read(unclass(played$frames[[1]])[[11]])
  expect_identical(drawn(read[11]), drawn(frame))
})

test_that("a relative file lies in the folder at the start, and is found from any other", {
  skip_if_not_installed("magick")
  other <- withr::local_tempdir()
  withr::local_dir(withr::local_tempdir())
  file <- file.path(getwd(), "here.gif")
  env <- gym_env(
    reset = function(self) 0,
    step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
    render = function(self) array(255L, c(8, 8, 3)),
    observation_space = space_discrete(1), action_space = space_discrete(2)
  )
  moving <- function(observation) {
    setwd(other)
    0
  }
  animation <- animate(moving, "here.gif", env = env)
  expect_identical(animation$file, file)
  expect_true(file.exists(file))
})

test_that("width, every and fps do what they say, and a file that is there is replaced", {
  skip_if_not_installed("magick")
  played <- short_rollout()
  file <- withr::local_tempfile(fileext = ".gif")
  writeLines("old", file)
  animation <- animate(played, file, fps = 10, width = 150, every = 4)
  expect_identical(animation$steps, c(0L, 4L, 8L, 10L))
  expect_identical(animation$delays, c(40L, 40L, 20L, 100L))
  expect_identical(animation$size, c(150L, 100L))
  read <- magick::image_info(magick::image_read(file))
  expect_identical(unlist(read[4, c("width", "height")]), c(width = 150L, height = 100L))
})

test_that("no picture is shorter than browsers allow, at the same pace", {
  fast <- animation_plan(101, fps = 100)
  expect_identical(fast$steps, as.integer(seq(0, 100, 2)))
  expect_identical(unique(fast$delays[1:50]), 2L)
  # 30 a second are no whole number of hundredths, but 3 of them make a tenth.
  for (fps in c(10, 30, 50, 60, 100, 120, 1000)) {
    for (every in list(NULL, 1, 2, 3, 7)) {
      plan <- suppressMessages(animation_plan(10 * fps + 1, fps, every))
      info <- paste(fps, "a second, every", every)
      expect_true(all(plan$delays >= 2), info = info)
      # All but the last one's second; it may come too late by what it is raised to.
      seconds <- sum(utils::head(plan$delays, -1)) / 100
      expect_true(abs(seconds - 10) <= 0.02, info = info)
    }
  }
  expect_identical(animation_plan(1, fps = 50), list(steps = 0L, delays = 100L))
})

test_that("more frames than a GIF can show at that pace are left out, with a message", {
  expect_message(
    insisted <- animation_plan(101, fps = 100, every = 1), "`every` is 2 instead of 1",
    class = "gym_message_every"
  )
  expect_identical(insisted, animation_plan(101, fps = 100))
  expect_silent(animation_plan(101, fps = 100, every = 2))
  expect_silent(animation_plan(101, fps = 50, every = 1))
})

test_that("a picture of CartPole takes less than 2.5 kB in its animation", {
  skip_unless_all()
  skip_if_not_installed("magick")
  balance <- function(observation) as.integer(observation[, 3] + observation[, 4] > 0)
  played <- rollout("CartPole-v1", balance, seed = 2, max_steps = 50, frames = TRUE,
                    client = test_client())
  animation <- animate(played)
  expect_length(animation$steps, 51)
  expect_lt(file.size(animation$file), 51 * 2500)
})

test_that("an episode can be chosen", {
  skip_if_not_installed("magick")
  played <- rollout("CartPole-v1", policy_random(), 2, seed = 1, frames = TRUE,
                    client = test_client())
  expect_length(animate(played, episode = 2, width = 60)$steps, played$episodes$length[2] + 1)
  expect_error(animate(played, episode = 3), "`episode` must be", class = "gym_error_argument")
})

test_that("a search plays its policy in a fresh episode, and so do policies", {
  skip_if_not_installed("magick")
  client <- test_client()
  search <- search_random("CartPole-v1", rounds = 2, episodes = 1, max_steps = 5, seed = 1,
                          client = client)
  animation <- animate(search, seed = 3, width = 60)
  fresh <- rollout("CartPole-v1", search$policy, max_steps = 5, seed = 3, frames = TRUE,
                   client = client)
  expect_identical(animation$stills, pick_stills(fresh$frames[[1]], 8))
  set.seed(1)
  state <- .Random.seed
  again <- animate(search$policy, env = "CartPole-v1", max_steps = 5, seed = 3, width = 60,
                   client = client)
  expect_identical(again$stills, animation$stills)
  expect_identical(.Random.seed, state)
  right <- function(observation) rep(1L, nrow(observation))
  expect_identical(
    animate(right, env = "CartPole-v1", seed = 1, max_steps = 3, width = 60, client = client)$steps,
    0:3
  )
})

test_that("a training plays its policy in its environment, with the arguments of that", {
  skip_if_not_installed("magick")
  client <- test_client()
  trained <- train_agent(agent_ars(1, version = "V1"), "FrozenLake-v1", is_slippery = FALSE,
                         iterations = 1, max_steps = 4, eval_episodes = 2, seed = 1, num_envs = 2,
                         client = client)
  animation <- animate(trained, seed = 3, width = 60, client = client)
  fresh <- rollout("FrozenLake-v1", trained$policy, max_steps = 4, seed = 3, frames = TRUE,
                   client = client, is_slippery = FALSE)
  expect_identical(animation$stills, pick_stills(fresh$frames[[1]], 8))
})

test_that("an argument of a training's environment may have the name of one of animate()", {
  skip_if_not_installed("magick")
  withr::defer(gym_unregister("Wide-v0"))
  gym_register("Wide-v0", function(width = 8) {
    gym_env(
      reset = function(self) 0,
      step = function(self, action) list(observation = 0, reward = 0, terminated = TRUE),
      render = function(self) structure(array(255L, c(8, width, 3)), class = "gym_frame"),
      observation_space = space_discrete(1), action_space = space_discrete(2)
    )
  })
  trained <- train_agent(agent_random(), "Wide-v0", width = 16, total_steps = 1,
                         eval_episodes = 2, seed = 1, progress = FALSE)
  animation <- animate(trained, withr::local_tempfile(fileext = ".gif"))
  expect_identical(animation$size, c(16L, 8L))
})

test_that("what cannot be animated says why, before anything is played", {
  skip_if_not_installed("magick")
  plain <- rollout("CartPole-v1", policy_random(), seed = 1, client = test_client())
  expect_error(animate(plain), "frames = TRUE", class = "gym_error_argument")
  expect_error(animate(3), "a rollout, a search, a training or a policy",
               class = "gym_error_argument")
  bad <- function(..., message) {
    expect_error(animate(policy_random(), ..., env = "CartPole-v1", client = no_client()), message,
                 class = "gym_error_argument")
  }
  bad("cartpole.png", message = "ends in .gif or .mp4")
  bad(file.path(tempdir(), "not there", "a.gif"), message = "folder that exists")
  bad(fps = 0, message = "`fps`")
  bad(width = 0, message = "`width`")
  bad(every = 0.5, message = "`every`")
  bad(wdith = 3, message = "`wdith`")
})

test_that("an environment that was closed is said to be", {
  skip_if_not_installed("magick")
  env <- local_env("CartPole-v1")
  search <- search_random(env, rounds = 1, episodes = 1, max_steps = 5, seed = 1)
  env$close()
  closed <- function(code) {
    expect_error(code, "This environment was closed.*gym_make\\(\"CartPole-v1\"\\)",
                 class = "gym_error_argument")
  }
  closed(animate(search))
  closed(rollout(env, search$policy, frames = TRUE))
})

test_that("it prints where it is, and opens where somebody looks", {
  skip_if_not_installed("magick")
  animation <- animate(short_rollout(max_steps = 3), width = 60)
  seen <- NULL
  withr::local_options(gym.viewer = NULL, viewer = function(url, ...) seen <<- url)
  expect_output(print(animation), "4 pictures of 60 x 40 pixels, 1.06 s", fixed = TRUE)
  expect_null(seen)
  rlang::with_interactive(expect_output(print(animation), animation$file, fixed = TRUE))
  expect_identical(tools::md5sum(seen)[[1]], tools::md5sum(animation$file)[[1]])
  seen <- NULL
  withr::local_options(gym.viewer = FALSE)
  rlang::with_interactive(expect_output(print(animation), animation$file, fixed = TRUE))
  expect_null(seen)
})

knitted <- function(animation, to) {
  folder <- withr::local_tempdir(.local_envir = parent.frame())
  withr::local_dir(folder)
  document <- new.env()
  document$animation <- animation
  old <- knitr::opts_knit$get("rmarkdown.pandoc.to")
  knitr::opts_knit$set(rmarkdown.pandoc.to = to)
  on.exit(knitr::opts_knit$set(rmarkdown.pandoc.to = old))
  text <- knitr::knit(
    text = c("```{r pole, out.width='50%'}", "animation", "animation", "```"), envir = document,
    quiet = TRUE
  )
  list(text = text, files = file.path(folder, list.files(folder, recursive = TRUE)))
}

test_that("an animation whose file has gone is drawn again from its stills, and says so", {
  skip_if_not_installed("magick")
  saved <- withr::local_tempfile(fileext = ".rds")
  animation <- animate(short_rollout(), width = 60)
  saveRDS(animation, saved)
  unlink(animation$file)
  animation <- readRDS(saved)
  expect_output(again <- print(animation), "gone; its 8 stills are in", fixed = TRUE)
  read <- magick::image_info(magick::image_read(again$file))
  expect_identical(read$width, rep(60L, 8))
  skip_if_not_installed("knitr")
  page <- knitted(animation, "html")
  expect_identical(page$text, knitted(again, "html")$text)
  expect_identical(tools::md5sum(page$files)[[1]], tools::md5sum(again$file)[[1]])
})

test_that("it is printed also where it cannot be opened", {
  skip_if_not_installed("magick")
  animation <- animate(short_rollout(max_steps = 3), width = 60)
  withr::local_options(
    rlang_interactive = TRUE, gym.viewer = NULL, viewer = NULL,
    browser = function(url) stop("no display")
  )
  expect_output(print(animation), animation$file, fixed = TRUE)
  withr::local_options(gym.viewer = "firefox")
  expect_output(
    expect_error(print(animation), "gym.viewer", class = "gym_error_argument"),
    animation$file, fixed = TRUE
  )
})

test_that("only a file that is not temporary is copied for the viewer", {
  temporary <- withr::local_tempfile(fileext = ".gif")
  writeLines("gif", temporary)
  expect_identical(among_temporary_files(temporary), temporary)
  folder <- tempfile("gym-", dirname(tempdir()))
  dir.create(folder)
  withr::defer(unlink(folder, recursive = TRUE))
  kept <- file.path(folder, "kept.gif")
  writeLines("gif", kept)
  copy <- among_temporary_files(kept)
  withr::defer(unlink(copy))
  expect_identical(normalizePath(dirname(copy)), normalizePath(tempdir()))
  expect_identical(readLines(copy), "gif")
})

test_that("a page of knitr has the animation, and LaTeX its filmstrip", {
  skip_if_not_installed("magick")
  skip_if_not_installed("png")
  skip_if_not_installed("knitr")
  animation <- animate(short_rollout(max_steps = 3), width = 60)
  page <- knitted(animation, "html")
  expect_match(page$text, "figure/pole-[0-9a-f]{8}[.]gif")
  expect_match(page$text, "50%")
  expect_identical(tools::md5sum(page$files)[[1]], tools::md5sum(animation$file)[[1]])
  paper <- knitted(animation, "latex")
  expect_match(paper$text, "figure/pole-[0-9a-f]{8}")
  expect_match(paper$files, "[.]pdf$")
  expect_gt(file.size(paper$files), 1000)
})

test_that("gganimate's generic finds the methods, when it is loaded and later", {
  hooks <- getHook(packageEvent("gganimate", "onLoad"))
  ours <- Filter(function(hook) identical(topenv(environment(hook)), asNamespace("gym")), hooks)
  expect_gt(length(ours), 0)
  home <- new.env()
  home$animate <- function(plot, ...) UseMethod("animate")
  environment(home$animate) <- home
  register_animate(home)
  expect_error(home$animate(rollout(fake_environment(), policy_random())),
               class = "gym_error_argument")
})

# The pictures of a video, as ffmpeg counts them.
count_pictures <- function(file) {
  said <- run_quietly(find_ffmpeg(), c("-i", file, "-f", "null", "-"))$stderr
  as.integer(sub(".*frame= *([0-9]+).*", "\\1", said))
}

test_that("an MP4 has all pictures, the last for a second, with an even size", {
  played <- short_rollout()
  if (is.null(find_ffmpeg())) skip("no ffmpeg")
  local_binding("is_av_there", function() FALSE)
  file <- withr::local_tempfile(fileext = ".mp4")
  animation <- animate(played, file)
  expect_identical(animation$steps, 0:10)
  expect_identical(animation$size, c(600L, 400L))
  expect_identical(rawToChar(readBin(file, "raw", 8)[5:8]), "ftyp")
  # 50 a second.
  expect_identical(count_pictures(file), 11L + 49L)
  animation <- animate(played, file, width = 101, every = 5, fps = 100)
  expect_identical(animation$size, c(100L, 66L))
  expect_identical(count_pictures(file), 3L + 19L)
  expect_match(format(animation), "100 x 66 pixels")
  expect_match(knitted(animation, "html")$text, "<video controls.*figure/pole-[0-9a-f]{8}[.]mp4")
})

test_that("without anything that writes a video one command is named", {
  local_binding("is_av_there", function() FALSE)
  local_binding("find_ffmpeg", function() NULL)
  expect_error(
    animate(policy_random(), "a.mp4", env = "CartPole-v1", client = no_client()),
    "install.packages(\"av\")", fixed = TRUE, class = "gym_error_argument"
  )
})

test_that("an environment is not animated: the message has the call that plays it", {
  for (env in list("CartPole-v1", gym_wrap("CartPole-v1", "ClipReward"), fake_environment())) {
    expect_error(animate(env, policy_random()), "`animate(rollout(env, policy, frames = TRUE))`",
                 fixed = TRUE, class = "gym_error_argument")
  }
})
