"""Stage `signal.layout` by scikit-learn and scipy.sparse.csgraph: Dijkstra's shortest paths, ClassicalMDS, then smacof.

Feet on steps come from scikit-learn's paired distances, for all frames of a step at once; the graph is a sparse matrix, whose explicit zeros
csgraph takes for joints of length 0. ClassicalMDS turns its eigenvectors as the contract does (svd_flip). smacof is the Guttman transform
alone, stopped as in signal_mds_sklearn: its P ends a relative 1e-8 or so above the stress where the gradient vanishes. It cannot leave a line, so
a start on one is refused unless the line is the answer.
"""

import os
import platform

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import sklearn
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from sklearn.manifold import ClassicalMDS, smacof
from sklearn.metrics.pairwise import paired_euclidean_distances

from wire import Unsupported, serve

EPS = 1e-13
STEPS = 20000


def lengths_of_steps(X):
    return paired_euclidean_distances(X[:-1], X[1:])


def all_distances(X):
    """Row by row from differences: sklearn's euclidean_distances goes through squares and loses half the digits."""
    return np.array([paired_euclidean_distances(np.broadcast_to(x, X.shape), X) for x in X])


def graph(X, greatest):
    n, still = len(X), 1e-9 * greatest
    step = lengths_of_steps(X)
    step[step <= still] = 0
    length = np.sqrt(step * np.mean(step))
    beside = np.maximum(np.append(step, 0), np.insert(step, 0, 0))
    frames = np.arange(n)
    shortest = {(j, j + 1): length[j] for j in range(n - 1)}
    for j in range(n - 1):
        along = X[j + 1] - X[j] if step[j] else np.zeros(X.shape[1])
        share = np.clip((X - X[j]) @ along / (along @ along or 1), 0, 1)
        off = paired_euclidean_distances(X, X[j] + np.outer(share, along))
        lies = (off <= np.fmax(0.05 * np.fmin(step[j], beside), still)) & (frames != j) & (frames != j + 1)
        for i in frames[lies]:
            for end, part in ((j, share[i]), (j + 1, 1 - share[i])):
                pair = min(i, end), max(i, end)
                shortest[pair] = min(shortest.get(pair, np.inf), part * length[j])
    rows, columns = zip(*shortest)
    return csr_array((list(shortest.values()), (rows, columns)), shape=(n, n))


def prepare(stage, inputs):
    if stage != "signal.layout":
        raise Unsupported(f"no stage {stage} here")
    X, w = inputs["X"], inputs["weight"][0]
    if X.ndim != 2 or not np.isfinite(X).all() or not 0 <= w <= 1:
        raise ValueError("X is (n,m) and finite, and weight is in [0, 1]")
    if not np.ptp(X, axis=0).any():
        raise Unsupported("all frames are one pose: smacof's stopping rule divides 0 by 0")

    def call():
        D = all_distances(X)
        gamma = dijkstra(graph(X, D.max()), directed=False)
        mixed = np.sqrt((1 - w) * np.square(D) + w * np.square(gamma))
        delta = mixed * (np.linalg.norm(D) / np.linalg.norm(mixed)) if mixed.any() else mixed
        delta = (delta + delta.T) / 2  # sums of a path taken from its two ends differ in their last digit
        start = ClassicalMDS(metric="precomputed").fit(delta)
        if not start.eigenvalues_[1] > 1e-12 * start.eigenvalues_[0]:
            start.embedding_[:, 1] = 0
        P, stress = smacof(delta, init=start.embedding_, n_init=1, eps=EPS, max_iter=STEPS, normalized_stress=False)
        if not P[:, 1].any() and stress > 1e-12 * np.square(delta).sum():
            raise Unsupported("classical scaling starts on a line, which smacof cannot leave")
        return {"delta": delta, "P": P}

    return call


if __name__ == "__main__":
    serve(f"scikit-learn {sklearn.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
