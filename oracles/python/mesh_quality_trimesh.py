"""mesh.quality: area and volume by trimesh. Intersections it has not got (its collision manager knows no mesh against itself).

trimesh integrates the volume by another formula than the contract's, which is the same on closed surfaces only: on others it is left out.
"""

import platform

import numpy as np
import trimesh

from wire import Unsupported, check_faces, serve


def prepare(stage, inputs):
    if stage != "mesh.quality":
        raise Unsupported(f"no stage {stage} here")
    frames, F = inputs["frames"], inputs["F"]
    check_faces(F, frames.shape[1])
    # What a mesh has computed it keeps: new meshes at every call, made of views.
    closed = trimesh.Trimesh(frames[0], F, process=False).is_watertight

    def call():
        meshes = [trimesh.Trimesh(x, F, process=False) for x in frames]
        answer = {"area": np.array([mesh.area for mesh in meshes])}
        if closed:
            answer["volume"] = np.array([mesh.volume for mesh in meshes])
        return answer

    return call


serve(f"trimesh {trimesh.__version__}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
