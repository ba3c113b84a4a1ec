"""shape.halfway by libigl: arap_precomputation and arap_solve, whose energy on a surface in space is that of spokes and rims (Chao, Pinkall,
Sanan, Schroeder 2010): for each vertex, the cotangent-weighted edges of its triangles against one rotation. At every step from `start` (see
PROTOCOL.md) libigl alternates rotations and positions ITERATIONS times; at the last, until ITERATIONS of them move no vertex by more than STILL
of the diagonal, MOST at most, as such alternations end slowly: a tenth of STILL changed the mean edge length of a horse and a dancer by 3e-6 of it.

libigl fits rotations in single precision (its polar_svd3x3): even what is at rest moves by 1e-7 of the diagonal.
What it has not got is said: components without a handle, degenerate triangles (their cotangents have no bound). Unlike CGAL it takes any surface.
"""

import platform
from importlib.metadata import version

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from wire import Unsupported, serve

ITERATIONS, STILL, MOST = 10, 1e-5, 1000
TURN, MOVE = np.radians(10), 0.1


def joined(F, vertices, V):
    """The component of each of `vertices` in the graph of the edges between them."""
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    kept = np.isin(edges, vertices).all(axis=1)
    graph = sparse.coo_matrix((np.ones(kept.sum()), tuple(edges[kept].T)), (V, V))
    return np.unique(connected_components(graph, directed=False)[1][vertices], return_inverse=True)[1]


class Grip:
    """Handles that move together: their centre on a line, their rotation by equal parts, the rest in proportion."""

    def __init__(self, begin, end):
        self.begin, self.move = begin.mean(axis=0), end.mean(axis=0) - begin.mean(axis=0)
        self.arms, ends = begin - self.begin, end - end.mean(axis=0)
        M = ends.T @ self.arms
        U, _, Vt = np.linalg.svd(M + 1e-9 * np.linalg.norm(M) * np.eye(3))  # the identity decides what the arms leave free
        R = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
        self.turn, self.rest = Rotation.from_matrix(R).as_rotvec(), ends @ R - self.arms

    def at(self, s):
        return self.begin + s * self.move + (self.arms + s * self.rest) @ Rotation.from_rotvec(s * self.turn).as_matrix().T

    def steps(self, diagonal):
        return max(np.linalg.norm(self.turn) / TURN, np.linalg.norm(self.move) / (MOVE * diagonal))


def path(start, F, handles, targets, diagonal):
    """Positions of the handles, from after `start` to the targets themselves."""
    grip = joined(F, handles, len(start))
    members = [np.flatnonzero(grip == g) for g in range(grip.max(initial=-1) + 1)]
    grips = [Grip(start[handles[m]], targets[m]) for m in members]
    count = max(1, int(np.ceil(max(g.steps(diagonal) for g in grips))))
    for i in range(1, count):
        positions = np.empty_like(targets)
        for m, g in zip(members, grips):
            positions[m] = g.at(i / count)
        yield positions
    yield targets


def check(start, F, handles, targets):
    V = len(start)
    if start.shape != (V, 3) or F.ndim != 2 or F.shape[1] != 3 or targets.shape != (len(handles), 3) or handles.ndim != 1:
        raise ValueError("start is (V,3), F (F,3), handles (H) and targets (H,3)")
    if not np.isfinite(start).all() or not np.isfinite(targets).all():
        raise ValueError("positions are finite")
    for indices in (F, handles):
        if np.any(indices < 0) or np.any(indices >= V):
            raise ValueError("a face or a handle names a vertex that is not there")
    if len(np.unique(handles)) < len(handles):
        raise ValueError("a vertex is a handle twice")
    component = joined(F, np.arange(V), V)
    if len(np.unique(component[handles])) < component.max(initial=-1) + 1:
        raise Unsupported("a component has no handle: an as-rigid-as-possible deformation leaves it where it likes")
    sides = igl.edge_lengths(start, F) if len(F) else np.ones((1, 3))
    if len(F) and np.any(igl.doublearea(start, F) <= 1e-5 * sides.max(axis=1) ** 2):
        raise Unsupported("a triangle of start is degenerate: its cotangents have no bound")


def prepare(stage, inputs):
    if stage != "shape.halfway":
        raise Unsupported(f"no stage {stage} here")
    start, F, handles, targets = (np.ascontiguousarray(inputs[name]) for name in ("start", "F", "handles", "targets"))
    check(start, F, handles, targets)
    diagonal = np.linalg.norm(np.ptp(start, axis=0))

    def call():
        data = igl.ARAPData()
        data.max_iter = ITERATIONS
        igl.arap_precomputation(start, F, 3, handles.astype(np.int32), data)
        x = start
        for positions in path(start, F, handles, targets, diagonal):
            x = igl.arap_solve(positions, data, x)
        for _ in range(MOST // ITERATIONS):
            before, x = x, igl.arap_solve(targets, data, x)
            if np.abs(x - before).max() <= STILL * diagonal:
                break
        return {"frame": x}

    if len(handles) == len(start):
        return lambda: {"frame": targets[np.argsort(handles)]}
    return call


if __name__ == "__main__":
    serve(f"libigl {version('libigl')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
