"""shape.gradient_encode by numpy, two vectorised engines: batched LAPACK SVDs of T, or with the argument `planar` no SVD at all: T maps the
plane of a triangle to a plane and normal to normal, so S is a 2x2 stretch, whose polar rotation has a closed form, and a scale of the normal.

`seconds` is the work on the frames. `planar` refuses frames that collapse a triangle; the SVD takes one of the rotations that fit.
"""

import sys

import numpy as np

from shape_gradient_scipy import encoder
from shape_mesh import RT2, Mesh, axes, nearest_rotation, norms, serve_version, solid_triangles, to_six
from wire import Unsupported, serve


def polar_by_svd(T):
    R = nearest_rotation(T)
    S = R.transpose(0, 2, 1) @ T
    return R, (S + S.transpose(0, 2, 1)) / 2


def triangular(e1, e2, B):
    """The edges in the frame B of their triangle: columns (a, 0), (b, d)."""
    return norms(e1), np.einsum("fi,fi->f", e2, B[:, :, 0]), np.einsum("fi,fi->f", e2, B[:, :, 1])


def log_of_columns(columns):
    """Rotation vectors (N,3) of rotations given by their columns, each (N,3): the largest row of the outer product of the quaternion."""
    (xx, yx, zx), (xy, yy, zy), (xz, yz, zz) = (c.T for c in columns)
    a, b, c = zy - yz, xz - zx, yx - xy
    d, e, f = xy + yx, xz + zx, yz + zy
    outer = np.stack([1 + xx + yy + zz, a, b, c, a, 1 + xx - yy - zz, d, e, b, d, 1 - xx + yy - zz, f, c, e, f, 1 - xx - yy + zz])
    outer = outer.reshape(4, 4, -1)
    q = outer[outer.diagonal().argmax(axis=1), :, np.arange(outer.shape[2])]
    q *= np.where(q[:, :1] < 0, -1.0, 1.0)
    sine = norms(q[:, 1:])
    return q[:, 1:] * (2 * np.arctan2(sine, q[:, 0]) / np.where(sine > 0, sine, 1))[:, None]


def planar_encoder(mesh, frames):
    e1, e2, normal0 = mesh.e1[mesh.solid], mesh.e2[mesh.solid], mesh.normal[mesh.solid]
    B0 = axes(e1, normal0)
    a0, b0, d0 = triangular(e1, e2, B0)
    area0 = norms(normal0)
    u, v, n = np.moveaxis(B0, 2, 0)
    products = [to_six(p[:, :, None] * q[:, None]) for p, q in ((u, u), (v, v), (n, n))]
    mixed = to_six(u[:, :, None] * v[:, None] + v[:, :, None] * u[:, None])
    identity = np.zeros((len(mesh.F), 9))
    identity[:, 3:6] = 1

    def call():
        z = np.empty((len(frames), 9 * len(mesh.F) + 3 * mesh.C))
        for frame, row in zip(frames, z):
            e1, e2, normal = solid_triangles(mesh, frame)
            B = axes(e1, normal)
            a, b, d = triangular(e1, e2, B)
            p, q, r = a / a0, (b - a / a0 * b0) / d0, d / d0  # the map [[p, q], [0, r]] of the plane
            size = np.hypot(p + r, q)
            c, s = (p + r) / size, -q / size  # its polar rotation
            U = np.stack([c * p, c * r - s * q, np.sqrt(norms(normal) / area0)], axis=1)
            six = sum(U[:, i, None] * products[i] for i in range(3)) + (c * q + s * r)[:, None] * mixed
            bu, bv, bn = np.moveaxis(B, 2, 0)
            bu, bv = c[:, None] * bu + s[:, None] * bv, c[:, None] * bv - s[:, None] * bu
            columns = [bu * u[:, i, None] + bv * v[:, i, None] + bn * n[:, i, None] for i in range(3)]
            triangles = identity.copy()
            triangles[mesh.solid] = np.concatenate([log_of_columns(columns), six], axis=1)
            row[: triangles.size] = triangles.ravel()
            row[triangles.size :] = (mesh.centres(frame) / mesh.diag).ravel()
        return {"z": z}

    return call


def prepare(stage, inputs):
    if stage != "shape.gradient_encode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    frames = mesh.check_frames(inputs["frames"])
    return planar_encoder(mesh, frames) if sys.argv[1:] == ["planar"] else encoder(mesh, frames, polar_by_svd)


if __name__ == "__main__":
    serve(serve_version(), prepare)
