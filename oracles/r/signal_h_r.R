# Stage signal.h by base R's svd, which is LAPACK's dgesdd as R was linked to it. Section 3.1, error (3), reading 9.
#
# A singular value below max(n, d) epsilons of the data's size counts as 0.

source(file.path(dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))), "wire.R"))

prepare <- function(stage, inputs) {
    if (stage != "signal.h") unsupported("svd answers signal.h only")
    Z <- record(inputs, "Z")
    m <- min(record(inputs, "m"), dim(Z))
    if (m < 0) stop("m is negative")
    function() {
        h0 <- colMeans(Z)
        Y <- sweep(Z, 2, h0)
        decomposition <- svd(Y, nu = 0, nv = m)
        smallest <- max(dim(Z)) * .Machine$double.eps * max(decomposition$d, abs(Z))
        kept <- seq_len(min(m, sum(decomposition$d > smallest)))
        H <- if (length(kept)) decomposition$v[, kept, drop = FALSE] else matrix(0, ncol(Z), 0)
        for (j in kept) H[, j] <- H[, j] * sign(H[which.max(abs(H[, j])), j])
        list(h0 = h0, H = t(H), X = Y %*% H, sigma = decomposition$d[kept])
    }
}

serve(paste0("R svd, LAPACK ", La_version(), " (", basename(La_library()), "), ", R.version.string), prepare)
