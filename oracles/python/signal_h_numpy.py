"""Stage `signal.h`: section 3.1 of Cashman & Hormann 2012, minimising (3), by numpy.linalg.svd (LAPACK gesdd, thin).

Rank (reading 9): a singular value counts when it exceeds max(n, d) eps ||Z||_F. The yardstick is the frames themselves, not their largest centred
singular value, because the rounding of Z - h_0 is relative to Z: equal frames have rank 0.
"""

import numpy as np

from wire import Unsupported, serve


def shape_signal(Z, m):
    h0 = Z.mean(axis=0)
    U, sigma, Vt = np.linalg.svd(Z - h0, full_matrices=False)
    m = min(m, np.count_nonzero(sigma > max(Z.shape) * np.finfo(float).eps * np.linalg.norm(Z)))
    H, X, sigma = Vt[:m], U[:, :m] * sigma[:m], sigma[:m]
    sign = np.sign(H[np.arange(m), np.abs(H).argmax(axis=1)])
    return {"h0": h0, "H": H * sign[:, None], "X": X * sign, "sigma": sigma}


def prepare(stage, inputs):
    if stage != "signal.h":
        raise Unsupported(stage)
    Z, m = inputs["Z"], inputs["m"]
    if not len(Z) or m < 0:
        raise Unsupported(f"n = {len(Z)}, m = {m}")
    return lambda: shape_signal(Z, m)


if __name__ == "__main__":
    serve(f"numpy {np.__version__}", prepare)
