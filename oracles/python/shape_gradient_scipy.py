"""shape.gradient_encode and shape.gradient_decode by SciPy: scipy.linalg.polar for each triangle; decoding by SuperLU (scipy.sparse.linalg.splu).

`seconds` is the work on the frames. What depends on the reference alone, the inverses D0^-1 and the factored Laplacian, is made before.
polar gives the nearest orthogonal matrix: of a singular T (a triangle that a frame collapses) it may be a reflection, and then is refused.
It takes matrices one by one, at 0.1 to 0.2 ms each: more than MOST of them are refused too.
"""

import numpy as np
from scipy.linalg import polar

from shape_mesh import Mesh, Poisson, corners_to_edges, exp_rotation, from_six, log_rotation, norms, serve_version, to_six
from wire import Unsupported, serve


MOST = 200_000


def edge_matrices(x, F):
    """D = [e1 e2 (e1 x e2)/sqrt|e1 x e2|]; the last column of a collapsed triangle is 0, its limit."""
    e1, e2, normal = corners_to_edges(x, F)
    size = norms(normal)[..., None]
    return np.stack([e1, e2, normal / np.sqrt(np.where(size > 0, size, 1))], axis=-1)


def inverse_edges(mesh):
    return np.linalg.inv(edge_matrices(mesh.reference, mesh.F[mesh.solid]))


def polar_each(T):
    R, S = np.empty_like(T), np.empty_like(T)
    for f in range(len(T)):
        R[f], S[f] = polar(T[f])
    if np.any(np.linalg.det(R) < 0):
        raise Unsupported("scipy.linalg.polar makes a reflection of a collapsed triangle")
    return R, S


def encoder(mesh, frames, decompose):
    inverse, faces = inverse_edges(mesh), mesh.F[mesh.solid]
    identity = np.zeros((len(mesh.F), 9))
    identity[:, 3:6] = 1

    def call():
        z = np.empty((len(frames), 9 * len(mesh.F) + 3 * mesh.C))
        for frame, row in zip(frames, z):
            R, S = decompose(edge_matrices(frame, faces) @ inverse)
            triangles = identity.copy()
            triangles[mesh.solid] = np.concatenate([log_rotation(R), to_six(S)], axis=1)
            row[: triangles.size] = triangles.ravel()
            row[triangles.size :] = (mesh.centres(frame) / mesh.diag).ravel()
        return {"z": z}

    return call


def decoder(mesh, z):
    poisson, size = Poisson(mesh).factor(), 9 * len(mesh.F)
    mesh.check_z(z, size + 3 * mesh.C)

    def call():
        frames = np.empty((len(z), mesh.V, 3))
        for row, frame in zip(z, frames):
            triangles = row[:size].reshape(-1, 9)
            T = exp_rotation(triangles[:, :3]) @ from_six(triangles[:, 3:])
            frame[:] = mesh.place(poisson.solve(T), row[size:].reshape(-1, 3) * mesh.diag)
        return {"frames": frames}

    return call


def prepare(stage, inputs):
    if stage not in ("shape.gradient_encode", "shape.gradient_decode"):
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    if stage.endswith("decode"):
        return decoder(mesh, inputs["z"])
    frames = mesh.check_frames(inputs["frames"])
    if len(frames) * len(mesh.F) > MOST:
        raise Unsupported(f"scipy.linalg.polar takes one triangle at a time: no more than {MOST} here")
    return encoder(mesh, frames, polar_each)


if __name__ == "__main__":
    serve(serve_version(), prepare)
