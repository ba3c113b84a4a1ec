"""signal.knots: the k+2 knots u_0..u_{k+1} of section 3.3, by readings 1 and 2. The work is numpy's.

"literal" is Piegl & Tiller (9.68)-(9.69), d = n/(k-3), with the configuration u_{i+1} = t_i substituted at k = n+2. "symmetric" is
d = (n-1)/(k-3), which gets there by itself. floor(j d) and its remainder are found in integers, so that no rounding of d moves a knot
to the next span.
"""

import platform

import numpy as np

from wire import Unsupported, serve


def interior_knots(t, k, rule):
    n = len(t)
    j = np.arange(1, k - 3)
    if rule == "literal" and k == n + 2:
        return t[j]
    if rule == "literal":
        i, remainder = np.divmod(j * n, k - 3)
        left, right = t[i - 1], t[i]
    else:
        i, remainder = np.divmod(j * (n - 1), k - 3)
        left, right = t[i], t[i + 1]
    a = remainder / (k - 3)
    return (1 - a) * left + a * right


def prepare(stage, inputs):
    if stage != "signal.knots":
        raise Unsupported(f"no stage {stage} here")
    t, k, rule = inputs["t"], inputs["k"], inputs["rule"]
    if rule not in ("literal", "symmetric"):
        raise Unsupported(f"no knot rule {rule!r}")
    if len(t) < 2 or not 4 <= k <= len(t) + 2:
        raise Unsupported(f"k = {k} is outside 4..n+2 with n = {len(t)}, n >= 2")

    def call():
        return {"u": np.concatenate([[t[0]] * 3, interior_knots(t, k, rule), [t[-1]] * 3])}

    return call


serve(f"numpy {np.__version__}, Python {platform.python_version()}", prepare)
