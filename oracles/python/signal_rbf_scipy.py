"""signal.rbf at l = n: the thin-plate interpolant (sections 2.2 and 3.2) by scipy's RBFInterpolator, which solves the bordered system
of side conditions and interpolation by LU; fewer sites than frames it has not got.

Its kernel is r^2 ln r with our sign and epsilon = 1, of distances in the units of P, so the coefficients of phi are ours as they stand.
Its polynomial is a_0 + a . (p - shift)/scale, componentwise, with the box centre and half extents; so G = a/scale and
g_0 = a_0 - (a/scale) . shift. Its side conditions are sum g_j = 0 and sum g_j (s_j - shift)/scale = 0, the same space as reading 4's.
"""

import os
import platform

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # at these sizes a second thread costs more than it saves

import numpy as np
import scipy
from scipy.interpolate import RBFInterpolator

from wire import Unsupported, serve


def protocol_coefficients(spline, l):
    phi, a0, a = np.split(spline._coeffs, [l, l + 1])  # _coeffs, _shift, _scale: nothing public gives the coefficients
    G = a / spline._scale[:, None]
    return np.concatenate([a0 - spline._shift @ G, phi, G])


def prepare(stage, inputs):
    if stage != "signal.rbf":
        raise Unsupported(f"no stage {stage} here")
    P, X, sites, query = (inputs[name] for name in ("P", "X", "sites", "query"))
    if len(sites) != len(P):
        raise Unsupported("RBFInterpolator interpolates: it needs l = n")
    S, values = P[sites], X[sites]

    def call():
        spline = RBFInterpolator(S, values, kernel="thin_plate_spline", degree=1)
        return {"g": protocol_coefficients(spline, len(S)), "values": spline(P), "query_values": spline(query)}

    return call


serve(f"scipy {scipy.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
