# Stage signal.rho by stats::splinefun(method = "monoH.FC"), R's reading of Fritsch & Carlson 1980.
#
# R's preliminary slopes are those of reading 7: the secants at the ends, their averages inside. Its limiter is not.
# - R limits a pair (alpha, beta) only outside the whole region M of monotone pairs, which is larger than the circle of radius
#   3, and then brings it onto that circle. Reading 7 limits every pair outside the circle.
# - R goes once from left to right and sets the slopes beside a zero secant when it meets it; `circle_slopes` sets those first.
# M is not closed under shrinking one of the two, so R's answer is not always monotone (r-help, February 2010: "Non-monotonic
# spline using splinefun"). `circle_slopes` is reading 7, and where R's slopes are others, R has not got the stage: an "ok" says
# that both limiters give the same slopes, and the values are splinefun's own.

source(file.path(dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))), "wire.R"))

circle_slopes <- function(secants) {
    n <- length(secants)
    slopes <- c(secants[1], (secants[-1] + secants[-n]) / 2, secants[n])
    flat <- which(secants == 0)
    slopes[c(flat, flat + 1)] <- 0
    for (i in which(secants != 0)) {
        radius <- sqrt(slopes[i]^2 + slopes[i + 1]^2) / secants[i]
        if (radius > 3) slopes[i + 0:1] <- slopes[i + 0:1] * 3 / radius
    }
    slopes
}

prepare <- function(stage, inputs) {
    if (stage != "signal.rho") unsupported("splinefun answers signal.rho only")
    t <- record(inputs, "t")
    query <- record(inputs, "query")
    n <- length(t)
    if (n < 2) unsupported("splinefun's monoH.FC needs two points")
    secants <- diff(t)
    if (any(secants < 0)) stop("t decreases")
    if (any(query < 1 | query > n)) stop("a query is outside [1, n]")
    rho <- stats::splinefun(1:n, t, method = "monoH.FC")
    if (max(abs(rho(1:n, deriv = 1) - circle_slopes(secants))) > 1e-12 * max(secants))
        unsupported("splinefun limits these slopes otherwise than the circle of radius 3 does")
    function() {
        rho <- stats::splinefun(1:n, t, method = "monoH.FC")
        list(values = rho(query), slopes = rho(1:n, deriv = 1))
    }
}

serve(paste0("stats ", packageVersion("stats"), ", ", R.version.string), prepare)
