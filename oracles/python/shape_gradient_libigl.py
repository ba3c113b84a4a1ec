"""shape.gradient_encode and shape.gradient_decode by libigl: fit_rotations (a batch of polar_svd3x3) for the rotations; grad, cotmatrix, doublearea
and min_quad_with_fixed (Eigen's SimplicialLDLT) for the Poisson equation, the lowest vertex of each component held.

`seconds` is the work on the frames. What depends on the reference alone (D0^-1, the operators, the factorisation) is made before.
libigl has no logarithm of a rotation, that is scipy's; it has no notion of a degenerate triangle, so it is given the others only.
"""

import platform
from importlib.metadata import version

import igl
import numpy as np
from scipy import sparse

from shape_gradient_scipy import encoder
from shape_mesh import Mesh, exp_rotation, from_six
from wire import Unsupported, serve


def fit(T):
    # the stack is row i of every matrix, then row i+1; the answer is the transposed rotations side by side
    R = igl.fit_rotations(np.ascontiguousarray(T.transpose(1, 0, 2).reshape(-1, 3)), False).reshape(3, -1, 3).transpose(1, 2, 0)
    S = R.transpose(0, 2, 1) @ T
    return R, (S + S.transpose(0, 2, 1)) / 2


def decoder(mesh, z):
    faces, size = np.ascontiguousarray(mesh.F[mesh.solid]), 9 * len(mesh.F)
    mesh.check_z(z, size + 3 * mesh.C)
    free = len(faces) > 0
    if free:
        vertices = np.ascontiguousarray(mesh.reference)
        gradient = igl.grad(vertices, faces)  # rows: d/dx of every triangle, d/dy, d/dz
        areas = np.tile(igl.doublearea(vertices, faces) / 2, 3)
        divergence = (gradient.T.multiply(areas)).tocsr()
        system = igl.min_quad_with_fixed_data()
        no_constraints = sparse.csc_matrix((0, mesh.V))
        igl.min_quad_with_fixed_precompute(-igl.cotmatrix(vertices, faces), mesh.lowest, no_constraints, True, system)
    held, nothing = np.zeros((mesh.C, 3)), np.zeros((0, 3))

    def call():
        frames = np.zeros((len(z), mesh.V, 3))
        for row, frame in zip(z, frames):
            triangles = row[:size].reshape(-1, 9)[mesh.solid]
            if free:
                T = exp_rotation(triangles[:, :3]) @ from_six(triangles[:, 3:])
                right = divergence @ T.transpose(2, 0, 1).reshape(-1, 3)
                frame[:] = igl.min_quad_with_fixed_solve(system, -right, held, nothing)
            frame[:] = mesh.place(frame, row[size:].reshape(-1, 3) * mesh.diag)
        return {"frames": frames}

    return call


def prepare(stage, inputs):
    if stage not in ("shape.gradient_encode", "shape.gradient_decode"):
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    if stage.endswith("decode"):
        return decoder(mesh, inputs["z"])
    return encoder(mesh, mesh.check_frames(inputs["frames"]), fit)


if __name__ == "__main__":
    serve(f"libigl {version('libigl')}, numpy {np.__version__}, Python {platform.python_version()}", prepare)
