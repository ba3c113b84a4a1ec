"""sequence.distance: MeshLab's get_hausdorff_distance (vcglib, closest points by a uniform grid) through pymeshlab. Its samples are all the
vertices of A, none drawn at random, and its search radius covers both meshes, so that it drops no sample.
"""

import platform
from importlib.metadata import version

import numpy as np
import pymeshlab

from wire import Unsupported, check_faces, serve


def pair(A, B, F):
    meshes = pymeshlab.MeshSet()
    for positions in (A, B):
        meshes.add_mesh(pymeshlab.Mesh(positions, F))
    return meshes


def prepare(stage, inputs):
    if stage != "sequence.distance":
        raise Unsupported(f"no stage {stage} here")
    A, B, F = inputs["A"], inputs["B"], inputs["F"]
    check_faces(F, B.shape[1])
    pairs = [pair(a, b, F) for a, b in zip(A, B)]
    boxes = np.ptp(np.concatenate([A, B], axis=1), axis=1)
    radii = [pymeshlab.PureValue(2 * np.linalg.norm(box) or 1.0) for box in boxes]
    samples = A.shape[1]

    def call():
        found = [
            meshes.get_hausdorff_distance(
                sampledmesh=0,
                targetmesh=1,
                savesample=False,
                samplevert=True,
                sampleedge=False,
                samplefauxedge=False,
                sampleface=False,
                samplenum=samples,
                maxdist=radius,
            )
            for meshes, radius in zip(pairs, radii)
        ]
        if any(frame["n_samples"] != samples for frame in found):
            raise RuntimeError("MeshLab dropped samples")
        return {
            "hausdorff": np.array([frame["max"] for frame in found]),
            "mean": np.array([frame["mean"] for frame in found]),
        }

    return call


serve(f"pymeshlab {version('pymeshlab')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
