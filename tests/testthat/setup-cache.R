# All tests, and the processes that they start, use this cache folder, so that they neither find nor
# change what the user has installed with gym_server_install().
withr::local_envvar(
  R_USER_CACHE_DIR = withr::local_tempdir("gym-cache-", .local_envir = teardown_env()),
  .local_envir = teardown_env()
)
