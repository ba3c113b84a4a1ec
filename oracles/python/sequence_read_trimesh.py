"""sequence.read: trimesh's OBJ reader, told to keep every vertex and its order (process=False, maintain_order=True).

Only the reading is timed: wire asks for the items of the answer once the clock has stopped, and they are measured then. trimesh gives the
surface area and its edges; the volume and the box are numpy's over its arrays (trimesh's own leave out unreferenced vertices and
integrate an open mesh by another formula). Where there are texture coordinates, normals or materials trimesh splits vertices: unsupported.
"""

import platform
import re
from pathlib import Path

import numpy as np
import trimesh

from wire import Unsupported, serve

SPLITTING = re.compile(rb"^(vt|vn|usemtl)\s", re.MULTILINE)


def counts(mesh):
    incidence = np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1]
    return len(mesh.vertices), len(mesh.faces), np.count_nonzero(incidence == 1)


def measures(mesh):
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    volume = np.vecdot(a, np.cross(b, c)).sum() / 6
    return mesh.area, volume, *mesh.vertices.min(axis=0), *mesh.vertices.max(axis=0)


class Reading:
    def __init__(self, meshes):
        self.meshes = meshes

    def items(self):
        yield "counts", np.array([counts(mesh) for mesh in self.meshes])
        yield "measures", np.array([measures(mesh) for mesh in self.meshes])


def prepare(stage, inputs):
    if stage != "sequence.read":
        raise Unsupported(f"no stage {stage} here")
    paths = inputs["paths"].splitlines()
    for path in paths:
        if SPLITTING.search(Path(path).read_bytes()):
            raise Unsupported(f"trimesh would split vertices by the texture coordinates, normals or materials of {path}")
    return lambda: Reading([trimesh.load_mesh(path, process=False, maintain_order=True) for path in paths])


serve(f"trimesh {trimesh.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
