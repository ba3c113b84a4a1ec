"""shape.lengths_decode with scipy.sparse: Gauss-Newton with Levenberg's damping on the lengths and dihedral angles, analytic Jacobian, normal equations by
SuperLU. It starts from the linear reconstruction of shape_lric_numpy.py with the stretches that the lengths give: where z is that of a frame, it starts at
the answer.

`seconds` is everything that depends on z. The damping never moves the minimum, and settles the motions that z leaves free, which the six numbers fix.
"""

import numpy as np
from scipy import sparse

from shape_lengths_numpy import Lengths
from shape_mesh import Mesh, exp_rotation, norms, serve_version, solid_triangles, spd_factor
from wire import Unsupported, serve

STEPS = 200
GRADIENT = 1e-9  # a vanishing gradient, in mean edge lengths and radians


class Residual:
    """Of all numbers of the edges, for coordinates y in mean edge lengths; column i of `given` order: lengths, then angles of solid pairs."""

    def __init__(self, lengths):
        self.lengths, edges, mesh = lengths, lengths.edges, lengths.mesh
        self.i, self.j = edges.vertices.T
        pairs = edges.solid
        self.s, self.e = edges.pair_start[pairs], edges.pair_end[pairs]
        opposite = np.roll(mesh.F, 1, axis=1).ravel()  # of half-edge (a,b): c
        self.o_f, self.o_g = opposite[edges.half_f[pairs]], opposite[edges.half_g[pairs]]
        self.turned = np.where(edges.alike[pairs], -1.0, 1.0)[:, None]
        stencil = np.column_stack([self.s, self.e, self.o_f, self.o_g])
        E, P = len(self.i), len(self.s)
        vertices = np.concatenate([np.column_stack([self.i, self.j]).ravel(), stencil.ravel()])
        rows = np.concatenate([np.repeat(np.arange(E), 2), np.repeat(E + np.arange(P), 4)])

        graph = sparse.csr_matrix((np.ones(len(rows)), (rows, vertices)), (E + P, mesh.V))
        order = np.argsort(spd_factor((graph.T @ graph + 100 * E * sparse.eye(mesh.V)).tocsc()).perm_c)
        self.order = (3 * order[:, None] + np.arange(3)).ravel()
        columns = 3 * np.argsort(order)[vertices][:, None] + np.arange(3)
        self.pattern = np.repeat(rows, 3), columns.ravel()
        self.shape = (E + P, 3 * mesh.V)

    def __call__(self, y, given):
        """The residuals and their Jacobian (columns in `order`), or None where a triangle has collapsed."""
        mesh, edges = self.lengths.mesh, self.lengths.edges
        try:
            normals = np.zeros((len(mesh.F), 3))
            normals[mesh.solid] = solid_triangles(mesh, y)[2]
        except Unsupported:
            return None
        chord = y[self.j] - y[self.i]
        length = norms(chord)
        if length.min(initial=1.0) == 0:
            return None
        direction = (chord / length[:, None])[:, None] * np.array([[-1.0], [1.0]])

        t = y[self.e] - y[self.s]
        t2 = np.square(t).sum(axis=1)
        t1 = np.sqrt(t2)
        parts, n = [], []
        for triangle, opposite, sign in ((edges.f, self.o_f, 1.0), (edges.g, self.o_g, self.turned)):
            normal = normals[triangle[edges.solid]] * sign
            size = norms(normal)
            n.append(normal / size[:, None])
            foot = (np.einsum("pi,pi->p", y[opposite] - y[self.s], t) / t2)[:, None]
            lever = n[-1] * (t1 / size)[:, None]  # over the height of the opposite corner
            parts.append((lever * (1 - foot), lever * foot, -lever))
        sine = np.einsum("pi,pi->p", np.cross(n[0], n[1]), t) / t1
        angles = np.arctan2(sine, np.einsum("pi,pi->p", n[0], n[1]))
        by_angle = np.stack([parts[0][0] + parts[1][0], parts[0][1] + parts[1][1], parts[0][2], parts[1][2]], axis=1)

        r = np.concatenate([length, angles]) - given
        bends = r[len(length) :]
        bends -= 2 * np.pi * np.round(bends / (2 * np.pi))
        values = np.concatenate([direction.ravel(), by_angle.ravel()])
        return r, sparse.csr_matrix((values, self.pattern), self.shape)


def levenberg(residual, y, given):
    damping, found = 1e-6, residual(y, given)
    if found is None:
        raise ArithmeticError("the linear start has a collapsed triangle")
    for _ in range(STEPS):
        r, J = found
        gradient, normal = J.T @ r, (J.T @ J).tocsc()
        while True:
            step = np.empty(len(gradient))
            step[residual.order] = -spd_factor((normal + damping * sparse.eye(len(gradient))).tocsc(), "NATURAL").solve(gradient)
            trial = y + step.reshape(-1, 3)
            found = residual(trial, given)
            if found is not None and found[0] @ found[0] < r @ r:
                break
            damping *= 10
            if damping > 1e6 or np.abs(gradient).max(initial=0) <= GRADIENT:
                if np.abs(gradient).max(initial=0) > GRADIENT:
                    raise ArithmeticError(f"no descent, gradient {np.abs(gradient).max():.1e}")
                return y
        y, damping = trial, max(damping / 10, 1e-12)
        if np.abs(step).max() <= 1e-14 * np.abs(y).max():
            return y
    raise ArithmeticError(f"gradient {np.abs(gradient).max():.1e} after {STEPS} steps")


class Decoder:
    def __init__(self, lengths):
        self.lengths, self.mesh, self.lric = lengths, lengths.mesh, lengths.lric
        self.start, self.residual = self.lric.decoder(), Residual(lengths)

    def stretches(self, l):
        """U (F,2,2) of triangles with edge lengths l (E): the root of the metric, made positive where the triangle inequality fails."""
        ab, bc, ca = np.square(l[self.lengths.edges.edge.reshape(-1, 3)[self.mesh.solid]]).T
        dot = (ab + ca - bc) / 2
        inverse = self.lric.inverse
        M = inverse.transpose(0, 2, 1) @ np.moveaxis(np.array([[ab, dot], [dot, ca]]), 2, 0) @ inverse
        trace = np.trace(M, axis1=1, axis2=2)
        root = np.sqrt(np.maximum(np.linalg.det(M), 1e-6 * trace**2))
        U = np.tile(np.eye(2), (len(self.mesh.F), 1, 1))
        U[self.mesh.solid] = (M + root[:, None, None] * np.eye(2)) / np.sqrt(trace + 2 * root)[:, None, None]
        return U

    def __call__(self, z):
        lengths, mesh, lric = self.lengths, self.mesh, self.lric
        l, angles, six = z[lengths.length_slot], z[lengths.pair_slot], z[lengths.size :].reshape(-1, 6)
        x = self.start(self.stretches(l * lengths.unit), angles, six)
        given = np.concatenate([l, angles[lengths.edges.solid]])
        x = lengths.unit * levenberg(self.residual, x / lengths.unit, given)
        turned = lric.triangle_frames(x)[1][lric.roots]
        turn = np.tile(np.eye(3), (mesh.C, 1, 1))
        turn[lric.rooted] = exp_rotation(six[lric.rooted, :3]) @ lric.B0[lric.roots] @ turned.transpose(0, 2, 1)
        return mesh.place(np.einsum("vij,vj->vi", turn[mesh.component], x), six[:, 3:] * mesh.diag)


def prepare(stage, inputs):
    if stage != "shape.lengths_decode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    lengths = Lengths(mesh)
    z, decode = mesh.check_z(inputs["z"], lengths.d), Decoder(lengths)
    return lambda: {"frames": np.array([decode(row) for row in z]).reshape(-1, mesh.V, 3)}


if __name__ == "__main__":
    serve(serve_version(), prepare)
