# The state of this R session, which all layers share:
#
#   pid             the process that loaded the package: a forked child has another one
#   servers         the servers that this session started, by their addresses
#   client          the client of the session's own server; named_client that of GYM_SERVER_URL
#   instances       the instances that this session has created on servers, see http-instances.R
#   curl_names      curl's names of its options, see set_curl()
#   keys            the idempotency keys of this process, see http-connection.R
#   environments    the environments written in R that are registered, by their ids
#   hidden          tokens, which errors must not show
#   reference_blas  whether R multiplies matrices by its own library, see has_reference_blas()
#
# and, if needed, addresses for which the user declined a server, and the function by which an upper
# layer asks, see prompted_server_starts().
#
# As an environment it is never identical to a copy that was read from a file or sent to another
# process. This is how a client notices that it has been moved.
the_session <- new.env(parent = emptyenv())
the_session$servers <- list()
the_session$messages <- 0
the_session$environments <- list()
the_session$client <- NULL
the_session$instances <- new.env(parent = emptyenv())
the_session$reference_blas <- NULL

# The library of linear algebra -----------------------------------------------------------

# R's own library, the reference, has no file name (Windows) or is Rblas; Debian's reference is
# libblas itself. A fast one may also be a libblas.so.3, in a folder with its name.
is_reference_blas <- function(file) {
  !nzchar(file) || grepl("Rblas|/libblas[.]", file) && !grepl("openblas|atlas|blis", file)
}

# It is the same for the whole session.
has_reference_blas <- function() {
  the_session$reference_blas %||% {
    the_session$reference_blas <- is_reference_blas(extSoftVersion()[["BLAS"]])
  }
}
