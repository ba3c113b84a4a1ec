"""signal.psi: psi = h o g o f at any frame time, equation (1). scipy's CubicHermiteSpline evaluates rho, its BSpline the time signal f
(section 2.3), its cdist and xlogy the thin-plate pose signal g (section 2.2), and numpy the linear shape signal h (section 2.1).

The slopes of rho are Fritsch & Carlson's (1980) by reading 7: averaged secants, end secants, 0 beside flat intervals, and one sweep from
left to right that scales the two slopes of an interval back onto the circle of radius 3 secants. The k+2 knots of the paper get one more
copy of each end.
"""

import math
import os
import platform

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # at these sizes a second thread costs more than it saves

import numpy as np
import scipy
from scipy.interpolate import BSpline, CubicHermiteSpline
from scipy.spatial.distance import cdist
from scipy.special import xlogy

from wire import Unsupported, serve


def monotone_slopes(t):
    secants = np.diff(t)
    slopes = np.concatenate([secants[:1], (secants[:-1] + secants[1:]) / 2, secants[-1:]])
    flat = np.flatnonzero(secants == 0)
    slopes[flat] = slopes[flat + 1] = 0.0
    for i, secant in enumerate(secants):
        radius = math.hypot(slopes[i], slopes[i + 1])
        if radius > 3 * secant:
            slopes[i : i + 2] *= 3 * secant / radius
    return slopes


def pose_signal(p, sites, g):
    r = cdist(p, sites)
    l = len(sites)
    return g[0] + xlogy(r * r, r) @ g[1 : l + 1] + p @ g[l + 1 :]


def prepare(stage, inputs):
    if stage != "signal.psi":
        raise Unsupported(f"no stage {stage} here")
    h0, H, sites, g = (inputs[name] for name in ("h0", "H", "sites", "g"))
    control, u, t, tau = (inputs[name] for name in ("control", "u", "t", "tau"))
    if len(t) < 2:
        raise Unsupported("CubicHermiteSpline needs two frames")
    if len(g) != len(sites) + 3 or len(u) != len(control) + 2:
        raise ValueError("g needs l+3 rows and u k+2 knots")
    frames = np.arange(1.0, len(t) + 1)

    def call():
        rho = CubicHermiteSpline(frames, t, monotone_slopes(t))
        f = BSpline(np.concatenate([u[:1], u, u[-1:]]), control, 3)
        return {"Z": h0 + pose_signal(f(rho(tau)), sites, g) @ H}

    return call


serve(f"scipy {scipy.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
