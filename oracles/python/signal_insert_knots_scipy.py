"""signal.insert_knots by SciPy: BSpline.insert_knot (FITPACK's insert, Boehm's algorithm), a knot at a time. BSpline evaluates.

The k+2 knots of the paper get one more copy of each end, and lose it again in the answer.
"""

import platform

import numpy as np
import scipy
from scipy.interpolate import BSpline

from wire import Unsupported, serve


def check(control, u, insert, query):
    if control.ndim != 2 or control.shape[1] != 2 or u.shape != (len(control) + 2,) or insert.ndim != 1 or query.ndim != 1:
        raise ValueError("control is (k,2), u (k+2), insert (r) and query (q)")
    if len(control) < 4 or np.any(np.diff(u) < 0) or not all(np.isfinite(a).all() for a in (control, u, insert, query)):
        raise ValueError("k is at least 4, u does not decrease, and all numbers are finite")
    begin, end = u[2], u[-3]
    if np.any(insert <= begin) or np.any(insert >= end):
        raise ValueError("a knot is inserted outside J")
    if np.any(query < begin) or np.any(query > end):
        raise ValueError("a query outside J")
    inner = np.concatenate([u[(u > begin) & (u < end)], insert])
    if len(inner) and np.unique(inner, return_counts=True)[1].max() > 3:
        raise ValueError("a knot would occur more than three times")


def prepare(stage, inputs):
    if stage != "signal.insert_knots":
        raise Unsupported(f"no stage {stage} here")
    control, u, insert, query = (inputs[name] for name in ("control", "u", "insert", "query"))
    check(control, u, insert, query)
    knots = np.concatenate([u[:1], u, u[-1:]])

    def call():
        curve = BSpline(knots, control, 3)
        for knot in insert:
            curve = curve.insert_knot(knot)
        return {"u": curve.t[1:-1], "control": curve.c, "values": curve(query)}

    return call


if __name__ == "__main__":
    serve(f"scipy {scipy.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
