"""signal.spline: the cubic least-squares fit (7) of section 2.3, by readings 1 and 3. scipy's make_lsq_spline (banded Givens QR) where the
data determine all k control points (the Schoenberg-Whitney conditions); its make_interp_spline for the natural spline at k = n+2,
u_{i+1} = t_i. Otherwise numpy: the smoothest minimiser of (7) where k exceeds the number of distinct t, else the least-norm one.

BSpline evaluates. The k+2 knots of the paper get one more copy of each end. Which routine applies is found before the clock starts.
"""

import platform

import numpy as np
import scipy
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from wire import Unsupported, serve


def schoenberg_whitney(A):
    """Whether every B-spline, from left to right, gets a parameter of its own at which it is not 0 (A: one row a distinct parameter)."""
    row = 0
    for column in A.T:
        while row < len(A) and column[row] == 0:
            row += 1
        row += 1
    return row <= len(A)


def bending_matrix(knots):
    """W with |W c|^2 the integral of |f''|^2 over J: f'' is linear on a span, so two Gauss points a span are exact."""
    k = len(knots) - 4
    breaks = np.unique(knots[3 : k + 1])
    nodes, weights = np.polynomial.legendre.leggauss(2)
    half = np.diff(breaks)[:, None] / 2
    points = (breaks[:-1, None] + half * (1 + nodes)).ravel()
    return np.sqrt(half * weights).reshape(-1, 1) * BSpline(knots, np.eye(k), 3)(points, nu=2)


def smoothest(A, P, knots):
    """Of all minimisers c + N y of |A c - P| the one with the least |W (c + N y)|."""
    c = np.linalg.lstsq(A, P)[0]
    N = np.linalg.svd(A).Vh[np.linalg.matrix_rank(A) :].T
    W = bending_matrix(knots)
    return c - N @ np.linalg.lstsq(W @ N, W @ c)[0]


def solver(t, knots, P):
    """The routine that applies to these data, ready to be called for the control points."""
    k = len(knots) - 4
    distinct = np.unique(t)
    A = BSpline.design_matrix(t, knots, 3).toarray()
    interpolation = np.concatenate([[t[0]] * 3, t, [t[-1]] * 3])  # u_{i+1} = t_i
    if len(distinct) == len(t) and np.array_equal(knots, interpolation):
        return lambda: make_interp_spline(t, P, k=3, bc_type="natural").c
    if schoenberg_whitney(BSpline.design_matrix(distinct, knots, 3).toarray()):
        return lambda: make_lsq_spline(t, P, knots, k=3).c
    if k <= len(distinct):
        return lambda: np.linalg.lstsq(A, P)[0]
    return lambda: smoothest(A, P, knots)


def prepare(stage, inputs):
    if stage != "signal.spline":
        raise Unsupported(f"no stage {stage} here")
    t, u, P, query = (inputs[name] for name in ("t", "u", "P", "query"))
    knots = np.concatenate([u[:1], u, u[-1:]])
    solve = solver(t, knots, P)

    def call():
        control = solve()
        f = BSpline(knots, control, 3)
        return {"control": control, "values": f(t), "query_values": f(query)}

    return call


serve(f"scipy {scipy.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
