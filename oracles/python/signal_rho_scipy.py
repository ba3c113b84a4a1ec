"""signal.rho: the monotone reparametrisation rho(i) = t_i of section 2.3. scipy's CubicHermiteSpline evaluates it.

The slopes follow Fritsch & Carlson (1980) by reading 7, on unit spacing: secants Delta_i = t_{i+1} - t_i; their averages inside, the
secants themselves at the ends; 0 at both ends of a flat interval. Then one sweep from left to right, where an interval sees what the one
before left: where (alpha, beta) = (d_i, d_{i+1}) / Delta_i lies outside the circle of radius 3, both slopes are scaled back onto it. A
slope only ever shrinks, so no earlier interval is spoilt. (scipy's PchipInterpolator is Fritsch & Butland's other choice of slopes.)
"""

import math
import platform

import numpy as np
import scipy
from scipy.interpolate import CubicHermiteSpline

from wire import Unsupported, serve


def monotone_slopes(t):
    secants = np.diff(t)
    slopes = np.concatenate([secants[:1], (secants[:-1] + secants[1:]) / 2, secants[-1:]])
    flat = np.flatnonzero(secants == 0)
    slopes[flat] = slopes[flat + 1] = 0.0
    for i, secant in enumerate(secants):
        radius = math.hypot(slopes[i], slopes[i + 1])  # |Delta_i| times the norm of (alpha, beta)
        if radius > 3 * secant:
            slopes[i : i + 2] *= 3 * secant / radius
    return slopes


def prepare(stage, inputs):
    if stage != "signal.rho":
        raise Unsupported(f"no stage {stage} here")
    t, query = inputs["t"], inputs["query"]
    if len(t) < 2:
        raise Unsupported("CubicHermiteSpline needs two frames")
    if np.any(np.diff(t) < 0):
        raise ValueError("t decreases")
    frames = np.arange(1.0, len(t) + 1)

    def call():
        slopes = monotone_slopes(t)
        return {"values": CubicHermiteSpline(frames, t, slopes)(query), "slopes": slopes}

    return call


serve(f"scipy {scipy.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
