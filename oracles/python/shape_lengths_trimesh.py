"""shape.lengths_encode by trimesh: edges_unique and their lengths, face_adjacency and its angles, signed by face_adjacency_projections.

`seconds` is the work on the frames, for each of which trimesh builds its mesh and everything that follows from it, as its users do.

Signs. trimesh's angle is that between two normals, unsigned; it is convex where the corner of g that f has not lies below the plane of f: there the
contract's angle is positive. Where the two run along the edge in the same direction, the contract turns the normal of g over: pi minus trimesh's
angle.

Known differences and limits of trimesh:
- the angle is an arccosine: near 0 and near pi it is good to about 2e-8 only, elsewhere to rounding;
- face_adjacency leaves out edges with more than two triangles: unsupported;
- a triangle of less than about 1e-13 in area has no normal to it, whatever the unit: unsupported.
Components, degenerate triangles and centres are those of shape_mesh.py; parts are trimesh.graph.connected_components of face_adjacency; the rotation
of a component or a part is scipy.linalg.polar's.
"""

import numpy as np
import trimesh
from scipy.linalg import polar

from shape_mesh import Edges, Mesh, log_rotation, serve_version, solid_triangles
from wire import Unsupported, serve


def trihedron(x, triangle):
    """[e1 e2 n] with a unit normal: from triangle to triangle this maps plane to plane, and normal to normal."""
    a, b, c = x[triangle]
    normal = np.cross(b - a, c - a)
    return np.stack([b - a, c - a, normal / np.linalg.norm(normal)], axis=1)


class Encoder:
    def __init__(self, mesh):
        self.mesh, edges = mesh, Edges(mesh)
        if edges.count.max(initial=0) > 2:
            raise Unsupported("trimesh pairs the triangles of edges that have at most two")
        found = self.build(mesh.reference)
        unique = found.edges_unique if len(mesh.F) else np.empty((0, 2), int)
        self.order = np.lexsort(unique.T[::-1])
        self.unit = found.edges_unique_length.mean() if len(unique) else 1.0
        self.slot = np.searchsorted(edges.vertices @ [mesh.V, 1], found.face_adjacency_edges @ [mesh.V, 1]) if len(unique) else np.empty(0, int)
        alike = dict(zip(edges.pair_edge.tolist(), edges.alike.tolist()))
        self.alike = np.array([alike[slot] for slot in self.slot.tolist()], bool)
        self.rooted = np.flatnonzero(mesh.root >= 0)
        adjacent = found.face_adjacency if len(mesh.F) else np.empty((0, 2), int)
        parts = trimesh.graph.connected_components(adjacent[mesh.solid[adjacent].all(axis=1)], nodes=np.flatnonzero(mesh.solid), min_len=1)
        self.further = np.setdiff1d([min(part) for part in parts], mesh.root).astype(int)  # the lowest triangles of further parts
        self.inverse = {f: np.linalg.inv(trihedron(mesh.reference, mesh.F[f])) for f in [*mesh.root[self.rooted], *self.further]}
        self.d = 2 * len(self.order) + 6 * mesh.C + 3 * len(self.further)

    def build(self, x):
        return trimesh.Trimesh(x, self.mesh.F, process=False, validate=False)

    def numbers(self, found):
        """(E,2), or nothing at all of a mesh without triangles, which trimesh cannot ask."""
        if not len(self.mesh.F):
            return np.empty(0)
        flat = ~np.any(found.face_normals, axis=1)
        if np.any(flat & self.mesh.solid):
            raise Unsupported("to trimesh a triangle of a frame has no normal")
        angles = np.where(self.alike, np.pi - found.face_adjacency_angles, found.face_adjacency_angles)
        angles *= np.where(found.face_adjacency_projections > 0, -1.0, 1.0)
        z = np.zeros((len(self.order), 2))
        z[:, 0] = found.edges_unique_length[self.order] / self.unit
        z[self.slot, 1] = np.where(self.mesh.solid[found.face_adjacency].all(axis=1), angles, 0)
        return z.ravel()

    def encode(self, x):
        numbers, six = self.numbers(self.build(x)), np.zeros((self.mesh.C, 6))
        R = {f: polar(trihedron(x, self.mesh.F[f]) @ inverse)[0] for f, inverse in self.inverse.items()}
        root = self.mesh.root
        for c in self.rooted:
            six[c, :3] = log_rotation(R[root[c]])
        six[:, 3:] = self.mesh.centres(x) / self.mesh.diag
        home = self.mesh.component[self.mesh.F[self.further, 0]]
        three = [log_rotation(R[root[c]].T @ R[f]) for c, f in zip(home, self.further)]
        return np.concatenate([numbers, six.ravel(), *three])


def prepare(stage, inputs):
    if stage != "shape.lengths_encode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    frames, encoder = mesh.check_frames(inputs["frames"]), Encoder(mesh)
    for x in frames:
        solid_triangles(mesh, x)  # trimesh makes normals of rounding
    return lambda: {"z": np.array([encoder.encode(x) for x in frames]).reshape(-1, encoder.d)}


if __name__ == "__main__":
    serve(f"trimesh {trimesh.__version__}, {serve_version()}", prepare)
