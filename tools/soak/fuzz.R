# Tests the package's reader of tensors with bytes that are nearly right. It must read them or raise
# an error with a message, in time and without more memory than such bytes need.
#
#   tools/in-env Rscript tools/soak/fuzz.R SECONDS

read_tensors <- gym:::read_tensors
write_tensors <- gym:::write_tensors

tensor <- function(dtype, shape) {
  size <- gym:::tensor_types[[dtype]]$size * prod(shape)
  list(dtype = dtype, shape = shape, bytes = as.raw(sample(0:1, size, replace = TRUE)))
}

# Files as a server sends them, and parts of headers from which other files are made.
right_files <- function() {
  shapes <- list(integer(), 1L, 3L, c(2L, 3L), 0L, c(2L, 2L, 2L))
  files <- lapply(seq_len(40), function(i) {
    types <- sample(names(gym:::tensor_types), sample(1:4, 1))
    tensors <- lapply(types, function(type) tensor(type, sample(shapes, 1)[[1]]))
    names(tensors) <- sample(c("observation", "observation/a~1b", "reward", "terminated", "x"),
                             length(tensors))
    write_tensors(tensors, c(info = "{}", request = '{"key":"k","number":4}'))
  })
  c(files, list(write_tensors(list(big = tensor("U8", 70000L)), c(info = "{}"))))
}

words <- lapply(c(
  "99999999999", "-1", "1e308", "4294967296", "9007199254740993", "null", "{}", "[]", "true",
  "\"F64\"", "\"BOOL\"", "\"U8\"", "0.5", "\\u0000", "__metadata__", "data_offsets", "}", "[", "\"",
  ",\"__metadata__\":{}", strrep("[", 5000), strrep("{\"a\":", 5000), "\u00e9"
), charToRaw)

mutate <- function(bytes) {
  for (i in seq_len(sample(1:4, 1))) {
    n <- length(bytes)
    if (n < 2) break
    # Change the header most often, because it determines how the rest is read.
    at <- if (runif(1) < 0.8) sample(min(n, 300), 1) else sample(n, 1)
    bytes <- switch(
      sample(7, 1),
      replace(bytes, at, as.raw(sample(0:255, 1))),
      bytes[seq_len(at)],
      bytes[-(at:min(n, at + sample(20, 1)))],
      c(bytes[seq_len(at)], words[[sample(length(words), 1)]], bytes[-seq_len(at)]),
      c(bytes[seq_len(at)], bytes[at:min(n, at + 50)], bytes[-seq_len(at)]),
      replace(bytes, 1:8, as.raw(sample(c(0, 1, 127, 128, 255), 8, replace = TRUE))),
      fit_header(bytes)
    )
  }
  if (runif(1) < 0.5) fit_header(bytes) else bytes
}

# Write the new length of the header, because with a wrong length nothing else is read.
fit_header <- function(bytes) {
  end <- which(bytes == as.raw(0x7d))
  if (!length(end) || length(bytes) < 10) return(bytes)
  size <- end[[sample(length(end), 1)]] - 8
  if (size < 2) return(bytes)
  replace(bytes, 1:8, writeBin(c(as.integer(size), 0L), raw(), endian = "little"))
}

# Put another number, or something that is not a number, into the header, and leave the rest as it
# is.
swap_value <- function(bytes) {
  size <- gym:::header_size(bytes)
  header <- rawToChar(bytes[8 + seq_len(size)])
  # Choose a value of the header: a text between brackets, or a dtype.
  value <- "(?<=[\\[,])[0-9]+(?=[],])|\"[A-Z]+[0-9]+\"|[[][0-9,]*[]]"
  places <- gregexpr(value, header, perl = TRUE)
  if (places[[1]][[1]] < 0) return(bytes)
  values <- regmatches(header, places)[[1]]
  at <- sample(length(values), 1)
  values[[at]] <- sample(odd_values, 1)
  regmatches(header, places) <- list(values)
  header <- charToRaw(header)
  c(writeBin(c(length(header), 0L), raw(), endian = "little"), header, bytes[-seq_len(8 + size)])
}

odd_values <- c(
  "0", "1", "2", "8", "24", "99999999999", "-1", "1e308", "4294967296", "9007199254740993", "null",
  "{}", "[]", "true", "\"F64\"", "\"BOOL\"", "\"U8\"", "\"U99\"", "0.5", "[1,2]", "[0,8]", "[-8,0]",
  "[4294967296,0]", "[0,4294967296]", "[[1],2]", "[null]", "[\"1\"]", "[true]", "[0.5,2]", "7,8",
  "[1,1,1,1,1,1,1,1,1]", "1E400", "\"\"", "[{}]"
)

# Use the CPU seconds of this process, because other processes may be running.
worked <- function() sum(proc.time()[c("user.self", "sys.self")])

seconds <- as.numeric(commandArgs(TRUE)[[1]])
set.seed(1)
seeds <- right_files()
end <- Sys.time() + seconds
cases <- read <- 0
problems <- character()
invisible(gc(reset = TRUE))
while (Sys.time() < end && length(problems) < 20) {
  bytes <- seeds[[sample(length(seeds), 1)]]
  bytes <- if (runif(1) < 0.5) swap_value(bytes) else mutate(bytes)
  began <- worked()
  # Read it as a new file, and with a table that is already known.
  for (time in 1:2) {
    outcome <- tryCatch(read_tensors(bytes), error = identity, warning = identity)
    if (inherits(outcome, "condition") && !inherits(outcome, "gym_error")) {
      problems <- c(problems, paste0(
        conditionMessage(outcome), " <- base64 ", jsonlite::base64_enc(utils::head(bytes, 600))
      ))
    }
  }
  read <- read + is.list(outcome) * !inherits(outcome, "condition")
  if (worked() - began > 5) problems <- c(problems, "took more than 5 s")
  cases <- cases + 1
}
megabytes <- sum(gc()[, 6])
if (megabytes > 500) problems <- c(problems, paste("took", megabytes, "MB"))
cat(unique(problems), sep = "\n")
cat(sprintf(
  "\nfuzz-r: %.0f cases in %.0f s (%.0f read), at most %.0f MB, problems %d\n",
  cases, seconds, read, megabytes, length(problems)
))
quit(status = as.integer(length(problems) > 0))
