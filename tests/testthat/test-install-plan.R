# A Python that says of itself what a test wants.
fake_python <- function(folder, version = "3.12", bits = "64", venv = "venv") {
  fake_program(file.path(folder, "python3"), paste("echo python", version, "CPython", bits, venv))
}

local_pythons <- function(..., frame = parent.frame()) {
  skip_on_os("windows")
  folder <- withr::local_tempdir(.local_envir = frame)
  pythons <- mapply(function(name, about) do.call(fake_python, c(file.path(folder, name), about)),
                    letters[seq_len(...length())], list(...))
  withr::local_envvar(
    PATH = paste(c(dirname(pythons), "/nowhere"), collapse = ":"), VIRTUAL_ENV = NA,
    GYM_PYTHON = NA, .local_envir = frame
  )
  unname(pythons)
}

test_that("uv does it where it is found", {
  local_cache()
  skip_if_no_uv()
  plan <- install_plan("box2d")
  expect_identical(plan$how, "uv")
  expect_identical(plan$tool, Sys.getenv("GYM_UV"))
  expect_identical(plan$megabytes, lock_megabytes("box2d") + managed_python_megabytes)
  expect_false(dir.exists(install_root()))
  dir.create(file.path(managed_python_folder(), "cpython-3.12.1-linux"), recursive = TRUE)
  expect_identical(install_plan("box2d")$megabytes, lock_megabytes("box2d"))
})

test_that("without uv a Python that fits does it, and without both uv is downloaded", {
  local_cache()
  local_binding("find_uv", function(...) NULL)
  pythons <- local_pythons(
    list("3.9"), list("3.14"), list("3.12", bits = "32"), list("3.11", venv = "-"), list("3.13")
  )
  plan <- install_plan()
  expect_identical(plan[c("how", "tool")], list(how = "python", tool = pythons[[5]]))
  expect_identical(plan$megabytes, lock_megabytes(character()) + pip_megabytes)
  # With uv it need not have venv.
  expect_identical(find_base_python(with_venv = FALSE), pythons[[4]])
  unlink(pythons[[5]])
  plan <- install_plan()
  expect_identical(plan$how, "download")
  expect_null(plan$tool)
  expect_true(all(plan$megabytes > lock_megabytes(character()) + managed_python_megabytes))
})

test_that("what was installed is not what the next is made from", {
  local_cache()
  other <- local_pythons(list("3.13"))
  python <- environment_python(fake_installation())
  file.copy(other, python, overwrite = TRUE)
  expect_identical(python_candidates(), c(python, other))
  expect_identical(find_base_python(with_venv = FALSE), other)
})
