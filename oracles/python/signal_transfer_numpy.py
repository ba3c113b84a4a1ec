"""signal.transfer by numpy, section 4.3: least squares by SVD (numpy.linalg.lstsq, LAPACK gelsd), which takes the solution of least norm where
examples are dependent; or with the argument `normal` by the paper's normal equation, H^T H X = H^T Y^T, and a Cholesky factorisation.

The normal equation squares the condition: examples whose condition is above 1e6 are unsupported by `normal`, dependent ones among them.
"""

import sys

import numpy as np

from shape_mesh import serve_version
from wire import Unsupported, serve


def check(Z, Q, R):
    if Z.ndim != 2 or Q.ndim != 2 or R.ndim != 2 or Z.shape[1] != Q.shape[1] or len(Q) != len(R) or len(Q) < 2:
        raise ValueError("Z is (n,d), Q (m+1,d) and R (m+1,d'), m >= 1")
    if not all(np.isfinite(a).all() for a in (Z, Q, R)):
        raise ValueError("Z, Q and R are finite")


def by_svd(H, Y):
    return np.linalg.lstsq(H.T, Y.T, rcond=1e-10)[0].T


def by_normal_equation(H, Y):
    L = np.linalg.cholesky(H @ H.T)
    return np.linalg.solve(L.T, np.linalg.solve(L, H @ Y.T)).T


def prepare(stage, inputs):
    if stage != "signal.transfer":
        raise Unsupported(f"no stage {stage} here")
    Z, Q, R = (inputs[name] for name in ("Z", "Q", "R"))
    check(Z, Q, R)
    fit = by_svd
    if sys.argv[1:] == ["normal"]:
        fit = by_normal_equation
        sigma = np.linalg.svd(Q[1:] - Q[0], compute_uv=False)
        if len(sigma) < len(Q) - 1 or sigma[-1] <= 1e-6 * sigma[0]:
            raise Unsupported("the examples are nearly dependent: the normal equation has lost them")

    def call():
        X = fit(Q[1:] - Q[0], Z - Q[0])
        return {"X": X, "W": R[0] + X @ (R[1:] - R[0])}

    return call


if __name__ == "__main__":
    serve(serve_version(), prepare)
