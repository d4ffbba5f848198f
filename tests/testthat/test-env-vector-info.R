by_sub_env <- function(json, n) info_by_sub_env(from_json(json), n)

test_that("each key has an entry for each sub-environment, missing where there is no value", {
  info <- by_sub_env('{"x":[0,2,0],"_x":[false,true,false],"ok":[true,false,false],
    "_ok":[true,true,false],"word":[null,"b",null],"_word":[false,true,false],
    "half":[0.5,0.0,"NaN"],"_half":[true,false,true]}', 3)
  expect_identical(
    info,
    list(x = c(NA, 2L, NA), ok = c(TRUE, FALSE, NA), word = c(NA, "b", NA), half = c(0.5, NA, NaN))
  )
})

test_that("the first dimension of arrays counts sub-environments, other values are in a list", {
  info <- by_sub_env('{"place":[[0,0],[1,2]],"_place":[false,true],
    "grid":[[[1,2],[3,4]],[[5,6],[7,8]]],"_grid":[true,true],
    "mixed":[null,{"a":1}],"_mixed":[false,true]}', 2)
  expect_identical(info$place, rbind(c(NA, NA), 1:2))
  expect_identical(info$grid[2, , ], rbind(5:6, 7:8))
  expect_identical(info$mixed, list(NULL, list(a = 1L)))
})

test_that("infos inside of infos have entries for each sub-environment, too", {
  info <- by_sub_env('{"episode":{"r":[9,0],"_r":[true,false],"l":[9,0],"_l":[true,false]},
    "_episode":[true,false],"final_info":{"lives":[0,3],"_lives":[false,true]},
    "_final_info":[false,true]}', 2)
  expect_identical(info$episode, list(r = c(9L, NA), l = c(9L, NA)))
  expect_identical(info$final_info, list(lives = c(NA, 3L)))
  expect_named(info, c("episode", "final_info"))
})

test_that("a single sub-environment has entries too, and values without a mask stay as they are", {
  json <- '{"x":[5],"_x":[true],"gone":[null],"_gone":[false],"seed":[1,2],"_free":7}'
  info <- by_sub_env(json, 1)
  expect_identical(info, list(x = 5L, gone = list(NULL), seed = 1:2, `_free` = 7L))
  expect_identical(by_sub_env("{}", 3), structure(list(), names = character()))
})
