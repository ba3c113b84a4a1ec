"""signal.rbf for any 3 <= l <= n: the thin-plate least-squares fit (4) by the null-space method (section 3.2, reading 4). numpy's QR and
lstsq (LAPACK gelsd) do the work.

The coefficients (g_1..g_l) = N y lie in the orthogonal complement of the columns of T = [1 s], whose basis N is the tail of a complete QR
of T; the fit is then the n x l system [1 p Phi N]. It is formed in p^ = (p - c)/w, of unit size (reading 10). To undo that, with
ln(r/w) = ln r - ln w and, by the side conditions, sum_j |s_j - p|^2 g_j = sum_j |s_j - c|^2 g_j for every p:
g_j = g^_j / w^2, G = G^ / w, g_0 = g^_0 - G c - ln w sum_j |s^_j|^2 g^_j.
"""

import os
import platform

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # at these sizes a second thread costs more than it saves

import numpy as np

from wire import Unsupported, serve


def thin_plate(points, sites):
    r2 = np.square(points[:, None] - sites).sum(axis=2)
    return 0.5 * r2 * np.log(r2, out=np.zeros_like(r2), where=r2 > 0)


def null_space(sites):
    """Orthonormal columns N with N^T [1 s] = 0. Collinear sites keep only the independent columns of [1 s]."""
    l = len(sites)
    if l == 3:
        return np.empty((3, 0))  # an affine map, whatever the sites
    widest = np.argsort(-np.ptp(sites, axis=0))
    T = np.column_stack([np.ones(l), sites[:, widest]])
    rank = np.linalg.matrix_rank(T)
    return np.linalg.qr(T[:, :rank], mode="complete").Q[:, rank:]


def prepare(stage, inputs):
    if stage != "signal.rbf":
        raise Unsupported(f"no stage {stage} here")
    P, X, sites, query = (inputs[name] for name in ("P", "X", "sites", "query"))
    if len(sites) < 3:
        raise Unsupported("a thin-plate spline needs 3 sites")

    def call():
        centre = P.mean(axis=0)
        width = np.abs(P - centre).max() or 1.0
        p, q = (P - centre) / width, (query - centre) / width
        s = p[sites]
        N = null_space(s)
        affine, Phi = np.column_stack([np.ones(len(p)), p]), thin_plate(p, s)
        solution = np.linalg.lstsq(np.hstack([affine, Phi @ N]), X)[0]
        a0, A, g = solution[:1], solution[1:3], N @ solution[3:]
        G = A / width
        g0 = a0 - centre @ G - np.log(width) * (np.square(s).sum(axis=1) @ g)
        return {
            "g": np.concatenate([g0, g / width**2, G]),
            "values": a0 + p @ A + Phi @ g,
            "query_values": a0 + q @ A + thin_plate(q, s) @ g,
        }

    return call


blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
serve(f"numpy {np.__version__} ({blas['name']} {blas['version']}), Python {platform.python_version()}", prepare)
