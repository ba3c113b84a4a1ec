"""Stages `signal.mds` and `signal.mds_fixed`: raw stress (6) of Cashman & Hormann 2012 (3.2.1, reading 6), by scipy.optimize.

mds_stress does the work: SMACOF steps in numpy from `start` until the stress falls by less than 1e-9 of itself in a step (at most 3000), scipy's
trust-exact with the exact Hessian, then Newton steps until the gradient no longer falls. delta_ij = 0 is allowed. An answer whose gradient is not
below 1e-9 of the distances is refused as an error. Free layouts come back with their centroid at the origin.
"""

import numpy as np
import scipy

import mds_stress
from wire import Unsupported, serve


def prepare(stage, inputs):
    X, start = inputs["X"], inputs["start"]
    if stage == "signal.mds":
        return lambda: {"P": mds_stress.minimise(X, start)}
    if stage == "signal.mds_fixed":
        fixed = inputs["fixed"]
        start[fixed] = inputs["positions"]
        return lambda: {"P": mds_stress.minimise(X, start, fixed)}
    raise Unsupported(stage)


if __name__ == "__main__":
    serve(f"scipy {scipy.__version__}, numpy {np.__version__}", prepare)
