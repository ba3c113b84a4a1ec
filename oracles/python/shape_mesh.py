"""What the shape-space oracles of this folder have in common: the vocabulary of section "The stages of shape spaces" of PROTOCOL.md (degenerate
triangles, components, edges, pairs, parts), the six numbers of symmetric matrices, and the Poisson equation. No oracle by itself.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

from wire import Unsupported, check_faces

RT2 = np.sqrt(2)


def corners_to_edges(x, F):
    """e1, e2 and e1 x e2 of every triangle; x is (..., V, 3)."""
    a = x[..., F[:, 0], :]
    e1, e2 = x[..., F[:, 1], :] - a, x[..., F[:, 2], :] - a
    return e1, e2, np.cross(e1, e2)


def norms(v):
    return np.sqrt(np.einsum("...i,...i", v, v))


def is_degenerate(e1, e2, normal):
    """In the reference."""
    return norms(normal) <= 1e-5 * np.maximum(np.maximum(norms(e1), norms(e2)), norms(e2 - e1)) ** 2


def has_collapsed(e1, e2, normal):
    """To a line, in a frame: what is left of the normal is rounding."""
    return norms(normal) <= 1e-14 * norms(e1) * norms(e2)


def unit(v):
    return v / norms(v)[..., None]


class Mesh:
    def __init__(self, reference, F):
        if reference.ndim != 2 or reference.shape[1] != 3:
            raise ValueError("reference is (V,3)")
        check_faces(F, len(reference))
        if not np.isfinite(reference).all():
            raise ValueError("the reference is not finite")
        self.reference, self.F, self.V = reference, F, len(reference)
        self.diag = np.linalg.norm(np.ptp(reference, axis=0)) if self.V else 0.0
        if self.diag == 0:
            raise ValueError("the reference has no extent")
        self.e1, self.e2, self.normal = corners_to_edges(reference, F)
        self.solid = ~is_degenerate(self.e1, self.e2, self.normal)  # its complement is "degenerate"
        self.area = norms(self.normal) / 2

        kept = F[self.solid]
        graph = sparse.coo_matrix((np.ones(2 * len(kept)), (kept[:, [0, 0]].ravel(), kept[:, [1, 2]].ravel())), (self.V, self.V))
        self.C, label = connected_components(graph, directed=False)
        lowest = np.unique(label, return_index=True)[1]
        self.component = np.argsort(np.argsort(lowest))[label]
        self.lowest = np.sort(lowest)
        size = np.bincount(self.component)
        self.averaging = sparse.csr_matrix((1 / size[self.component], (self.component, np.arange(self.V))), (self.C, self.V))
        self.root = np.full(self.C, -1)  # the lowest triangle that is not degenerate, of each component
        solid = np.flatnonzero(self.solid)
        self.root[self.component[F[solid[::-1], 0]]] = solid[::-1]

    def check_frames(self, frames):
        if frames.ndim != 3 or frames.shape[1:] != (self.V, 3) or not np.isfinite(frames).all():
            raise ValueError("frames are (n,V,3) and finite")
        return frames

    def check_z(self, z, d):
        if z.ndim != 2 or z.shape[1] != d or not np.isfinite(z).all():
            raise ValueError(f"z is (n,{d}) and finite")
        return z

    def centres(self, x):
        return self.averaging @ x

    def place(self, x, centres):
        """Moves every component of x to its centre."""
        return x + (centres - self.centres(x))[self.component]


class Edges:
    """The edges of a mesh, their pairs, and the further parts. Half-edges are numbered 3 f + corner: (a,b), (b,c), (c,a)."""

    def __init__(self, mesh):
        F = mesh.F
        if np.any(F == np.roll(F, -1, axis=1)):
            raise Unsupported("a triangle names a vertex twice: its half-edges are not defined")
        self.start, self.end = F.ravel(), np.roll(F, -1, axis=1).ravel()
        keys = np.minimum(self.start, self.end) * mesh.V + np.maximum(self.start, self.end)
        unique, self.edge, self.count = np.unique(keys, return_inverse=True, return_counts=True)
        self.vertices = np.column_stack([unique // mesh.V, unique % mesh.V])
        order = np.argsort(keys, kind="stable")
        begin = np.cumsum(self.count) - self.count
        self.rank = np.empty(len(keys), int)  # of a half-edge among those of its edge
        self.rank[order] = np.arange(len(keys)) - begin[self.edge[order]]

        # The pairs of an edge start from its lowest triangle that is not degenerate, or from its lowest where all are.
        head = np.lexsort((np.arange(len(keys)), np.repeat(~mesh.solid, 3), keys))[begin]
        g = order[order != head[self.edge[order]]]  # by edge, then by triangle
        self.pair_edge = self.edge[g]
        f = head[self.pair_edge]
        pairs = self.count - 1
        self.pair_rank = np.arange(len(g)) - (np.cumsum(pairs) - pairs)[self.pair_edge]
        self.half_f, self.half_g, self.f, self.g = f, g, f // 3, g // 3
        self.pair_start, self.pair_end = self.start[f], self.end[f]
        self.alike = self.start[f] == self.start[g]  # both run along the edge in the same direction
        self.solid = mesh.solid[self.f] & mesh.solid[self.g]  # else the pair's dihedral angle is 0, and decoding ignores it
        self.further = self.further_parts(mesh)

    def further_parts(self, mesh):
        """Their lowest triangles, ascending. Rotations pass from triangle to triangle over pairs, and reach no further than a part."""
        f, g = self.f[self.solid], self.g[self.solid]
        graph = sparse.coo_matrix((np.ones(len(f)), (f, g)), (len(mesh.F), len(mesh.F)))
        part, solid = connected_components(graph, directed=False)[1], np.flatnonzero(mesh.solid)
        return np.setdiff1d(solid[np.unique(part[solid], return_index=True)[1]], mesh.root)

    def dihedral_angles(self, mesh, x):
        normals = np.zeros((len(mesh.F), 3))
        normals[mesh.solid] = unit(solid_triangles(mesh, x)[2])
        n_f, n_g = normals[self.f], normals[self.g] * np.where(self.alike, -1.0, 1.0)[:, None]
        t = x[self.pair_end] - x[self.pair_start]
        length = norms(t)
        sine = np.einsum("ij,ij->i", np.cross(n_f, n_g), t) / np.where(length > 0, length, 1)
        return np.where(self.solid, np.arctan2(sine, np.einsum("ij,ij->i", n_f, n_g)), 0.0)


def solid_triangles(mesh, x):
    """corners_to_edges of the triangles that are not degenerate in the reference. PROTOCOL.md has a normal for those that collapse in x; here there is
    none."""
    e1, e2, normal = corners_to_edges(x, mesh.F[mesh.solid])
    if np.any(has_collapsed(e1, e2, normal)):
        raise Unsupported("a frame collapses a triangle to a line: it has no normal here")
    return e1, e2, normal


def axes(e1, normal):
    """Columns: along e1, second = normal x first, normal."""
    u, n = unit(e1), unit(normal)
    return np.stack([u, np.cross(n, u), n], axis=-1)


def to_six(S):
    return np.stack([S[..., 0, 0], S[..., 1, 1], S[..., 2, 2], RT2 * S[..., 1, 2], RT2 * S[..., 0, 2], RT2 * S[..., 0, 1]], axis=-1)


def from_six(s):
    yz, xz, xy = s[..., 3] / RT2, s[..., 4] / RT2, s[..., 5] / RT2
    return np.stack([s[..., 0], xy, xz, xy, s[..., 1], yz, xz, yz, s[..., 2]], axis=-1).reshape(*s.shape[:-1], 3, 3)


def log_rotation(R):
    return Rotation.from_matrix(R.reshape(-1, 3, 3), assume_valid=True).as_rotvec().reshape(R.shape[:-1])


def exp_rotation(r):
    return Rotation.from_rotvec(r.reshape(-1, 3)).as_matrix().reshape(*r.shape, 3)


def nearest_rotation(M):
    U, _, Vt = np.linalg.svd(M)
    U[..., 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    return U @ Vt


class Poisson:
    """min over x of sum_f A_f |grad x - T_f|^2 over the triangles that are not degenerate: cotangent Laplacian, the lowest vertex of each
    component held, SuperLU in its symmetric mode."""

    def __init__(self, mesh):
        self.mesh = mesh
        solid = np.flatnonzero(mesh.solid)
        e1, e2, n = mesh.e1[solid], mesh.e2[solid], mesh.normal[solid]
        n2 = np.square(n).sum(axis=1, keepdims=True)
        g1, g2 = np.cross(e2, n) / n2, np.cross(n, e1) / n2  # gradients of the hat functions of b and c
        rows = (3 * solid[:, None] + np.arange(3))[:, None] + np.zeros((3, 1), int)
        cols = mesh.F[solid][:, :, None] + np.zeros(3, int)
        gradients = np.stack([-g1 - g2, g1, g2], axis=1)
        gradient = sparse.csr_matrix((gradients.ravel(), (rows.ravel(), cols.ravel())), (3 * len(mesh.F), mesh.V))
        self.divergence = (gradient.T @ sparse.diags(np.repeat(mesh.area, 3))).tocsr()
        self.laplacian = (self.divergence @ gradient).tocsc()
        self.free = np.setdiff1d(np.arange(mesh.V), mesh.lowest)
        self.grounded = self.laplacian[self.free][:, self.free].tocsc()

    def factor(self):
        self.solver = spd_factor(self.grounded) if len(self.free) else None
        return self

    def solve(self, T):
        """x, not yet placed, for T (F,3,3); only T restricted to the planes of the triangles matters."""
        x = np.zeros((self.mesh.V, 3))
        if len(self.free):
            right = self.divergence @ T.transpose(0, 2, 1).reshape(-1, 3)
            x[self.free] = self.solver.solve(right[self.free])
        return x


def spd_factor(A, ordering="MMD_AT_PLUS_A"):
    return splu(A, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def serve_version():
    import platform

    import scipy

    return f"numpy {np.__version__}, scipy {scipy.__version__}, Python {platform.python_version()}"
