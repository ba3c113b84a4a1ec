"""Stage `signal.refine`: the whole error (2) of Cashman & Hormann 2012 over the control points of f, the sites, g and h (section 3 names the aim and
leaves it), by variable projection (Golub & Pereyra 1973) and scipy.optimize.

For given control points and sites the best g, H and h_0 are the projection of the weighted, centred targets on the functions of g, cut to its m
leading singular triples. What is left is a function of 2k + 2l numbers. Its gradient is that of the whole error with g, H and h_0 held, where g turns with
the sites so that its side conditions stay (the first-order change of the best g costs nothing). BFGS goes downhill from the start, then trust-exact,
whose Hessian is central differences of that gradient.

The error often has no minimum: sites run into one place by twos, threes and fours, coefficients grow without bound, and the error falls towards the
limit of a kernel and its derivatives. No gradient vanishes on that way. The engine goes down it as far as its digits go (E from what comes back
then agrees with the closed form to 1e-7 or so, not to rounding), and the judge sees the gradient that is left. With the argument `held` the sites
stay where they start, which has a minimum, and only the control points move.

The plane is first moved and scaled so that the sites' box is centred and has the diagonal 1, and g is brought back to the units given.
"""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from scipy.special import xlogy

from shape_mesh import serve_version
from wire import Unsupported, serve

RANK = 1e-12  # of the greatest singular value of the functions of g at the targets, and of the projected targets
ROUNDS = 8
NEWTON_STEPS = 40


class Fit:
    """The closed form for given control points and sites, and the gradient there."""

    def __init__(self, problem, control, s):
        self.s, self.p = s, problem.basis @ control
        root, m = problem.root, problem.m
        T = np.column_stack([np.ones(len(s)), s])
        Q, R = np.linalg.qr(T, mode="complete")
        self.null, self.T = Q[:, 3:], T
        if np.abs(np.diag(R)).min() < 1e-10:
            raise ArithmeticError("the sites are on a line")
        self.r2 = cdist(self.p, s, "sqeuclidean")
        self.phi = xlogy(self.r2, self.r2) / 2
        A = root * np.column_stack([np.ones(len(self.p)), self.p, self.phi @ self.null])
        U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
        kept = sigma > RANK * sigma[0]
        U, sigma, Vt = U[:, kept], sigma[kept], Vt[kept]
        left, weight, self.H = np.linalg.svd(U.T @ problem.Y, full_matrices=False)
        m = min(m, np.count_nonzero(weight > RANK * max(np.linalg.norm(problem.Y), np.finfo(float).tiny)))
        left, self.H = left[:, :m] * weight[:m], self.H[:m]
        coefficients = Vt.T @ (left / sigma[:, None])
        self.affine, self.g = coefficients[:3], self.null @ coefficients[3:]
        self.residual = problem.Y - U @ left @ self.H
        self.error = (self.residual**2).sum()

    def gradient(self, problem):
        pull = problem.root * (self.residual @ self.H.T)  # (R, m): minus half the derivative by the values of g
        slope = np.log(np.where(self.r2 > 0, self.r2, 1.0)) + 1  # phi'(r) / r
        K = (pull @ self.g.T) * slope
        by_p = self.p * K.sum(axis=1)[:, None] - K @ self.s + pull @ self.affine[1:].T
        by_s = self.s * K.sum(axis=0)[:, None] - K.T @ self.p
        turn = self.g @ (self.phi.T @ pull).T @ self.T @ np.linalg.inv(self.T.T @ self.T)
        return -2 * np.concatenate([(problem.basis.T @ by_p).ravel(), (by_s - turn[:, 1:]).ravel()])


class Problem:
    def __init__(self, Y, w, t, u, m, k, l):
        self.k, self.m, self.l = k, m, l
        self.root = np.sqrt(w)[:, None]
        self.h0 = w @ Y / w.sum()
        self.Y = self.root * (Y - self.h0)
        self.basis = BSpline.design_matrix(t, np.concatenate([u[:1], u, u[-1:]]), 3).toarray()
        self.at = (None, None)

    def fit(self, x):
        if self.at[0] is None or not np.array_equal(self.at[0], x):
            points = x.reshape(-1, 2)
            self.at = (x.copy(), Fit(self, points[: self.k], points[self.k :]))
        return self.at[1]

    def error(self, x):
        try:
            return self.fit(x).error
        except ArithmeticError:
            return np.inf

    def gradient(self, x):
        return self.fit(x).gradient(self)


def descend(problem, x, free, steps):
    """BFGS, begun anew until nothing falls, then Newton steps in a trust region; of x only the numbers `free` move."""
    unit = problem.error(x) or 1.0

    def whole(z):
        y = x.copy()
        y[free] = z
        return y

    error = lambda z: problem.error(whole(z)) / unit
    slope = lambda z: problem.gradient(whole(z))[free] / unit

    def hessian(z, step=1e-5):
        H = np.array([slope(z + e) - slope(z - e) for e in step * np.eye(len(z))]) / (2 * step)
        return (H + H.T) / 2

    def search(z, method, **options):
        found = minimize(error, z, jac=slope, hess=hessian if method == "trust-exact" else None, method=method, options=options).x
        return found if error(found) < error(z) else z

    z = x[free]
    for _ in range(ROUNDS):
        before = error(z)
        z = search(z, "BFGS", maxiter=steps, gtol=1e-10)
        if before - error(z) <= 1e-9 * before:
            break
    z = search(z, "trust-exact", initial_trust_radius=1e-3, max_trust_radius=0.1, gtol=1e-10, maxiter=min(steps, NEWTON_STEPS))
    return whole(z)


def refine(inputs, held):
    control, sites = inputs["control"], inputs["sites"]
    k, l = len(control), len(sites)
    problem = Problem(*(inputs[name] for name in ("Y", "w", "t", "u")), len(inputs["H"]), k, l)
    low, high = sites.min(axis=0), sites.max(axis=0)
    centre, size = (low + high) / 2, np.linalg.norm(high - low)
    free = np.arange(2 * (k + l)) < 2 * (k if held else k + l)
    x = descend(problem, (np.concatenate([control, sites]) - centre).ravel() / size, free, inputs["iterations"])
    fit, points = problem.fit(x), x.reshape(-1, 2)
    G = fit.affine[1:] / size
    g0 = fit.affine[0] - centre @ G - np.log(size) * (fit.s**2).sum(axis=1) @ fit.g  # phi(r / size) = (phi(r) - r^2 ln size) / size^2
    return {
        "control": centre + size * points[:k],
        "sites": centre + size * points[k:],
        "g": np.vstack([g0, fit.g / size**2, G]),
        "H": fit.H,
        "h0": problem.h0,
        "error": np.array([fit.error]),
    }


def prepare(stage, inputs):
    if stage != "signal.refine":
        raise Unsupported(f"no stage {stage} here")
    Y, w, t, u = (inputs[name] for name in ("Y", "w", "t", "u"))
    control, sites = inputs["control"], inputs["sites"]
    if not (len(Y) == len(w) == len(t) and len(u) == len(control) + 2 and control.shape[1] == sites.shape[1] == 2 and (w > 0).all()):
        raise ValueError("Y, w and t have R rows, u k+2 knots, control and sites two columns, and weights are positive")
    if len(sites) < 3 or inputs["H"].shape[0] < 1:
        raise Unsupported("fewer than three sites, or no dimension")
    return lambda: refine(inputs, held="held" in sys.argv)


if __name__ == "__main__":
    serve(serve_version(), prepare)
