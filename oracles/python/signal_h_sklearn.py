"""Stage `signal.h`: section 3.1 of Cashman & Hormann 2012, minimising (3), by sklearn.decomposition.PCA(svd_solver="full").

Rank (reading 9): a singular value counts when it exceeds max(n, d) eps ||Z||_F, as in signal_h_numpy. PCA centres by the mean as the paper does
and flips signs by its own rule, so they are set again here. A single frame has variance 0/0 and is left out.
"""

import numpy as np
import sklearn
from sklearn.decomposition import PCA

from wire import Unsupported, serve


def shape_signal(Z, m):
    pca = PCA(n_components=min(m, *Z.shape), svd_solver="full")
    X, sigma = pca.fit_transform(Z), pca.singular_values_
    m = np.count_nonzero(sigma > max(Z.shape) * np.finfo(float).eps * np.linalg.norm(Z))
    H = pca.components_[:m]
    sign = np.sign(H[np.arange(m), np.abs(H).argmax(axis=1)])
    return {"h0": pca.mean_, "H": H * sign[:, None], "X": X[:, :m] * sign, "sigma": sigma[:m]}


def prepare(stage, inputs):
    if stage != "signal.h":
        raise Unsupported(stage)
    Z, m = inputs["Z"], inputs["m"]
    if len(Z) < 2 or m < 0:
        raise Unsupported(f"n = {len(Z)}, m = {m}")
    return lambda: shape_signal(Z, m)


if __name__ == "__main__":
    serve(f"scikit-learn {sklearn.__version__}, numpy {np.__version__}", prepare)
