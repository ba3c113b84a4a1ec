"""Stage `signal.layout`: dissimilarities along the motion, and their scaling. The stage is ours (section 6 asks for a layout free of pins), and
PROTOCOL.md is its text. Shortest paths by Floyd's and Warshall's recurrence on a dense matrix, classical scaling by numpy.linalg.eigh, and
mds_stress for the rest: SMACOF in numpy, then scipy's trust region and Newton steps until the gradient of (6) no longer falls.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import mds_stress
from shape_mesh import serve_version
from wire import Unsupported, serve

NEAR = 0.05  # of a step's length: nearer than that to a step, a frame lies on it
STILL = 1e-9  # of the greatest distance: what is shorter is no step
FLAT = 1e-12  # of the first eigenvalue: a second one that is no greater makes no axis


def distances(X):
    return np.linalg.norm(X[:, None] - X[None], axis=2)


def nearest_share(x, a, b):
    """u in [0, 1] with a + u (b - a) nearest to x."""
    along = b - a
    return min(max((x - a) @ along / (along @ along), 0.0), 1.0)


def joints(X, D):
    """(n, n): the lengths of the joints of two frames, and inf where there is none."""
    n, least = len(X), STILL * D.max()
    step = np.array([D[j, j + 1] if D[j, j + 1] > least else 0.0 for j in range(n - 1)])
    length = np.sqrt(step * step.mean()) if n > 1 else step
    joint = np.full((n, n), np.inf)
    np.fill_diagonal(joint, 0)

    def join(i, j, distance):
        joint[i, j] = joint[j, i] = min(joint[i, j], distance)

    for j in range(n - 1):
        join(j, j + 1, length[j])
    for i in range(n):
        beside = max(step[max(i - 1, 0) : i + 1], default=0.0)
        for j in set(range(n - 1)) - {i - 1, i}:
            u = nearest_share(X[i], X[j], X[j + 1]) if step[j] > 0 else 0.0
            foot = X[j] + u * (X[j + 1] - X[j])
            if np.linalg.norm(X[i] - foot) <= max(NEAR * min(step[j], beside), least):
                join(i, j, u * length[j])
                join(i, j + 1, (1 - u) * length[j])
    return joint


def shortest_paths(joint):
    path = joint.copy()
    for via in range(len(path)):
        np.minimum(path, path[:, via, None] + path[via], out=path)
    return path


def dissimilarities(X, w):
    D = distances(X)
    delta = np.sqrt((1 - w) * D**2 + w * shortest_paths(joints(X, D)) ** 2)
    return delta * np.sqrt((D**2).sum() / (delta**2).sum()) if delta.any() else delta


def classical_scaling(delta):
    n = len(delta)
    J = np.eye(n) - 1 / n
    eigenvalues, vectors = np.linalg.eigh(-J @ delta**2 @ J / 2)
    P = np.zeros((n, 2))
    first = eigenvalues[-1]
    for axis in range(min(n, 2)):
        eigenvalue, vector = eigenvalues[-1 - axis], vectors[:, -1 - axis]
        if eigenvalue > (FLAT * first if axis else 0):
            P[:, axis] = np.sqrt(eigenvalue) * vector * np.sign(vector[np.argmax(np.abs(vector))])
    return P


def prepare(stage, inputs):
    if stage != "signal.layout":
        raise Unsupported(f"no stage {stage} here")
    X, (w,) = inputs["X"], inputs["weight"]
    if X.ndim != 2 or not np.isfinite(X).all() or not 0 <= w <= 1:
        raise ValueError("X is (n,m) and finite, and weight is in [0, 1]")

    def call():
        delta = dissimilarities(X, w)
        return {"delta": delta, "P": mds_stress.scaling(delta, classical_scaling(delta))}

    return call


if __name__ == "__main__":
    serve(serve_version(), prepare)
