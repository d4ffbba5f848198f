# What this R session knows, which all floors share:
#
#   pid             the process that loaded the package: a forked child has another one
#   servers         the servers that this session started, by their addresses
#   client          the client of the session's own server; named_client that of GYM_SERVER_URL
#   created         the instances that this session has created on servers, see http-instances.R
#   numbers, keys   the idempotency keys, see http-connection.R
#   hidden          texts that no error may show
#   ...             what was declined, what is installed at the moment, what was registered
#
# Being an environment it is never identical to a copy that was read from a file or sent to
# another process, which is how a client notices that it has been moved.
the_session <- new.env(parent = emptyenv())
the_session$servers <- list()
the_session$client <- NULL
the_session$created <- new.env(parent = emptyenv())
