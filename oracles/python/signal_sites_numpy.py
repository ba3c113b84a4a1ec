"""signal.sites: the greedy order of section 3.2.2, every fit from scratch. numpy's SVD finds the plane and its Householder QR, a fresh one
for every l, the least-squares residuals of the null-space form [1 p Phi N] (reading 4); ties and zeros are by reading 5.

Only residuals are wanted, so a fit is one projection X - Q Q^T X; lstsq stands in where coincident sites make R singular. P is scaled to
unit size (reading 10), and the kernel matrix of all the frames is formed once.
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


def null_space(sites):
    """Orthonormal columns N with N^T [1 s] = 0. Collinear sites keep only the independent columns of [1 s]."""
    l = len(sites)
    if l == 3:
        return np.empty((3, 0))  # an affine map, whatever the sites
    widest = np.argsort(-np.ptp(sites, axis=0))
    T = np.column_stack([np.ones(l), sites[:, widest]])
    rank = np.linalg.matrix_rank(T)
    return np.linalg.qr(T[:, :rank], mode="complete").Q[:, rank:]


def residual(A, X):
    Q, R = np.linalg.qr(A)
    pivots = np.abs(R.diagonal())
    if A.shape[0] < A.shape[1] or pivots.min() <= len(A) * np.finfo(float).eps * pivots.max():
        return X - A @ np.linalg.lstsq(A, X)[0]
    return X - Q @ (Q.T @ X)


def greedy_order(P, X, count):
    p = P - P.mean(axis=0)
    p /= np.abs(p).max() or 1.0
    affine = np.column_stack([np.ones(len(p)), p])
    r2 = np.square(p[:, None] - p).sum(axis=2)
    Phi = 0.5 * r2 * np.log(r2, out=np.zeros_like(r2), where=r2 > 0)
    size = np.linalg.norm(X)

    def error_norms(sites):
        norms = np.linalg.norm(residual(np.hstack([affine, Phi[:, sites] @ null_space(p[sites])]), X), axis=1)
        return norms * (norms @ norms > 1e-12 * size**2)

    distances = distances_from_plane(X)
    distances[distances < 1e-12 * size] = 0.0
    order = list(np.argsort(-distances, kind="stable")[:4])
    errors = [np.square(error_norms(order[:3])).sum()]
    for l in range(4, count + 1):
        norms = error_norms(order)
        errors.append(norms @ norms)
        if l < count:
            norms[order] = -1.0
            order.append(np.argmax(norms))
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
