"""shape.lengths_encode by numpy: edge lengths over the reference's mean, signed dihedral angles by atan2, and the numbers of components and
further parts as in shape_lric_numpy.py, whose triangle frames (closed 2x2 polar rotations) it uses. `seconds` is the work on the frames.
"""

import numpy as np

from shape_lric_numpy import Lric
from shape_mesh import Mesh, norms, serve_version
from wire import Unsupported, serve


class Lengths:
    def __init__(self, mesh):
        self.mesh, self.lric = mesh, Lric(mesh)
        edges = self.edges = self.lric.edges
        width = np.maximum(2, edges.count)
        self.length_slot = np.cumsum(width) - width
        self.pair_slot = self.length_slot[edges.pair_edge] + 1 + edges.pair_rank
        self.size = width.sum()
        self.d = self.size + 6 * mesh.C + 3 * len(edges.further)
        self.unit = self.lengths(mesh.reference).mean() if len(edges.vertices) else 1.0

    def lengths(self, x):
        i, j = self.edges.vertices.T
        return norms(x[j] - x[i])

    def assemble(self, x, lengths, angles):
        """z from the frame's edge lengths and the dihedral angles of the pairs."""
        z = np.zeros(self.d)
        z[self.length_slot] = lengths / self.unit
        z[self.pair_slot] = angles
        z[self.size :] = self.lric.placement(x, self.lric.triangle_frames(x)[1])
        return z

    def encode(self, x):
        return self.assemble(x, self.lengths(x), self.edges.dihedral_angles(self.mesh, x))


def prepare_encoding(stage, inputs, make):
    if stage != "shape.lengths_encode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    lengths, frames = Lengths(mesh), mesh.check_frames(inputs["frames"])
    encode = make(lengths)
    return lambda: {"z": np.array([encode(x) for x in frames]).reshape(-1, lengths.d)}


def prepare(stage, inputs):
    return prepare_encoding(stage, inputs, lambda lengths: lengths.encode)


if __name__ == "__main__":
    serve(serve_version(), prepare)
