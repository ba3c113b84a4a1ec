"""mesh.quality: MeshLab's geometric measures and its selection of self-intersecting faces (vcglib) through pymeshlab.

The area is summed in single precision (about 1e-7 of it). The volume is Mirtich's integral, the contract's on closed surfaces only, and is left out
on others. MeshLab selects faces, and does not count pairs: `intersecting_faces` alone. Its test of triangles (Moller's) is in floating point, with
thresholds of its own: triangles that merely touch may be taken either way.
"""

import platform
from importlib.metadata import version

import numpy as np
import pymeshlab

from wire import Unsupported, check_faces, serve


def is_closed(F):
    """Whether every directed edge has its opposite, once each."""
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    opposite = edges[:, ::-1]
    order = lambda e: e[np.lexsort(e.T)]
    return np.array_equal(order(edges), order(opposite)) and len(np.unique(edges, axis=0)) == len(edges)


def prepare(stage, inputs):
    if stage != "mesh.quality":
        raise Unsupported(f"no stage {stage} here")
    frames, F = inputs["frames"], inputs["F"]
    check_faces(F, frames.shape[1])
    e1, e2 = frames[:, F[:, 1]] - frames[:, F[:, 0]], frames[:, F[:, 2]] - frames[:, F[:, 0]]
    if not np.cross(e1, e2).any(axis=2).all():
        raise Unsupported("a triangle of no area")
    closed = is_closed(F)
    meshes = pymeshlab.MeshSet()
    for x in frames:
        meshes.add_mesh(pymeshlab.Mesh(x, F))

    def call():
        area, volume, faces = [], [], []
        for i in range(len(frames)):
            meshes.set_current_mesh(i)
            measures = meshes.get_geometric_measures()
            meshes.compute_selection_by_self_intersections_per_face()
            area.append(measures["surface_area"])
            volume.append(measures.get("mesh_volume", np.nan))
            faces.append(meshes.current_mesh().selected_face_number())
        answer = {"area": np.array(area), "intersecting_faces": np.array(faces)}
        return answer | ({"volume": np.array(volume)} if closed else {})

    return call


serve(f"pymeshlab {version('pymeshlab')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
