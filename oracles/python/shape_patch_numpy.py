"""shape.patch_encode and shape.patch_decode by numpy: the deformation gradients of shape_gradient_numpy.py, their rotations relative to patches (after
Baran, Vlasic, Grinspun, Popovic 2009); decoding with the two linear systems of shape_lric_numpy.py and shape_mesh.py (SuperLU).

`seconds` is the work on the frames: the small system of the patches' rotations is factored within it, the Laplacian before.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from shape_gradient_numpy import polar_by_svd
from shape_gradient_scipy import edge_matrices, inverse_edges
from shape_lric_numpy import RotationSystem
from shape_mesh import Mesh, Poisson, exp_rotation, from_six, log_rotation, nearest_rotation, serve_version, to_six
from wire import Unsupported, serve


class Patches:
    def __init__(self, mesh, patches):
        if patches.shape != (len(mesh.F),) or patches.dtype.kind != "i":
            raise ValueError("patches is i64 (F)")
        if np.any((patches < 0) == mesh.solid) or np.any(patches < -1):
            raise ValueError("degenerate triangles, and no others, have patch -1")
        self.mesh, self.solid = mesh, np.flatnonzero(mesh.solid)
        self.of = patches[self.solid]
        self.P = int(patches.max(initial=-1)) + 1
        home = np.full((self.P, 2), [mesh.C, -1])
        component = mesh.component[mesh.F[self.solid, 0]]
        np.minimum.at(home[:, 0], self.of, component)
        np.maximum.at(home[:, 1], self.of, component)
        if np.any(home[:, 0] != home[:, 1]):
            raise ValueError("a patch is empty, or lies in several components")
        self.rooted, self.roots = np.unique(home[:, 0], return_index=True)  # the components that have patches; their lowest patches
        self.pairs = self.adjacent()
        graph = sparse.coo_matrix((np.ones(len(self.pairs)), self.pairs.T), (self.P, self.P))
        lowest = np.unique(connected_components(graph, directed=False)[1], return_index=True)[1]
        self.further = np.setdiff1d(lowest, self.roots)  # the lowest patches of the sets that adjacency joins, but those of components
        self.home = np.searchsorted(self.rooted, home[self.further, 0])  # their components, among those that have patches
        self.inverse = inverse_edges(mesh)
        self.gathering = sparse.csr_matrix((mesh.area[self.solid], (self.of, np.arange(len(self.of)))), (self.P, len(self.of)))
        self.triangles, self.adjacency = 9 * len(mesh.F), 3 * len(self.pairs)
        self.sections = np.cumsum([self.triangles, self.adjacency, 6 * mesh.C])
        self.d = self.sections[-1] + 3 * len(self.further)

    def adjacent(self):
        F, V = self.mesh.F[self.solid], self.mesh.V
        start, end = F.ravel(), np.roll(F, -1, axis=1).ravel()
        edge = np.unique(np.minimum(start, end) * V + np.maximum(start, end), return_inverse=True)[1]
        meets = sparse.coo_matrix((np.ones(len(edge)), (edge, np.repeat(self.of, 3))), (edge.max(initial=-1) + 1, self.P)).tocsr()
        p, q = (meets.T @ meets).nonzero()
        return np.unique(np.column_stack([p, q])[p < q], axis=0)

    def encode(self, x):
        mesh, z = self.mesh, np.zeros(self.d)
        triangles, between, six, three = self.split(z)
        R, S = polar_by_svd(edge_matrices(x, mesh.F[self.solid]) @ self.inverse)
        of_patch = nearest_rotation((self.gathering @ R.reshape(-1, 9)).reshape(-1, 3, 3))
        back = of_patch.transpose(0, 2, 1)
        triangles[:, 3:6] = 1
        triangles[self.solid] = np.concatenate([log_rotation(back[self.of] @ R), to_six(S)], axis=1)
        p, q = self.pairs.T
        between[:] = log_rotation(back[p] @ of_patch[q])
        six[self.rooted, :3] = log_rotation(of_patch[self.roots])
        six[:, 3:] = mesh.centres(x) / mesh.diag
        three[:] = log_rotation(back[self.roots[self.home]] @ of_patch[self.further])
        return z

    def split(self, z):
        """Views of z: the numbers of triangles (F,9), of adjacent pairs (A,3), of components (C,6) and of further sets of patches (.,3)."""
        return [part.reshape(-1, width) for part, width in zip(np.split(z, self.sections), (9, 3, 6, 3))]

    def decoder(self):
        mesh, (p, q) = self.mesh, self.pairs.T
        given = np.concatenate([self.roots, self.further])
        poisson, rotations = Poisson(mesh).factor(), RotationSystem(self.P, p, q, given, np.arange(self.P))

        def decode(z):
            triangles, between, six, three = self.split(z)
            R = exp_rotation(six[self.rooted, :3])
            R = np.concatenate([R, R[self.home] @ exp_rotation(three)])
            of_patch = rotations.solve(exp_rotation(between), R)
            T = np.zeros((len(mesh.F), 3, 3))
            triangles = triangles[self.solid]
            T[self.solid] = of_patch[self.of] @ exp_rotation(triangles[:, :3]) @ from_six(triangles[:, 3:])
            return mesh.place(poisson.solve(T), six[:, 3:] * mesh.diag)

        return decode


def prepare(stage, inputs):
    if stage not in ("shape.patch_encode", "shape.patch_decode"):
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    patches = Patches(mesh, inputs["patches"])
    if stage.endswith("encode"):
        frames = mesh.check_frames(inputs["frames"])
        return lambda: {"z": np.array([patches.encode(x) for x in frames]).reshape(-1, patches.d)}
    z, decode = mesh.check_z(inputs["z"], patches.d), patches.decoder()
    return lambda: {"frames": np.array([decode(row) for row in z]).reshape(-1, mesh.V, 3)}


if __name__ == "__main__":
    serve(serve_version(), prepare)
