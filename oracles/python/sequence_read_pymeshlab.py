"""sequence.read: MeshLab's OBJ reader (vcglib) through pymeshlab, which keeps every vertex and its order but leaves out faces that name a
vertex twice.

Only the reading is timed: wire asks for the items of the answer once the clock has stopped, and they are measured then. MeshLab gives the
counts and the box; area and volume are numpy's over its arrays (MeshLab's area is single precision, and an open mesh has no volume there).
"""

import platform
from importlib.metadata import version

import numpy as np
import pymeshlab

from wire import Unsupported, serve


def measures(mesh):
    a, b, c = np.moveaxis(mesh.vertex_matrix()[mesh.face_matrix()], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    volume = np.vecdot(a, np.cross(b, c)).sum() / 6
    box = mesh.bounding_box()
    return area, volume, *box.min(), *box.max()


def counts(meshes):
    topology = meshes.get_topological_measures()
    return topology["vertices_number"], topology["faces_number"], topology["boundary_edges"]


class Reading:
    def __init__(self, meshes):
        self.meshes = meshes

    def items(self):
        rows = []
        for frame in range(self.meshes.mesh_number()):
            self.meshes.set_current_mesh(frame)
            rows.append((counts(self.meshes), measures(self.meshes.current_mesh())))
        for name, column in zip(("counts", "measures"), zip(*rows)):
            yield name, np.array(column)


def prepare(stage, inputs):
    if stage != "sequence.read":
        raise Unsupported(f"no stage {stage} here")
    paths = inputs["paths"].splitlines()

    def call():
        meshes = pymeshlab.MeshSet()
        for path in paths:
            meshes.load_new_mesh(path)
        return Reading(meshes)

    return call


serve(f"pymeshlab {version('pymeshlab')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
