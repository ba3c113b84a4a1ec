"""signal.sites: the greedy order of section 3.2.2 by one QR that a new site makes a column longer. numpy does the vector work:
block Gram-Schmidt, done twice, and a residual that loses one direction a step.

The spaces are nested: to {1, p_1, p_2, ...} a site s adds the one function phi(|s - p|) - sum_j w_j phi(|s_j - p|) with sum_j w_j = 1 and
sum_j w_j s_j = s over the sites before it (the least-norm weights), which meets the side conditions of reading 4. Where no such weights
exist (a site that is affinely independent of those before it) it adds nothing. Ties and zeros are by reading 5; P is scaled to unit size
(reading 10).
"""

import os
import platform

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # at these sizes a second thread costs more than it saves

import numpy as np

from wire import Unsupported, serve


def distances_from_plane(X):
    centred = X - X.mean(axis=0)
    plane = np.linalg.svd(centred, full_matrices=False).Vh[:2]
    return np.linalg.norm(centred - centred @ plane.T @ plane, axis=1)


class GrowingFit:
    """An orthonormal basis of the columns seen so far (at most as many as `X` has rows) and the residual of X against it."""

    def __init__(self, X):
        self.basis = np.empty((len(X), len(X)), order="F")
        self.rank = 0
        self.residual = X.copy()

    def append(self, column, size):
        """Adds a column that was computed from numbers of this size; one within rounding of the space adds nothing."""
        Q = self.basis[:, : self.rank]
        rest = column - Q @ (Q.T @ column)
        rest -= Q @ (Q.T @ rest)  # the second pass removes what rounding left of the first
        length = np.linalg.norm(rest)
        if self.rank < len(column) and length > len(column) * np.finfo(float).eps * size:
            q = rest / length
            self.basis[:, self.rank] = q
            self.rank += 1
            self.residual -= np.outer(q, q @ self.residual)


def greedy_order(P, X, count):
    p = P - P.mean(axis=0)
    p /= np.abs(p).max() or 1.0
    T = np.column_stack([np.ones(len(p)), p])
    size = np.linalg.norm(X)
    distances = distances_from_plane(X)
    distances[distances < 1e-12 * size] = 0.0
    queue = list(np.argsort(-distances, kind="stable")[:4])

    fit = GrowingFit(X)
    for column in T.T:
        fit.append(column, np.linalg.norm(column))

    def error_norms():
        norms = np.linalg.norm(fit.residual, axis=1)
        return norms * (norms @ norms > 1e-12 * size**2)

    order, errors, Phi = [], [np.square(error_norms()).sum()], np.empty((len(p), count))
    for l in range(1, count + 1):
        site = queue.pop(0)
        r2 = np.square(p - p[site]).sum(axis=1)
        Phi[:, l - 1] = 0.5 * r2 * np.log(r2, out=np.zeros_like(r2), where=r2 > 0)
        weights = np.linalg.lstsq(T[order].T, T[site])[0]
        spread = 1 + np.abs(weights).sum()
        if np.linalg.norm(weights @ T[order] - T[site]) < 1e-12 * spread:
            fit.append(Phi[:, l - 1] - Phi[:, : l - 1] @ weights, spread * np.linalg.norm(Phi[:, l - 1]))
        order.append(site)
        if l >= 4:
            norms = error_norms()
            errors.append(norms @ norms)
            norms[order] = -1.0
            queue.append(np.argmax(norms))
    return np.array(order), np.array(errors)


def prepare(stage, inputs):
    if stage != "signal.sites":
        raise Unsupported(f"no stage {stage} here")
    P, X, count = inputs["P"], inputs["X"], inputs["count"]
    if not 4 <= count <= len(P):
        raise Unsupported(f"count = {count} is outside 4..n with n = {len(P)}")
    return lambda: dict(zip(("order", "errors"), greedy_order(P, X, count)))


blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
serve(f"numpy {np.__version__} ({blas['name']} {blas['version']}), Python {platform.python_version()}", prepare)
