library(testthat)
library(gym)

test_check("gym")
