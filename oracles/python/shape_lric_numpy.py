"""shape.lric_encode and shape.lric_decode by numpy, with SuperLU (scipy.sparse.linalg.splu) for the two linear systems of decoding. After Lipman,
Sorkine, Levin, Cohen-Or 2005, with the stretches at triangles and the angles at edges as PROTOCOL.md has it.

`seconds` is the work on the frames: in decoding, the rotations' matrix of every frame is assembled and factored within it (it depends on z; its fill-
reducing order does not), while the Laplacian is factored before.
"""

import numpy as np
from scipy import sparse

from shape_mesh import RT2, Edges, Mesh, Poisson, axes, exp_rotation, log_rotation, nearest_rotation, norms, serve_version, solid_triangles
from shape_mesh import spd_factor, unit
from wire import Unsupported, serve


def plane_coordinates(B, e):
    return np.einsum("fij,fi->fj", B[:, :, :2], e)


class Lric:
    def __init__(self, mesh):
        self.mesh, self.edges = mesh, Edges(mesh)
        edges, solid = self.edges, mesh.solid
        width = np.maximum(3, 2 * edges.count - 1)
        begin = np.cumsum(width) - width
        self.half_slot = (begin[edges.edge] + edges.rank).reshape(-1, 3)
        self.pair_slot = begin[edges.pair_edge] + edges.count[edges.pair_edge] + edges.pair_rank
        self.size = width.sum()
        self.d = self.size + 6 * mesh.C + 3 * len(edges.further)
        self.B0 = np.tile(np.eye(3), (len(mesh.F), 1, 1))
        self.B0[solid] = axes(mesh.e1[solid], mesh.normal[solid])
        self.plane = np.stack([plane_coordinates(self.B0, e) for e in (mesh.e1, mesh.e2 - mesh.e1, -mesh.e2)], axis=1)  # of the half-edges
        self.inverse = np.linalg.inv(np.stack([self.plane[solid, 0], -self.plane[solid, 2]], axis=2))
        self.rooted = np.flatnonzero(mesh.root >= 0)
        self.roots = np.concatenate([mesh.root[self.rooted], edges.further])  # the lowest triangles of all parts, those of components first
        self.home = mesh.component[mesh.F[edges.further, 0]]  # the components of further parts

    def triangle_frames(self, x):
        """U (F,2,2) and the axes (F,3,3), columns u, v, normal, with D2 = [u v] U D2_0; degenerate triangles: U = I."""
        mesh = self.mesh
        U, turned = np.tile(np.eye(2), (len(mesh.F), 1, 1)), np.tile(np.eye(3), (len(mesh.F), 1, 1))
        e1, e2, normal = solid_triangles(mesh, x)
        B = axes(e1, normal)
        F2 = np.stack([plane_coordinates(B, e1), plane_coordinates(B, e2)], axis=2) @ self.inverse
        phi = np.arctan2(F2[:, 1, 0] - F2[:, 0, 1], F2[:, 0, 0] + F2[:, 1, 1])
        R2 = np.moveaxis(np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]]), 2, 0)
        U[mesh.solid] = R2.transpose(0, 2, 1) @ F2
        turned[mesh.solid] = np.concatenate([B[:, :, :2] @ R2, B[:, :, 2:]], axis=2)
        return U, turned

    def placement(self, x, turned):
        """The six numbers of each component, then the three of each further part."""
        mesh, R = self.mesh, turned @ self.B0.transpose(0, 2, 1)
        six = np.zeros((mesh.C, 6))
        six[self.rooted, :3] = log_rotation(R[mesh.root[self.rooted]])
        six[:, 3:] = mesh.centres(x) / mesh.diag
        three = log_rotation(R[mesh.root[self.home]].transpose(0, 2, 1) @ R[self.edges.further])
        return np.concatenate([six.ravel(), three.ravel()])

    def placed(self, tail):
        """Of those numbers: the rotations of components, their centres, and the axes of the lowest triangles of all parts."""
        six, three = np.split(tail, [6 * self.mesh.C])
        six = six.reshape(-1, 6)
        R = exp_rotation(six[:, :3])
        of_parts = np.concatenate([R[self.rooted], R[self.home] @ exp_rotation(three.reshape(-1, 3))])
        return R, six[:, 3:] * self.mesh.diag, of_parts @ self.B0[self.roots]

    def encode(self, x):
        U, turned = self.triangle_frames(x)
        z = np.zeros(self.d)
        z[self.half_slot] = np.stack([U[:, 0, 0], U[:, 1, 1], RT2 * U[:, 0, 1]], axis=1)
        z[self.pair_slot] = self.edges.dihedral_angles(self.mesh, x)
        z[self.size :] = self.placement(x, turned)
        return z

    def transitions(self, U, angles):
        """C (P,3,3) of the pairs of solid triangles: the rotation from the frame of g to that of f, so that R_g = R_f C."""
        edges = self.edges
        angles = angles + np.pi * edges.alike

        def triad(f, half, sign):
            t = np.einsum("pij,pj->pi", U[f], self.plane[f, half % 3]) * sign[:, None]
            if not np.all(norms(t)[edges.solid] > 0):
                raise Unsupported("an edge has no length: nothing says how its triangles turn")
            t = unit(np.column_stack([t, np.zeros(len(t))]))
            normal = np.broadcast_to([0.0, 0, 1], t.shape)
            return np.stack([t, np.cross(normal, t), normal], axis=2)

        G_f = triad(edges.f, edges.half_f, np.ones(len(edges.f)))
        G_g = triad(edges.g, edges.half_g, np.where(edges.alike, 1.0, -1.0))
        turn = exp_rotation(angles[:, None] * [1.0, 0, 0])
        return (G_f @ turn @ G_g.transpose(0, 2, 1))[edges.solid]

    def decoder(self):
        mesh, edges = self.mesh, self.edges
        poisson = Poisson(mesh).factor()
        rotations = RotationSystem(len(mesh.F), edges.f[edges.solid], edges.g[edges.solid], self.roots, np.flatnonzero(mesh.solid))

        def decode(U, angles, tail):
            _, centres, given = self.placed(tail)
            R = rotations.solve(self.transitions(U, angles), given)
            x = poisson.solve(R[:, :, :2] @ U @ self.B0[:, :, :2].transpose(0, 2, 1))
            return mesh.place(x, centres)

        return decode

    def unpack(self, z):
        a, b, c = z[self.half_slot].T
        U = np.stack([a, c / RT2, c / RT2, b], axis=1).reshape(-1, 2, 2)
        U[~self.mesh.solid] = np.eye(2)
        return U, z[self.pair_slot], z[self.size :]


class RotationSystem:
    """min sum over pairs |R_g - R_f C|^2 with the R of `roots` given: for the transposes X, the normal equations of X_g = C^T X_f."""

    def __init__(self, count, f, g, roots, present):
        free = np.setdiff1d(present, roots)
        self.count, self.f, self.g, self.roots, self.free = count, f, g, roots, free
        self.number = np.full(count, -1)
        self.number[free] = np.arange(len(free))
        self.degree = np.bincount(np.concatenate([f, g]), minlength=count)[free].astype(float)
        self.both = (self.number[f] >= 0) & (self.number[g] >= 0)
        self.from_root, self.to_root = self.number[f] < 0, self.number[g] < 0
        # The fill-reducing order is that of the triangles, whose blocks stay together; the 3x3 blocks are entered row by row.
        n, p = self.number[f][self.both], self.number[g][self.both]
        graph = sparse.coo_matrix((-np.ones(len(n)), (n, p)), (len(free), len(free)))
        graph = (graph + graph.T + sparse.diags(self.degree + 1)).tocsc()
        order = np.argsort(spd_factor(graph).perm_c) if len(free) else np.zeros(0, int)
        self.order = (3 * order[:, None] + np.arange(3)).ravel()
        place = np.argsort(order)
        row, col = np.mgrid[:3, :3].reshape(2, 1, 9)
        n, p = 3 * place[n][:, None], 3 * place[p][:, None]
        diagonal = np.argsort(self.order)
        self.rows = np.concatenate([diagonal, (p + row).ravel(), (n + row).ravel()])
        self.cols = np.concatenate([diagonal, (n + col).ravel(), (p + col).ravel()])

    def solve(self, C, given):
        """C (P,3,3), given (roots,3,3); nearest rotations to the minimisers (count,3,3), the identity where there is no triangle."""
        X = np.tile(np.eye(3), (self.count, 1, 1))
        X[self.roots] = given.transpose(0, 2, 1)
        if len(self.free):
            size = 3 * len(self.free)
            Ct = C.transpose(0, 2, 1)
            values = np.concatenate([np.repeat(self.degree, 3), -Ct[self.both].ravel(), -C[self.both].ravel()])
            right = np.zeros((len(self.free), 3, 3))
            for touching, free_end, fixed_end, blocks in ((self.from_root, self.g, self.f, Ct), (self.to_root, self.f, self.g, C)):
                np.add.at(right, self.number[free_end[touching]], blocks[touching] @ X[fixed_end[touching]])
            A = sparse.csc_matrix((values, (self.rows, self.cols)), (size, size))
            part = np.empty((size, 3))
            part[self.order] = spd_factor(A, "NATURAL").solve(right.reshape(-1, 3)[self.order])
            X[self.free] = nearest_rotation(part.reshape(-1, 3, 3))
        return X.transpose(0, 2, 1)


def prepare(stage, inputs):
    if stage not in ("shape.lric_encode", "shape.lric_decode"):
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    lric = Lric(mesh)
    if stage.endswith("encode"):
        frames = mesh.check_frames(inputs["frames"])
        return lambda: {"z": np.array([lric.encode(x) for x in frames]).reshape(-1, lric.d)}
    z, decode = mesh.check_z(inputs["z"], lric.d), lric.decoder()
    return lambda: {"frames": np.array([decode(*lric.unpack(row)) for row in z]).reshape(-1, mesh.V, 3)}


if __name__ == "__main__":
    serve(serve_version(), prepare)
