"""Raw stress (6) of Cashman & Hormann 2012 brought to a vanishing gradient: SMACOF steps in numpy, then scipy's trust region.

The stress is the sum over pairs i < j of (||p_i - p_j|| - delta_ij)^2, unit weights, no rescaling, and only the free points move (3.2.1,
reading 6). The majorisation comes first and keeps the answer in the basin of the start: it stops when the stress falls by less than 1e-9 of
itself in a step, or after 3000 steps. scipy's trust-exact (More-Sorensen, exact Hessian) then goes to where the Hessian is not negative, off
the saddles that SMACOF cannot leave. Newton steps by LAPACK's gelsd take out the last digits, where the stress no longer tells points apart.
"""

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

SMACOF_STEPS = 3000
SMACOF_DECREASE = 1e-9
VANISHING = 1e-9  # relative gradient above which the answer is refused; about 1e-16 is what is usually reached


def stress(P, delta):
    return ((cdist(P, P) - delta) ** 2).sum() / 2


def _ratio(delta, d):
    """delta / d, and 0 where points coincide: what delta = 0 asks for, and the usual SMACOF choice elsewhere."""
    return np.divide(delta, d, out=np.zeros_like(d), where=d > 0)


def _pull(weights, P):
    """Sum over j of w_ij (p_i - p_j), by differences: coincident points, where w_ij is huge, would lose every digit in a Laplacian."""
    return np.einsum("ij,ijc->ic", weights, P[:, None] - P[None])


def gradient(P, delta):
    """(n, 2): the derivative of the stress at every point, free or not."""
    return 2 * _pull(1 - _ratio(delta, cdist(P, P)), P)


def hessian(P, delta):
    """(2n, 2n), the coordinates in the order x_0 y_0 x_1 y_1 ..."""
    d, difference = cdist(P, P), P[:, None] - P[None]
    ratio = _ratio(delta, d)
    unit = np.divide(difference, d[..., None], out=np.zeros_like(difference), where=d[..., None] > 0)
    pairs = (1 - ratio)[..., None, None] * np.eye(2) + ratio[..., None, None] * unit[..., :, None] * unit[..., None, :]
    blocks = -pairs
    blocks[np.diag_indices(len(P))] += pairs.sum(axis=1)
    return 2 * blocks.transpose(0, 2, 1, 3).reshape(2 * len(P), 2 * len(P))


def majorise(P, delta, free, steps=SMACOF_STEPS, decrease=SMACOF_DECREASE):
    """SMACOF over the free points: the Guttman transform, with V = n I - 1 1^T restricted to them."""
    n, pinned, previous = len(P), ~free, np.inf
    for _ in range(steps):
        d = cdist(P, P)
        now = ((d - delta) ** 2).sum() / 2
        if previous - now <= decrease * now:
            break
        previous = now
        target = _pull(_ratio(delta, d), P)[free] + P[pinned].sum(axis=0)
        if pinned.any():
            target += target.sum(axis=0) / pinned.sum()
        P = P.copy()
        P[free] = target / n
    return P


def _rigid_motions(P, free):
    """Unit columns: the motions of the free points that leave the stress as it is (translations, and a rotation about the pins)."""
    pins = P[~free]
    if len(pins) and np.ptp(pins, axis=0).any():
        return np.zeros((2 * free.sum(), 0))
    turned = (P[free] - (pins[0] if len(pins) else P.mean(axis=0))) @ [[0.0, 1.0], [-1.0, 0.0]]
    moves = [turned] + ([] if len(pins) else [np.ones((len(P), 1)) * axis for axis in np.eye(2)])
    return np.column_stack([move.ravel() / max(np.linalg.norm(move), np.finfo(float).tiny) for move in moves])


def newton(P, delta, free):
    """Trust-region Newton, off any saddle, then Newton steps for as long as the gradient falls. Lengths are about 1 here."""
    P, moving, x = P.copy(), np.repeat(free, 2), P[free].ravel()

    def at(x):
        P[free] = x.reshape(-1, 2)
        return P

    def jacobian(x):
        return gradient(at(x), delta)[free].ravel()

    def curvature(x):  # rigid motions get curvature too: the gradient is orthogonal to them, so no step changes
        motions = _rigid_motions(at(x), free)
        return hessian(P, delta)[np.ix_(moving, moving)] + 2 * len(P) * motions @ motions.T

    options = {"initial_trust_radius": 0.1, "max_trust_radius": 10.0, "gtol": 1e-9 * len(P), "maxiter": 500}
    for _ in range(20):
        x = minimize(lambda x: stress(at(x), delta), x, jac=jacobian, hess=curvature, method="trust-exact", options=options).x
        curvatures, directions = np.linalg.eigh(curvature(x))
        if curvatures[0] > -1e-6 * len(P):
            break
        x = x + 1e-2 * directions[:, 0]
    slope = jacobian(x)
    for _ in range(20):
        step = np.linalg.lstsq(curvature(x), slope, rcond=1e-12)[0]
        further = jacobian(x - step)
        if not np.linalg.norm(further) < np.linalg.norm(slope):
            break
        x, slope = x - step, further
    P = at(x)
    size = np.linalg.norm((delta + cdist(P, P)).sum(axis=1))
    if np.linalg.norm(slope) > VANISHING * size:
        raise ArithmeticError(f"the gradient of (6) is {np.linalg.norm(slope) / size:.1e} of the distances, not 0")
    return P


def _part(P, delta, free):
    """Moves free points that coincide although delta > 0 a little apart: such a point is no minimum, but its Guttman transform may be itself."""
    stuck = free & ((cdist(P, P) == 0) & (delta > 0)).any(axis=1)
    angle = np.arange(len(P))[stuck]
    P = P.copy()
    P[stuck] += 1e-9 * np.column_stack([np.cos(angle), np.sin(angle)])
    return P


def minimise(X, start, fixed=()):
    """The local minimum of (6) for the distances of X, reached from `start` (n, 2), whose rows `fixed` stay as they are."""
    return scaling(cdist(X, X), start, fixed)


def scaling(delta, start, fixed=()):
    """The same for any dissimilarities delta (n, n)."""
    free = np.ones(len(start), bool)
    free[np.asarray(fixed, int)] = False
    if not free.any():
        return start.copy()
    scale = max(delta.max(), np.ptp(start, axis=0).max()) or 1.0
    delta, P = delta / scale, start / scale
    P = newton(majorise(_part(P, delta, free), delta, free), delta, free) * scale
    P[~free] = start[~free]
    return P
