# As the package has it when it loads processx itself, which testthat loads before it.
Sys.setenv(PROCESSX_NOTIFY_OLD_SIGCHLD = "true")
library(testthat)
library(gym)

# R CMD check sees that the built package has what its tests need: files of the lowest floors.
# `make test-all` runs every test.
test_check("gym", filter = "^(space|utils)")
