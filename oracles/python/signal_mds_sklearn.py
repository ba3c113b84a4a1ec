"""Stage `signal.mds`: raw stress (6) of Cashman & Hormann 2012 by sklearn.manifold.smacof, the Guttman transform alone, from `start`.

metric=True is raw stress with unit weights and no rescaling (normalized_stress touches only the number reported). Given `init`, one run is made.
From scikit-learn 1.7 on it stops when the stress falls in one step by less than eps times the sum of the squared embedded distances. The stress is
1e-4 to 1e-1 of that sum and SMACOF converges linearly, so the default 1e-6 ends up to 4% high on real sequences; eps = 1e-13 was measured to end within
1.2e-8 of the stress where the gradient vanishes (horse 24, cow 221, samba 1291 steps). 20000 steps, some seconds at n = 204, are the bound.
Layouts of stress 0 compare only against the sum of delta^2. A start on a line stays on it, and coincident points may stay so.
"""

import numpy as np
import sklearn
from scipy.spatial.distance import cdist
from sklearn.manifold import smacof

from wire import Unsupported, serve

EPS = 1e-13
STEPS = 20000


def prepare(stage, inputs):
    if stage != "signal.mds":
        raise Unsupported(stage)
    X, start = inputs["X"], inputs["start"]
    if not np.ptp(X, axis=0).any():
        raise Unsupported("all frames are one pose: smacof's stopping rule divides 0 by 0")

    def call():
        P, _ = smacof(cdist(X, X), metric=True, init=start, n_init=1, eps=EPS, max_iter=STEPS, normalized_stress=False)
        return {"P": P}

    return call


if __name__ == "__main__":
    serve(f"scikit-learn {sklearn.__version__}, numpy {np.__version__}", prepare)
