# Stage signal.spline by base R: B-splines from splines::splineDesign (de Boor's recurrence), least squares by qr, which is
# LINPACK's Householder QR with limited pivoting. Section 2.3, error (7), readings 1 and 3.
#
# A unique solution only: more control points than distinct t, or a rank below k, is for engines that choose among many.

source(file.path(dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))), "wire.R"))

prepare <- function(stage, inputs) {
    if (stage != "signal.spline") unsupported("splines answers signal.spline only")
    t <- record(inputs, "t")
    u <- record(inputs, "u")
    P <- record(inputs, "P")
    query <- record(inputs, "query")
    knots <- c(u[1], u, u[length(u)])
    k <- length(u) - 2
    if (k > length(unique(t))) unsupported("more control points than distinct parameters")
    function() {
        basis <- splines::splineDesign(knots, t, ord = 4)
        factors <- qr(basis, tol = 1e-10)
        if (factors$rank < k) unsupported("the matrix is rank deficient")
        control <- qr.coef(factors, P)
        list(control = control,
             values = basis %*% control,
             query_values = splines::splineDesign(knots, query, ord = 4) %*% control)
    }
}

serve(paste0("splines ", packageVersion("splines"), ", ", R.version.string), prepare)
