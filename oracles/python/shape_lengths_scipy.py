"""shape.lengths_decode with scipy.sparse: a trust region by conjugate gradients (Steihaug 1983) on the lengths, the dihedral angles and the terms of
triangles below a tenth of their areas, with an analytic Jacobian J. The second derivatives are J^T J and differences of J along each direction, for
Gauss-Newton's part alone creeps on vectors of no frame; J^T J by SuperLU is the preconditioner. It starts from the linear reconstruction of
shape_lric_numpy.py with the stretches that the lengths give: where z is that of a frame, it starts at the answer.

`seconds` is everything that depends on z. The preconditioner's damping never moves the minimum, and settles the motions that the numbers of edges leave
free: the six numbers of a component place it at last, and parts that hang on a vertex stay as the start has turned them.
"""

import numpy as np
from scipy import sparse

from shape_lengths_numpy import Lengths
from shape_mesh import Mesh, corners_to_edges, norms, serve_version, solid_triangles, spd_factor
from wire import Unsupported, serve

STEPS = 200
EXACT = 1e-12  # root mean square of the residuals, in mean edge lengths and radians, of a frame that has the numbers given
STATIONARY = 1e-7  # cosine of the angle between the residuals and a column of the Jacobian, where no step halves it any more
SUM_DIGITS = 1e-9  # below this part of the sum of squares, a decrease is told by the gradients at both ends
DAMPING = 1e-6
SLOW = 0.9  # a step that leaves more of the sum calls for second derivatives
DIRECTIONS = 100  # of conjugate gradients, in a step
STALE = 12  # directions in a step that call for a new preconditioner
LEAST_AREA = 0.1  # of a triangle, in parts of the area that its given lengths make
FLAT = 1e-5  # a triangle without height, in parts of the reference's: angles jump there, and the descent ends


class Residual:
    """Of the numbers of edges within components, and of the areas, for coordinates y in mean edge lengths; in the order of `given`: lengths, then angles
    of solid pairs, then logarithms of the least areas of solid triangles, -inf where there is none."""

    def __init__(self, lengths):
        self.lengths, edges, mesh = lengths, lengths.edges, lengths.mesh
        self.within = mesh.component[edges.vertices[:, 0]] == mesh.component[edges.vertices[:, 1]]
        self.i, self.j = edges.vertices[self.within].T
        pairs = edges.solid
        self.s, self.e = edges.pair_start[pairs], edges.pair_end[pairs]
        opposite = np.roll(mesh.F, 1, axis=1).ravel()  # of half-edge (a,b): c
        self.o_f, self.o_g = opposite[edges.half_f[pairs]], opposite[edges.half_g[pairs]]
        self.turned = np.where(edges.alike[pairs], -1.0, 1.0)[:, None]
        stencil = np.column_stack([self.s, self.e, self.o_f, self.o_g])
        corners = mesh.F[mesh.solid]
        counts = E, P, A = len(self.i), len(self.s), len(corners)
        vertices = np.concatenate([np.column_stack([self.i, self.j]).ravel(), stencil.ravel(), corners.ravel()])
        width = np.repeat([2, 4, 3], counts)
        rows = np.repeat(np.arange(E + P + A), width)

        graph = sparse.csr_matrix((np.ones(len(rows)), (rows, vertices)), (E + P + A, mesh.V))
        order = np.argsort(spd_factor((graph.T @ graph + 100 * (E + 1) * sparse.eye(mesh.V)).tocsc()).perm_c)
        self.order = (3 * order[:, None] + np.arange(3)).ravel()
        columns = 3 * np.argsort(order)[vertices][:, None] + np.arange(3)
        self.pattern = columns.ravel(), np.concatenate([[0], np.cumsum(3 * width)])
        self.shape = (E + P + A, 3 * mesh.V)
        self.areas = slice(E + P, None)
        self.reference_heights = self.heights(mesh.reference / lengths.unit)

    def vectors(self, d):
        """(V,3) of a vector of the Jacobian's columns."""
        v = np.empty(len(d))
        v[self.order] = d
        return v.reshape(-1, 3)

    def heights(self, y):
        """The least heights of the solid triangles."""
        e1, e2, normal = corners_to_edges(y, self.lengths.mesh.F[self.lengths.mesh.solid])
        return norms(normal) / np.maximum(np.maximum(norms(e1), norms(e2)), norms(e2 - e1))

    def given(self, l, angles):
        """The numbers given: l (E), of any sign, and the angles of all pairs."""
        longest, middle, shortest = np.sort(np.maximum(l, 0)[self.lengths.edges.edge.reshape(-1, 3)[self.lengths.mesh.solid]]).T[::-1]
        excess = shortest - (longest - middle)
        made = excess > 0
        factors = np.stack([longest + (middle + shortest), excess, shortest + (longest - middle), longest + (middle - shortest)])  # Kahan's, of Heron
        logs = np.log(np.where(made, factors, 1)).sum(axis=0) / 2 - np.log(4)
        return np.concatenate([l[self.within], angles[self.lengths.edges.solid], np.where(made, np.log(LEAST_AREA) + logs, -np.inf)])

    def __call__(self, y, given, active=None):
        """The residuals and their Jacobian (columns in `order`), or None where a triangle has collapsed. The triangles of which the Jacobian has rows other
        than zero are `active`, else those below their least areas."""
        mesh, edges = self.lengths.mesh, self.lengths.edges
        try:
            normals = np.zeros((len(mesh.F), 3))
            e1, e2, solid_normals = solid_triangles(mesh, y)
            normals[mesh.solid] = solid_normals
        except Unsupported:
            return None
        chord = y[self.j] - y[self.i]
        length = norms(chord)
        direction = (chord / np.where(length > 0, length, 1)[:, None])[:, None] * np.array([[-1.0], [1.0]])  # may be 0 at degenerate triangles

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

        twice = norms(solid_normals)
        small = np.maximum(given[self.areas] - np.log(twice / 2), 0)
        across = np.stack([e1 - e2, e2, -e1], axis=1)  # from the corner before to the corner after, in the triangle's plane
        by_area = np.cross(solid_normals[:, None], across) / np.square(twice)[:, None, None]
        by_area[~(small > 0 if active is None else active)] = 0

        bends = angles - given[len(length) : self.areas.start]
        bends -= 2 * np.pi * np.round(bends / (2 * np.pi))
        r = np.concatenate([length - given[: len(length)], bends, small])
        values = np.concatenate([direction.ravel(), by_angle.ravel(), by_area.ravel()])
        return r, sparse.csr_matrix((values, *self.pattern), self.shape)


class Point:
    """Coordinates y, with the residuals r, their Jacobian J, the gradient g of half the sum of squares, and the greatest cosine between r and a column."""

    def __init__(self, residual, y, given, found):
        self.residual, self.y, self.given, (self.r, self.J) = residual, y, given, found
        self.g = self.J.T @ self.r
        columns = np.sqrt(np.asarray(self.J.power(2).sum(axis=0)).ravel())
        scale = columns * np.linalg.norm(self.r)
        self.cosine = np.max(np.abs(self.g) / np.where(scale > 0, scale, 1), initial=0.0)

    def exact(self):
        return self.r @ self.r <= EXACT**2 * len(self.r)

    def flattest(self):
        """The least height of a triangle, in parts of the reference's."""
        return np.min(self.residual.heights(self.y) / self.residual.reference_heights, initial=np.inf)

    def moved(self, d):
        y = self.y + self.residual.vectors(d)
        found = self.residual(y, self.given)
        return None if found is None else Point(self.residual, y, self.given, found)

    def preconditioner(self):
        return spd_factor((self.J.T @ self.J + DAMPING * sparse.eye(len(self.g))).tocsc(), "NATURAL")

    def hessian(self, d, curved):
        """Times d. Gauss-Newton's J^T J, or where `curved` with the derivative of J by central differences that change no triangle by more than 1e-5 of
        its height."""
        if not curved:
            return self.J.T @ (self.J @ d)
        v = self.residual.vectors(d)
        mesh = self.residual.lengths.mesh
        change = norms(v[mesh.F[mesh.solid]]).max(axis=1) / self.residual.heights(self.y)
        h = 1e-5 / change.max(initial=1e-300)
        active = self.r[self.residual.areas] > 0
        (_, ahead), (_, behind) = (self.residual(self.y + sign * h * v, self.given, active) for sign in (1, -1))
        return self.J.T @ (self.J @ d) + (ahead.T @ self.r - behind.T @ self.r) / (2 * h)

    def decrease(self, other, d):
        """Of half the sum of squares, from here to `other` = self.moved(d); where rounding hides it, by the trapezoidal rule (after Hager & Zhang 2005)."""
        decrease = (self.r - other.r) @ (self.r + other.r) / 2
        return decrease if abs(decrease) > SUM_DIGITS * (self.r @ self.r) else -(self.g + other.g) @ d / 2


def trust_region_step(point, curved, factor, radius, tolerance):
    """The step d, its length in the preconditioner's norm, the decrease that it promises, and the number of directions (Conn, Gould & Toint, 7.5.1)."""
    d, Hd, left = np.zeros((3, len(point.g)))
    left = left + point.g
    v = factor.solve(left)
    size = first = left @ v
    p, dd, dp, pp = -v, 0.0, 0.0, size
    for count in range(1, DIRECTIONS + 1):
        Hp = point.hessian(p, curved)
        curvature = p @ Hp
        step = size / curvature if curvature > 0 else np.inf
        outside = curvature <= 0 or dd + step * (2 * dp + step * pp) >= radius**2
        if outside:
            step = (np.sqrt(dp**2 + pp * (radius**2 - dd)) - dp) / pp
        d, Hd, left, dd = d + step * p, Hd + step * Hp, left + step * Hp, dd + step * (2 * dp + step * pp)
        if outside:
            break
        v = factor.solve(left)
        before, size = size, left @ v
        if size <= tolerance**2 * first:
            break
        ratio = size / before
        dp, pp = ratio * (dp + step * pp), size + ratio**2 * pp
        p = -v + ratio * p
    return d, np.sqrt(dd), -(point.g @ d + d @ Hd / 2), count


def stationary(residual, y, given):
    """Coordinates where the sum of squares is stationary to rounding, downhill from y."""
    found = residual(y, given)
    if found is None:
        raise ArithmeticError("the linear start has a triangle without height")
    point, curved, factor, radius = Point(residual, y, given, found), False, None, None
    for step in range(STEPS):
        if point.exact() or point.cosine == 0:
            return point.y
        if factor is None:
            factor = point.preconditioner()
            radius = radius or np.sqrt(point.g @ factor.solve(point.g))  # at first the length of Gauss-Newton's step
        d, length, promised, count = trust_region_step(point, curved, factor, radius, np.clip(np.sqrt(point.cosine), 0.01, 0.1))
        trial = point.moved(d)
        gain = -1.0 if trial is None else point.decrease(trial, d) / promised
        if point.cosine <= STATIONARY and (trial is None or trial.cosine > point.cosine / 2):
            return point.y
        if gain < 0.25:
            radius = length / 4
        elif gain > 0.75:
            radius = max(radius, 2 * length)
        curved = curved or trial is None or trial.r @ trial.r > SLOW * (point.r @ point.r)
        if gain > 0:
            point, factor = trial, factor if count <= STALE else None
            if point.flattest() <= FLAT:
                break
        elif np.abs(d).max() <= np.finfo(float).eps * np.abs(point.y).max():
            break
    flattest = point.flattest()
    reason = "the descent ends at a triangle without height" if flattest <= FLAT else "no stationary frame is reached"
    raise ArithmeticError(f"{reason}: cosine {point.cosine:.1e} after {step + 1} steps, the flattest at {flattest:.1e} of its height in the reference")


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
        l, angles, tail = z[lengths.length_slot], z[lengths.pair_slot], z[lengths.size :]
        x = self.start(self.stretches(l * lengths.unit), angles, tail)
        x = lengths.unit * stationary(self.residual, x / lengths.unit, self.residual.given(l, angles))
        R, centres, _ = lric.placed(tail)
        root = mesh.root[lric.rooted]
        turn = np.tile(np.eye(3), (mesh.C, 1, 1))
        turn[lric.rooted] = R[lric.rooted] @ lric.B0[root] @ lric.triangle_frames(x)[1][root].transpose(0, 2, 1)
        return mesh.place(np.einsum("vij,vj->vi", turn[mesh.component], x), centres)


def prepare(stage, inputs):
    if stage != "shape.lengths_decode":
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    lengths = Lengths(mesh)
    z, decode = mesh.check_z(inputs["z"], lengths.d), Decoder(lengths)
    return lambda: {"frames": np.array([decode(row) for row in z]).reshape(-1, mesh.V, 3)}


if __name__ == "__main__":
    serve(serve_version(), prepare)
