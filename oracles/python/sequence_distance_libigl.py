"""sequence.distance: libigl's point_mesh_squared_distance (an axis-aligned bounding box tree, built anew for every frame)."""

import platform
from importlib.metadata import version

import igl
import numpy as np

from wire import Unsupported, check_faces, serve


def prepare(stage, inputs):
    if stage != "sequence.distance":
        raise Unsupported(f"no stage {stage} here")
    A, B, F = inputs["A"], inputs["B"], inputs["F"]
    check_faces(F, B.shape[1])

    def call():
        distances = np.sqrt([igl.point_mesh_squared_distance(a, b, F)[0] for a, b in zip(A, B)])
        return {"hausdorff": distances.max(axis=1), "mean": distances.mean(axis=1)}

    return call


serve(f"libigl {version('libigl')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
