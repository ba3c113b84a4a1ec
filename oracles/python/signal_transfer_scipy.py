"""signal.transfer by SciPy, section 4.3: scipy.linalg.lstsq with LAPACK gelsy, a QR factorisation with column pivoting, completed to the
solution of least norm where examples are dependent.

gelsy finds the rank by an estimate of the condition of R, not by singular values: near the contract's 1e-10 it may decide otherwise.
"""

import numpy as np
from scipy.linalg import lstsq

from shape_mesh import serve_version
from signal_transfer_numpy import check
from wire import Unsupported, serve


def prepare(stage, inputs):
    if stage != "signal.transfer":
        raise Unsupported(f"no stage {stage} here")
    Z, Q, R = (inputs[name] for name in ("Z", "Q", "R"))
    check(Z, Q, R)

    def call():
        X = lstsq((Q[1:] - Q[0]).T, (Z - Q[0]).T, cond=1e-10, lapack_driver="gelsy")[0].T
        return {"X": X, "W": R[0] + X @ (R[1:] - R[0])}

    return call


if __name__ == "__main__":
    serve(serve_version(), prepare)
