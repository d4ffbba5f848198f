# As the package has it when it loads processx itself, which testthat loads before it.
Sys.setenv(PROCESSX_NOTIFY_OLD_SIGCHLD = "true")
library(testthat)
library(gym)

test_check("gym")
