"""shape.lengths_encode by libigl: edge_flaps for the edges and their two triangles, edge_lengths, per_face_normals, facet_components for the parts,
and polar_svd for the rotations of components and parts.

`seconds` is the work on the frames: edges and flaps depend on the faces alone and are found before.

libigl's bindings have no dihedral angle of a surface: it is atan2 of numpy on libigl's normals. edge_flaps numbers the flaps by the direction in
which they run along the edge, and the angle is the same from either flap, so nothing is left to reconcile where both run in opposite directions.
It has room for one triangle an edge and direction: where there are more, it forgets one (which is_edge_manifold does not notice), so they are
unsupported. Components, degenerate triangles and centres are those of shape_mesh.py.
"""

import platform
from importlib.metadata import version

import igl
import numpy as np

from shape_mesh import Mesh, log_rotation, solid_triangles
from wire import Unsupported, serve


class Encoder:
    def __init__(self, mesh):
        self.mesh, self.F = mesh, np.ascontiguousarray(mesh.F)
        if len(self.F) and np.any(self.F == np.roll(self.F, -1, axis=1)):
            raise Unsupported("a triangle names a vertex twice: its edges are not defined")
        if not len(self.F) or len(np.unique(igl.oriented_facets(self.F), axis=0)) < 3 * len(self.F):
            raise Unsupported("libigl's edge_flaps needs a triangle, and no two that run along an edge in the same direction")
        edges, _, flaps, corners = igl.edge_flaps(self.F)
        order = np.lexsort(np.sort(edges, axis=1).T[::-1])
        self.edges, flaps, corners = np.ascontiguousarray(edges[order]), flaps[order], corners[order]
        self.paired = np.flatnonzero((flaps >= 0).all(axis=1))
        self.paired = self.paired[mesh.solid[flaps[self.paired]].all(axis=1)]
        self.f, self.g = flaps[self.paired].T
        corner = corners[self.paired, 0]
        self.start, self.end = self.F[self.f, (corner + 1) % 3], self.F[self.f, (corner + 2) % 3]
        self.unit = self.lengths(mesh.reference).mean()
        self.rooted, self.further = np.flatnonzero(mesh.root >= 0), self.further_parts()
        self.home = np.searchsorted(self.rooted, mesh.component[self.F[self.further, 0]])  # among the components that have triangles
        self.roots = self.F[np.concatenate([mesh.root[self.rooted], self.further])]
        self.d = 2 * len(self.edges) + 6 * mesh.C + 3 * len(self.further)
        self.inverse = np.linalg.inv(self.trihedra(mesh.reference))

    def further_parts(self):
        """Their lowest triangles, ascending."""
        solid = np.flatnonzero(self.mesh.solid)
        if not len(solid):
            return solid
        part = igl.facet_components(np.ascontiguousarray(self.F[solid]))[1]
        return np.setdiff1d(solid[np.unique(part, return_index=True)[1]], self.mesh.root)

    def lengths(self, x):
        return igl.edge_lengths(x, self.edges).ravel()

    def trihedra(self, x):
        """[e1 e2 n] of the roots, n of unit length: from triangle to triangle this maps plane to plane, and normal to normal."""
        a, b, c = (x[self.roots[:, i]] for i in range(3))
        return np.stack([b - a, c - a, igl.per_face_normals(x, self.roots, np.zeros(3))], axis=2)

    def angles(self, x):
        normals = igl.per_face_normals(x, self.F, np.zeros(3))
        n_f, n_g, t = normals[self.f], normals[self.g], x[self.end] - x[self.start]
        sine = np.vecdot(np.cross(n_f, n_g), t) / np.linalg.norm(t, axis=1)
        return np.arctan2(sine, np.vecdot(n_f, n_g))

    def encode(self, x):
        z = np.zeros((len(self.edges), 2))
        z[:, 0] = self.lengths(x) / self.unit
        z[self.paired, 1] = self.angles(x)
        six = np.zeros((self.mesh.C, 6))
        maps = self.trihedra(x) @ self.inverse
        R = np.array([igl.polar_svd(m)[0] for m in maps]).reshape(-1, 3, 3)
        six[self.rooted, :3] = log_rotation(R[: len(self.rooted)])
        six[:, 3:] = self.mesh.centres(x) / self.mesh.diag
        three = log_rotation(R[self.home].transpose(0, 2, 1) @ R[len(self.rooted) :])
        return np.concatenate([z.ravel(), six.ravel(), three.ravel()])


def prepare(stage, inputs):
    if stage != "shape.lengths_encode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    frames, encoder = mesh.check_frames(inputs["frames"]), Encoder(mesh)
    for x in frames:
        solid_triangles(mesh, x)  # libigl makes normals of rounding
    return lambda: {"z": np.array([encoder.encode(x) for x in frames]).reshape(-1, encoder.d)}


if __name__ == "__main__":
    serve(f"libigl {version('libigl')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
