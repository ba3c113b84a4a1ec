"""Stage `signal`: the whole of section 3 of Cashman & Hormann 2012, from frames to psi(1) ... psi(n), by numpy and scipy.

h by numpy.linalg.svd (3.1); p by SMACOF and trust-region Newton (6), see mds_stress; sites by the greedy order of 3.2.2, every fit made anew;
g by numpy.linalg.lstsq in the null space of the side conditions (reading 4), p centred and scaled to unit size; t centripetal; knots literal or
symmetric (reading 2); f by least squares on scipy's B-splines, the smoothest where k leaves freedom (reading 3). rho(i) = t_i, so psi(i) needs no rho.

Repeated poses (readings 8 and 10), in units of the layout's diameter: frames nearer than 1e-4 to an earlier pose are no sites of their own, and l is
cut to the number of poses; a step in time of at most 1e-9 is a held pose, its frames share a parameter, and k is cut to the number of distinct
parameters + 2. Rank of Z: singular values above max(n, d) eps ||Z||_F.
"""

import numpy as np
import scipy
import scipy.linalg
from scipy.interpolate import BSpline
from scipy.spatial.distance import cdist, pdist
from scipy.special import xlogy

import mds_stress
from wire import Unsupported, serve

MERGED = 1e-4
HELD = 1e-9


def shape_signal(Z, m):
    """h_0, H (m', d), X (n, m') (3)."""
    h0 = Z.mean(axis=0)
    U, sigma, Vt = np.linalg.svd(Z - h0, full_matrices=False)
    m = min(m, np.count_nonzero(sigma > max(Z.shape) * np.finfo(float).eps * np.linalg.norm(Z)))
    return h0, Vt[:m], U[:, :m] * sigma[:m]


def pose_basis(P, s):
    """The thin-plate splines on the sites s (l, 2) with the side conditions, then the affine functions, at the points P: (n, l)."""
    Q, R, _ = scipy.linalg.qr(np.column_stack([np.ones(len(s)), s]), pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = np.count_nonzero(diagonal > 1e-10 * diagonal[0])
    r2 = cdist(P, s, "sqeuclidean")
    return np.column_stack([xlogy(r2, r2) / 2 @ Q[:, rank:], np.ones(len(P)), P])


def pose_signal(P, X, s):
    """The coefficients of g in pose_basis that minimise (4) over all frames."""
    return np.linalg.lstsq(pose_basis(P, s), X, rcond=None)[0]


def distinct_poses(P):
    """The first frame of each pose: a frame nearer than MERGED to an earlier pose's first frame is that pose again."""
    first = []
    for i in range(len(P)):
        if not first or cdist(P[i : i + 1], P[first]).min() > MERGED * pdist(P).max():
            first.append(i)
    return np.array(first)


def greedy_sites(P, X, l):
    """The first l of the order sigma of section 3.2.2, among the distinct poses; ties go to the lower index."""
    poses = distinct_poses(P)
    off_plane = np.linalg.norm(X[:, 2:], axis=1)[poses]
    order = list(poses[np.argsort(-off_plane, kind="stable")[: min(l, 4)]])
    while len(order) < min(l, len(poses)):
        s = P[order]
        error = np.linalg.norm(X - pose_basis(P, s) @ pose_signal(P, X, s), axis=1)
        if (error**2).sum() < 1e-12 * (X**2).sum():
            error[:] = 0
        error[order] = -1
        order.append(poses[np.argmax(error[poses])])
    return np.array(order)


def knots(t, k, rule):
    """u_0 ... u_{k+1} from n strictly increasing parameters (readings 1 and 2)."""
    n = len(t)
    if k == n + 2:
        interior = t[1:-1]
    else:
        jd = np.arange(1, k - 3) * ((n if rule == "literal" else n - 1) / (k - 3))
        i = np.floor(jd).astype(int)
        first = i - 1 if rule == "literal" else i
        interior = (1 - (jd - i)) * t[first] + (jd - i) * t[first + 1]
    return np.concatenate([np.repeat(t[0], 3), interior, np.repeat(t[-1], 3)])


def spline_fit(t, u, P):
    """f(t_i), the least squares of (7): the smoothest if k exceeds the number of distinct t, else the least norm."""
    u, k = np.concatenate([u[:1], u, u[-1:]]), len(u) - 2
    A = BSpline.design_matrix(t, u, 3).toarray()
    control = np.linalg.lstsq(A, P, rcond=None)[0]
    if k > len(np.unique(t)):
        ends = np.unique(u)
        gauss = np.concatenate([(ends[1:] + ends[:-1] + sign * np.diff(ends) / 3**0.5) / 2 for sign in (-1, 1)])
        bending = BSpline(u, np.eye(k), 3)(gauss, nu=2) * np.sqrt(np.tile(np.diff(ends), 2) / 2)[:, None]
        free = scipy.linalg.null_space(A)
        control -= free @ np.linalg.lstsq(bending @ free, bending @ control, rcond=None)[0]
    return A @ control


def time_signal(P, k, rule):
    """f(i) at every frame."""
    steps = np.linalg.norm(np.diff(P, axis=0), axis=1)
    steps[steps <= HELD * pdist(P).max()] = 0
    t = np.concatenate([[0], np.cumsum(np.sqrt(steps))])
    distinct = np.unique(t)
    if len(distinct) < 2:
        return np.tile(P.mean(axis=0), (len(P), 1))
    return spline_fit(t, knots(distinct, min(k, len(distinct) + 2), rule), P)


def reconstruct(Z, k, l, m, rule):
    """The errors (3), (4), (7), (2), psi at the frames, the layout and the sites."""
    h0, H, X = shape_signal(Z, m)
    start = np.pad(X[:, :2], [(0, 0), (0, max(0, 2 - X.shape[1]))])
    P = mds_stress.minimise(X, start)
    F = time_signal(P, k, rule)
    centre, size = P.mean(axis=0), np.ptp(P, axis=0).max() or 1.0
    p, f = (P - centre) / size, (F - centre) / size
    order = greedy_sites(p, X, l)
    g = pose_signal(p, X, p[order])
    psi = h0 + pose_basis(f, p[order]) @ g @ H
    parts = Z - h0 - X @ H, X - pose_basis(p, p[order]) @ g, P - F, Z - psi
    return {"errors": np.array([(part**2).sum() for part in parts]), "Z": psi, "P": P, "order": order}


def prepare(stage, inputs):
    if stage != "signal":
        raise Unsupported(stage)
    Z, k, l, m = (inputs[name] for name in ("Z", "k", "l", "m"))
    if not (len(Z) >= 3 and k >= 4 and 3 <= l <= len(Z) and m >= 0):
        raise Unsupported(f"n, k, l, m = {len(Z)}, {k}, {l}, {m}")
    return lambda: reconstruct(Z, k, l, m, inputs["rule"])


if __name__ == "__main__":
    serve(f"numpy {np.__version__}, scipy {scipy.__version__}", prepare)
