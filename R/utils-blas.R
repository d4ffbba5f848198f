# The library that multiplies matrices.

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
