"""Closed forms for the oracles of shape spaces: surfaces whose edges, angles and rotations are known without measuring them. Run by test_oracles.py.

Nothing here comes from shape_mesh.py or another oracle: what is expected is written out, or made with the few lines below.
"""

import functools

import numpy as np

from checking import Oracle, check, close

RT2 = np.sqrt(2)
NEEDLE = np.array([[4, 2, 0]])  # three vertices of a flat strip on one line: a degenerate triangle


def turning(r):
    """The rotation of a rotation vector, by Rodrigues' formula."""
    r = np.asarray(r, float)
    angle = np.linalg.norm(r)
    if angle == 0:
        return np.eye(3)
    x, y, z = r / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def strip(cells, angle=0.0):
    """A row of unit squares, two triangles each, rolled by `angle` from square to square, away from the normal +z of the first: each of the edges
    between two squares is convex, and square i is turned by i times the angle about +y."""
    headings = angle * np.arange(cells)
    row = np.zeros((cells + 1, 3))
    row[1:] = np.cumsum(np.column_stack([np.cos(headings), np.zeros(cells), -np.sin(headings)]), axis=0)
    corners = 2 * np.arange(cells)[:, None]
    x = np.stack([row, row + [0, 1, 0]], axis=1).reshape(-1, 3)
    return x, np.concatenate([corners + [0, 2, 3], corners + [0, 3, 1]], axis=1).reshape(-1, 3)


def rigid(x, r, shift):
    return x @ turning(r).T + shift


TETRAHEDRON = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
SPIN, SHIFT = np.array([0.5, -1.1, 0.7]), np.array([3.0, -2, 5])


def book(*angles):
    """A page in the plane z = 0 on the spine from 0 to 1, and pages at these dihedral angles to it, which run along the spine the other way."""
    away = [[np.zeros(1), [-np.cos(a)], [-np.sin(a)]] for a in angles]
    x = np.vstack([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], np.reshape(away, (-1, 3))])
    return x, np.array([[0, 1, 2]] + [[1, 0, 3 + i] for i in range(len(angles))])


def world(rng, degenerate=True):
    """Two strips, a vertex of no triangle, and a triangle that is degenerate in the reference; frames of it, each strip moved and bent by itself."""
    (x, F), (y, G) = strip(3), strip(2)
    faces = np.concatenate([F, NEEDLE[: int(degenerate)], G + len(x) + 1])
    reference = np.concatenate([x**2, [[7.0, 7, 7]], y**2 + [0, 5, 0]])  # squared, so that areas differ
    frames = []
    for _ in range(3):
        parts = [rigid(strip(n, rng.uniform(-1, 1))[0], rng.normal(size=3), rng.normal(size=3)) for n in (3, 2)]
        frame = np.concatenate([parts[0], rng.normal(size=(1, 3)), parts[1]])
        frames.append(frame + 0.05 * rng.normal(size=frame.shape))
    return {"reference": reference, "F": faces}, np.array(frames)


# Triangles and vertices of every odd kind. 0: degenerate, the lowest of three at the spine (0,1); 1, 2: a book's pages; 3: degenerate, between the two fans
# 4, 5 and 6, 7 about vertex 5, and joined to both; 8: hangs on vertex 4; 9: of no area, on a side of 10, with two vertices in one place; vertex 14: of none.
ODD_FACES = np.array(
    [[0, 1, 2], [0, 1, 3], [1, 0, 4], [5, 8, 9], [5, 6, 7], [5, 7, 8], [5, 9, 10], [5, 10, 11], [4, 12, 13], [15, 16, 17], [15, 17, 18]]
)
ODD_VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0.4, 1, 0.1], [0.6, -1.2, 0.3]]
    + [[5, 0, 0], [5, 1, 0.2], [5.8, 1, -0.1], [6, 0, 0], [4, 0, 0], [4.2, -1, 0.1], [5, -1, 0.3]]
    + [[1.5, -2, 0], [0.5, -2.2, 0.4], [7, 7, 7], [0, 3, 0], [0, 3, 0], [1, 3, 0], [0, 4, 0]]
)
ODD_COMPONENTS = [[0, 1, 3, 4, 12, 13], [2], [5, 6, 7, 8, 9, 10, 11], [14], [15, 17, 18], [16]]
ODD_BENDS = np.array([[0.4, -0.9, 0.3], [1.1, 0.2, -0.5]])  # of the further parts, whose lowest triangles are 6 and 8


class Odd:
    """The mesh above, and frames of it: one of components turned by `spins` (V,3), with further parts bent, and two like it of any shape."""

    def __init__(self, rng):
        self.x0, self.F, self.components, self.bends = ODD_VERTICES, ODD_FACES, ODD_COMPONENTS, ODD_BENDS
        self.degenerate = np.isin(np.arange(len(self.F)), [0, 3, 9])
        x, self.spins = self.x0.copy(), np.zeros((len(self.x0), 3))
        for bend, hinge, hanging in zip(self.bends, (5, 4), ([9, 10, 11], [12, 13])):
            x[hanging] = rigid(x[hanging] - x[hinge], bend, x[hinge])
        for component, spin in zip(self.components, rng.uniform(-1.5, 1.5, (len(self.components), 3))):  # none by half a turn
            self.spins[component] = spin * (len(component) > 1)
            x[component] = rigid(x[component], spin, rng.normal(size=3))
        self.frames = x + [[[0.0]], [[0.05]], [[0.1]]] * rng.normal(size=(3, *x.shape))

    def without_page(self):
        """No edge has three triangles any more; the tip of the page is by itself."""
        tip = np.setdiff1d(self.F[1], self.F[2])[0]
        self.F, self.degenerate = np.delete(self.F, 1, axis=0), np.delete(self.degenerate, 1)
        self.components = sorted([[v for v in component if v != tip] for component in self.components] + [[tip]])
        self.spins[tip] = 0
        return self

    def mirrored(self):
        """In space, and in the numbers of vertices, so that other edges come first; surfaces keep their outer sides, and edges their angles."""
        last = len(self.x0) - 1
        self.x0, self.frames = self.x0[::-1] * [-1, 1, 1], self.frames[:, ::-1] * [-1, 1, 1]
        self.F = (last - self.F)[:, ::-1]
        self.components = sorted(sorted(last - v for v in component) for component in self.components)
        self.spins, self.bends = self.spins[::-1] * [1, -1, -1], self.bends * [1, -1, -1]
        return self

    def edge_numbers(self, x):
        """Of every edge its length, then the angles of its pairs: where the corner of the second triangle lies, seen from the first."""
        numbers = []
        for i, j in edge_list(self.F).tolist():
            triangles = [f for f, corners in enumerate(self.F.tolist()) if {i, j} <= set(corners)]
            head = min([f for f in triangles if not self.degenerate[f]] or triangles)
            numbers.append([np.linalg.norm(x[j] - x[i]) / mean_length(self.x0, self.F)])
            for f in triangles:
                if f != head:
                    numbers[-1].append(0.0 if self.degenerate[[head, f]].any() else angle_across(x, self.F[head].tolist(), self.F[f].tolist()))
        return numbers

    def placement(self):
        """Of the first frame: the six numbers of components, then the three of further parts."""
        six = [[*self.spins[component[0]], *self.frames[0, component].mean(axis=0) / diagonal(self.x0)] for component in self.components]
        return np.concatenate([np.ravel(six), self.bends.ravel()])


def angle_across(x, f, g):
    """The dihedral angle of triangles f and g: 0 where the corners beside their edge lie opposite, positive where that of g is below f."""
    (third,), (other,) = set(f) - set(g), set(g) - set(f)
    i, j = f[f.index(third) - 2], f[f.index(third) - 1]
    t = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
    p, q = (v - t * (t @ v) for v in (x[third] - x[i], x[other] - x[i]))
    return np.arctan2(-np.cross(t, p) @ q, -p @ q)


def check_odd_motion(name, encode, odd, numbers, tolerance):
    """Moved as a whole, the mesh changes none but the six numbers of components, which follow the `numbers` of edges."""
    z, moved = (encode(odd.x0, odd.F, frames) for frames in (odd.frames, rigid(odd.frames, SPIN, SHIFT)))
    six = slice(numbers, numbers + 6 * len(odd.components))
    close(f"{name}: a motion of all changes no numbers but those of components", np.delete(moved, six, axis=1), np.delete(z, six, axis=1), tolerance)
    turned = [c for c, component in enumerate(odd.components) if len(component) > 1]
    r, s = (y[:, six].reshape(len(z), -1, 6)[:, turned, :3].reshape(-1, 3) for y in (z, moved))
    close(f"{name}: it turns all components alike", [turning(b) @ turning(a).T for a, b in zip(r, s)], [turning(SPIN)] * len(r))


def check_odd_lengths(program, encode, rng, books=True, near=1e-11):
    """`encode` and the limits as in check_lengths_encode."""
    if not books:
        odd = Odd(rng)
        check(f"{program}: three triangles at an edge, one of them degenerate, are unsupported", encode(odd.x0, odd.F, odd.frames) is None)
    for name, odd in odd_kinds(rng, books).items():
        z = encode(odd.x0, odd.F, odd.frames)
        expected = [np.concatenate([row + [0.0] * (2 - len(row)) for row in odd.edge_numbers(x)]) for x in odd.frames]
        numbers = len(expected[0])
        close(f"{program}: {name}: lengths and angles", z[:, :numbers], expected, near)
        close(f"{program}: {name}: components, then further parts by lowest triangle", z[0, numbers:], odd.placement())
        check_odd_motion(f"{program}: {name}", encode, odd, numbers, near)


def odd_kinds(rng, books=True):
    kinds = {"odd": Odd(rng), "odd and mirrored": Odd(rng).mirrored()}
    return kinds if books else {f"{name}, a page less": odd.without_page() for name, odd in kinds.items()}


def check_odd_decode(name, encode, decode, rng, **more):
    for kind, odd in odd_kinds(rng).items():
        z = encode(reference=odd.x0, F=odd.F, **more, frames=odd.frames)["z"]
        close(f"{name}: {kind}: decodes what it encodes", decode(reference=odd.x0, F=odd.F, **more, z=z)["frames"], odd.frames, 1e-10)


def sliver(height):
    """A triangle whose longest edge is 1, of this height, below a larger one."""
    return np.array([[0, 0, 0], [1, 0, 0], [0.5, 1, 0], [0.5, -height, 0]]), np.array([[0, 1, 2], [1, 0, 3]])


def check_threshold(name, encode, size, more):
    """`size` numbers of one component, and `more` of another where the sliver is degenerate: `encode` as in check_lengths_encode."""
    sizes = [encode(*sliver(height), sliver(height)[0][None]).shape[1] for height in (1.1e-5, 0.9e-5)]
    close(f"{name}: what is degenerate", sizes, [size, size + more], 0)


def diagonal(x):
    return np.linalg.norm(np.ptp(x, axis=0))


def gradient_z(x0, rotation_vectors, six, x):
    """z of one component, from what all or each of its triangles have."""
    triangles = np.concatenate([np.atleast_2d(rotation_vectors), np.atleast_2d(six)], axis=1)
    return np.concatenate([triangles.ravel(), x.mean(axis=0) / diagonal(x0)])


def check_gradient_encode(program, oracle, rng):
    def encode(x0, F, x):
        return oracle.run(reference=x0, F=F, frames=x[None])["z"][0]

    still = [1, 1, 1, 0, 0, 0]
    x0, F = TETRAHEDRON
    for r in (SPIN, [0, 0, 0], [0, 3.1, 0], [1e-9, 0, 0]):
        moved = rigid(x0, r, SHIFT)
        name = f"{program}: rotation vectors of a rigid motion by {np.linalg.norm(r):.2g}"
        close(name, encode(x0, F, moved), gradient_z(x0, [r] * 4, [still] * 4, moved))
    grown = 3 * rigid(x0, SPIN, SHIFT)
    close(f"{program}: turned and scaled", encode(x0, F, grown), gradient_z(x0, [SPIN] * 4, [[3, 3, 3, 0, 0, 0]] * 4, grown), 1e-10)

    flat, F = strip(2)
    pulled = flat @ np.array([[2.0, 0.5, 0], [0.5, 1, 0], [0, 0, 1]])  # area times 1.75, so the normal's column times its root
    six = [2, 1, np.sqrt(1.75), 0, 0, RT2 / 2]
    close(f"{program}: a pull in a plane", encode(flat, F, pulled), gradient_z(flat, [[0] * 3] * 4, [six] * 4, pulled))
    upright = turning([0, np.pi / 2, 0]).T  # x to -z: the pull is then in y and z
    z = encode(flat @ upright, F, pulled @ upright)
    close(f"{program}: the order of the six", z, gradient_z(flat, [[0] * 3] * 4, [[np.sqrt(1.75), 1, 2, -RT2 / 2, 0, 0]] * 4, pulled @ upright))
    flat, F = strip(4)
    rolled = strip(4, 0.7)[0]
    headings = np.repeat(0.7 * np.arange(4), 2)
    close(f"{program}: a roll", encode(flat, F, rolled), gradient_z(flat, headings[:, None] * [0, 1, 0], [still] * 8, rolled))

    inputs, frames = world(rng)
    z = oracle.run(**inputs, frames=frames)["z"]
    close(f"{program}: a degenerate triangle is at rest", z[:, 54:63], [[0, 0, 0, *still]] * 3)
    centres = [[x[:8].mean(axis=0), x[8], x[9:].mean(axis=0)] for x in frames]
    close(f"{program}: centres of components, by lowest vertex", z[:, -9:], np.reshape(centres, (3, 9)) / diagonal(inputs["reference"]))
    check_threshold(program, lambda x0, F, frames: oracle.run(reference=x0, F=F, frames=frames)["z"], 9 * 2 + 3, 3)
    check(f"{program}: a face without its vertex", oracle.status(reference=flat, F=F + 99, frames=flat[None]) == "error")


def check_gradient_decode(program, oracle, rng):
    decode = {"stage": "shape.gradient_decode"}
    x0, F = TETRAHEDRON
    x = 3 * rigid(x0, SPIN, SHIFT)
    z = gradient_z(x0, [SPIN] * 4, [[3, 3, 3, 0, 0, 0]] * 4, x)
    close(f"{program}: decodes a turn and a scale", oracle.run(**decode, reference=x0, F=F, z=z[None])["frames"], x[None])
    flat, F = strip(4)
    headings = np.repeat(0.7 * np.arange(4), 2)
    z = gradient_z(flat, headings[:, None] * [0, 1, 0], [[1, 1, 1, 0, 0, 0]] * 8, strip(4, 0.7)[0])
    close(f"{program}: decodes a roll", oracle.run(**decode, reference=flat, F=F, z=z[None])["frames"], strip(4, 0.7)[0][None])

    inputs, frames = world(rng)
    z = oracle.run(**inputs, frames=frames)["z"]
    found = oracle.run(**decode, **inputs, z=z)["frames"]
    close(f"{program}: decodes what it encodes", found, frames)
    mixed = (z[0] + z[1] + z[2]) / 3
    found = oracle.run(**decode, **inputs, z=mixed[None])["frames"][0]
    close(f"{program}: decodes a mean of three by least squares", found, dense_gradient_decode(inputs, mixed), 1e-10)
    check_odd_decode(program, oracle.run, functools.partial(oracle.run, **decode), rng)


def dense_gradient_decode(inputs, z):
    """The world's x by a dense least-squares problem, two rows an edge of every triangle: x (e1 e2) (e1 e2)^+ = T (e1 e2) (e1 e2)^+."""
    x0, F = inputs["reference"], inputs["F"]
    rows, right = [], []
    for f, (a, b, c) in enumerate(F):
        edges = np.stack([x0[b] - x0[a], x0[c] - x0[a]], axis=1)
        size = np.linalg.norm(np.cross(*edges.T))
        if size < 1e-9:
            continue
        r, s = z[9 * f : 9 * f + 3], z[9 * f + 3 : 9 * f + 9]
        T = turning(r) @ np.array([[s[0], s[5] / RT2, s[4] / RT2], [s[5] / RT2, s[1], s[3] / RT2], [s[4] / RT2, s[3] / RT2, s[2]]])
        inverse = np.linalg.pinv(edges)
        row = np.zeros((3, len(x0)))
        row[:, b], row[:, c] = inverse
        row[:, a] = -inverse.sum(axis=0)
        rows.append(np.sqrt(size) * row)
        right.append(np.sqrt(size) * (T @ edges @ inverse).T)
    x = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=1e-12)[0]
    for part, centre in zip((slice(0, 8), slice(8, 9), slice(9, None)), z[9 * len(F) :].reshape(3, 3)):
        x[part] += centre * diagonal(x0) - x[part].mean(axis=0)
    return x


def test_gradient(rng):
    for program in ("shape_gradient_numpy planar", "shape_gradient_numpy", "shape_gradient_scipy", "shape_gradient_libigl"):
        with Oracle(program, "shape.gradient_encode") as oracle:
            check_gradient_encode(program, oracle, rng)
            if "numpy" not in program:
                check_gradient_decode(program, oracle, rng)
    with Oracle("shape_gradient_numpy planar", "shape.gradient_encode") as oracle:
        flat, F = strip(1)
        check("shape_gradient_numpy planar: a collapsed triangle", oracle.status(reference=flat, F=F, frames=flat[None] * [1, 0, 1]) == "unsupported")


def fold(angle):
    """Two triangles of one outward side: (0,1,2) in the plane z = 0, and (1,0,3) at this dihedral angle; five edges."""
    return book(angle)


def check_lengths_encode(program, encode, rng, books=True, turned_over=True, near=1e-11):
    """`encode` (x0, F, frames) gives z, or None where the engine has not got it; `near` is for angles near 0 and pi."""
    flat, F = fold(0)
    unit = (3 + 2 * RT2) / 5  # edges 01, 02, 03, 12, 13
    edges = np.array([1, 1, 1, RT2, RT2]) / unit
    for angle in (0.0, 0.8, -0.8, 3.1, -3.1):
        z = encode(flat, F, fold(angle)[0][None])[0]
        close(f"{program}: lengths of a fold of {angle}", z[:10:2], edges)
        close(f"{program}: dihedral angles of it", z[1:10:2], [angle, 0, 0, 0, 0], near)
        close(f"{program}: its place", z[10:], [0, 0, 0, *fold(angle)[0].mean(axis=0) / diagonal(flat)])
    z = encode(flat, F[:, ::-1], fold(0.8)[0][None])[0]
    close(f"{program}: seen from behind, the fold is concave", z[1], -0.8)
    z = encode(flat, np.concatenate([F[:1], F[1:, ::-1]]), fold(0.8)[0][None])
    if turned_over:
        close(f"{program}: of two triangles of opposite orientation, the second is turned over", z[0, 1], 0.8)
    else:
        check(f"{program}: triangles of opposite orientation are unsupported", z is None)
    z = encode(flat, F[:, [1, 2, 0]], fold(0.8)[0][None])[0]
    close(f"{program}: corners of a triangle may start anywhere", z[:10], encode(flat, F, fold(0.8)[0][None])[0][:10])

    x0, F = TETRAHEDRON
    z = encode(x0, F, 2 * rigid(x0, SPIN, SHIFT)[None])[0]
    close(f"{program}: a tetrahedron twice as large", z[:12:2], np.full(6, 2.0))
    close(f"{program}: its angles are convex", z[1:12:2], np.full(6, np.arccos(-1 / 3)))
    close(f"{program}: its rotation, and its centre", z[12:], [*SPIN, *2 * rigid(x0, SPIN, SHIFT).mean(axis=0) / diagonal(x0)])

    (flat, F), angles = strip(5), np.array([0.4, -0.6])
    rolls = np.array([strip(5, a)[0] for a in angles])
    z = encode(flat, F, rolls)
    kinds = edge_kinds(F)
    lengths = np.array([{"ladder": 1, "side": 1, "brace": RT2}[kind] for kind in kinds])
    close(f"{program}: a roll keeps its lengths", z[:, : 2 * len(kinds) : 2], [lengths / lengths.mean()] * 2)
    bends = [[a if kind == "ladder" and 0 < i < 5 else 0 for kind, i in zip(kinds, edge_columns(F))] for a in angles]
    close(f"{program}: a roll's angles", z[:, 1 : 2 * len(kinds) : 2], bends, near)

    inputs, frames = world(rng, degenerate=False)
    z = encode(inputs["reference"], inputs["F"], frames)
    edges = edge_list(inputs["F"])
    measured = np.linalg.norm(frames[:, edges[:, 1]] - frames[:, edges[:, 0]], axis=2)
    mean = np.linalg.norm(inputs["reference"][edges[:, 1]] - inputs["reference"][edges[:, 0]], axis=1).mean()
    close(f"{program}: edges in ascending order, over two components", z[:, : 2 * len(edges) : 2], measured / mean)
    lone = z[:, 2 * len(edges) + 6 :][:, :6]
    close(f"{program}: a vertex by itself", lone, np.column_stack([np.zeros((3, 3)), frames[:, 8] / diagonal(inputs["reference"])]))

    x0, F = book(0, 0.9, -1.2)
    x = book(0.3, 0.9, -1.2)[0]
    found = encode(x0, F, x[None])
    if books:
        close(f"{program}: a book's spine, then zeros", found[0, :6], [1 / mean_length(x0, F), 0.3, 0.9, -1.2, 1 / mean_length(x0, F), 0])
    else:
        check(f"{program}: a book is unsupported", found is None)


def edge_list(F):
    return np.unique(np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), axis=1), axis=0)


def mean_length(x, F):
    i, j = edge_list(F).T
    return np.linalg.norm(x[j] - x[i], axis=1).mean()


def edge_kinds(F):
    """Of a strip's edges: those across it, those along its sides, and the diagonals of its squares."""
    return ["ladder" if j == i + 1 else "side" if j == i + 2 else "brace" for i, j in edge_list(F)]


def edge_columns(F):
    return edge_list(F)[:, 0] // 2


def test_lengths_encode(rng):
    limits = {"numpy": {}, "libigl": {"books": False, "turned_over": False}, "trimesh": {"books": False, "near": 3e-8}}
    for library, known in limits.items():
        with Oracle(f"shape_lengths_{library}", "shape.lengths_encode") as oracle:

            def encode(x0, F, frames):
                reply = oracle.request(reference=x0, F=F, frames=frames)
                return None if reply["status"] == "unsupported" else reply["out.z"]

            check_lengths_encode(f"shape_lengths_{library}", encode, rng, **known)
            flat, F = strip(2)
            z = oracle.run(reference=flat, F=np.concatenate([F, NEEDLE]), frames=flat[None])["z"]
            close(f"shape_lengths_{library}: a degenerate triangle has lengths and no angles", z[0, 1:20:2], np.zeros(10), known.get("near", 1e-11))
            check_odd_lengths(f"shape_lengths_{library}", encode, rng, known.get("books", True), known.get("near", 1e-11))
            check_threshold(f"shape_lengths_{library}", encode, 2 * 5 + 6, 6)
            for height in (0, 1e-15):
                check(f"shape_lengths_{library}: triangles of height {height} in a frame", encode(flat, F, flat[None] * [1, height, 1]) is None)
            low = encode(flat, F, flat[None] * [1, 1e-11, 1])
            close(f"shape_lengths_{library}: triangles of height 1e-11 lie flat", low[0, 1:18:2], np.zeros(9), known.get("near", 1e-11))


def test_lengths_decode(rng):
    with Oracle("shape_lengths_numpy", "shape.lengths_encode") as encoder, Oracle("shape_lengths_scipy", "shape.lengths_decode") as decoder:
        angle, (flat, F) = 0.7, strip(4)
        rolled = rigid(strip(4, angle)[0], SPIN, SHIFT)
        kinds, columns = edge_kinds(F), edge_columns(F)
        lengths = np.array([RT2 if kind == "brace" else 1 for kind in kinds])
        bends = [angle if kind == "ladder" and 0 < i < 4 else 0 for kind, i in zip(kinds, columns)]
        z = np.concatenate([np.column_stack([lengths / lengths.mean(), bends]).ravel(), SPIN, rolled.mean(axis=0) / diagonal(flat)])
        close("shape_lengths_scipy: decodes a roll written by hand", decoder.run(reference=flat, F=F, z=z[None])["frames"], rolled[None], 1e-10)
        turned = z.copy()
        turned[1 : 2 * len(kinds) : 2] += 2 * np.pi
        close("shape_lengths_scipy: whole turns do not matter", decoder.run(reference=flat, F=F, z=turned[None])["frames"], rolled[None], 1e-10)
        for name, (inputs, frames) in {"a world": world(rng), "a book": book_frames()}.items():
            z = encoder.run(**inputs, frames=frames)["z"]
            close(f"shape_lengths: decodes {name} it encodes", decoder.run(**inputs, z=z)["frames"], frames, 1e-10)
        check_odd_decode("shape_lengths", encoder.run, decoder.run, rng)
        odd = Odd(rng)
        inputs = {"reference": odd.x0, "F": odd.F}
        z = encoder.run(**inputs, frames=odd.frames)["z"]
        for i, edge in enumerate(edge_list(odd.F).tolist()):
            if edge in ([0, 2], [1, 2], [15, 16], [16, 17]):
                z[:, 2 * i + 1] += 0.5  # the spine, before them all, has three numbers
        found = decoder.run(**inputs, z=z)["frames"]
        close("shape_lengths_scipy: edges between components have no say", found, odd.frames, 1e-10)
        tetrahedron, F = TETRAHEDRON
        z = encoder.run(reference=tetrahedron, F=F, frames=tetrahedron[None])["z"]
        z[0, 1:12:2] = 2.1  # angles of no tetrahedron of these lengths: by symmetry its edges become other, but equal
        x = decoder.run(reference=tetrahedron, F=F, z=z)["frames"][0]
        i, j = edge_list(F).T
        sizes = np.linalg.norm(x[j] - x[i], axis=1)
        close("shape_lengths_scipy: angles that cannot be leave lengths alone where all angles pull alike", sizes, np.full(6, np.sqrt(8)), 1e-8)


def sheet(cells, angle, squeeze=1.0):
    """A square of unit squares, two triangles each, rolled as a strip is; squeezed along the roll's axis."""
    row = strip(cells, angle)[0][::2]
    x = (row[:, None] + squeeze * np.arange(cells + 1)[:, None] * [0, 1, 0]).reshape(-1, 3)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    beyond = corner + cells + 1
    return x, np.concatenate([np.hstack([corner, beyond, beyond + 1]), np.hstack([corner, beyond + 1, corner + 1])])


def bow(x, F, turn=(0, 0, 0)):
    """A surface twice, joined at its vertex 0 alone: the second half a turn about +z from the first, and then by `turn`."""
    other = rigid((x - x[0]) * [-1, -1, 1], turn, x[0])
    return np.concatenate([x, other[1:]]), np.concatenate([F, np.where(F > 0, F + len(x) - 1, 0)])


def across(cells, angle, squeeze=1.0):
    """The vertices of a sheet rolled about its other axis."""
    x = sheet(cells, angle)[0].reshape(cells + 1, cells + 1, 3).transpose(1, 0, 2).reshape(-1, 3)
    return x[:, [1, 0, 2]] * [1, squeeze, 1]


def areas(x, F):
    """Of triangles, in frames (...,V,3)."""
    a, b, c = (x[..., corner, :] for corner in F.T)
    return np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2


def shortfalls(inputs, z, x):
    """(n,F) of frames (n,V,3): the logarithm of a tenth of the area that a triangle's lengths in z make, by Heron's formula, over its own; at least 0."""
    edges = {tuple(edge): i for i, edge in enumerate(edge_list(inputs["F"]).tolist())}
    sides = [[z[2 * edges[tuple(sorted(side))]] for side in ((a, b), (b, c), (c, a))] for a, b, c in inputs["F"].tolist()]
    sides = np.array(sides) * mean_length(inputs["reference"], inputs["F"])
    half = sides.sum(axis=1) / 2
    given = np.sqrt(half * (half[:, None] - sides).prod(axis=1))
    return np.maximum(0, np.log(0.1 * given / areas(x, inputs["F"])))


def cosines(encoder, inputs, z, x, h, with_areas=True):
    """Between what a decoder makes small at x, the numbers of x less z and the shortfalls of areas, and what each coordinate changes of it, by central
    differences; and the root of the sum of squares."""
    numbers = 2 * len(edge_list(inputs["F"]))

    def terms(frames):
        return np.hstack([encoder.run(**inputs, frames=frames)["z"][:, :numbers] - z[:numbers], with_areas * shortfalls(inputs, z, frames)])

    moves = h * np.eye(x.size).reshape(-1, *x.shape)
    off, J = terms(x[None])[0], (terms(x + moves) - terms(x - moves)) / (2 * h)
    return np.abs(J @ off) / (np.linalg.norm(J, axis=1) * np.linalg.norm(off)), np.linalg.norm(off)


def test_lengths_means():
    with Oracle("shape_lengths_numpy", "shape.lengths_encode") as encoder, Oracle("shape_lengths_scipy", "shape.lengths_decode") as decoder:
        flat, F = strip(6)
        z = encoder.run(reference=flat, F=F, frames=np.array([strip(6, 0.4)[0], strip(6, 1.0)[0]]))["z"].mean(axis=0)
        middle = rigid(strip(6, 0.7)[0], [0, 0, 0], z[-3:] * diagonal(flat) - strip(6, 0.7)[0].mean(axis=0))
        close("shape_lengths_scipy: the mean of two rolls is the roll between", decoder.run(reference=flat, F=F, z=z[None])["frames"], [middle], 1e-10)

        (flat, F), angles, turns = bow(*strip(6)), (0.4, 1.0), np.array([[0.3, -0.5, 0.1], [0.9, 0.3, 0.7]])
        rolls = np.array([bow(*strip(6, angle), turn)[0] for angle, turn in zip(angles, turns)])
        z = encoder.run(reference=flat, F=F, frames=rolls)["z"]
        close("shape_lengths_numpy: a part that hangs on a vertex", z[:, -3:], turns)
        middle = bow(*strip(6, 0.7), turns.mean(axis=0))[0]
        middle += rolls.mean(axis=(0, 1)) - middle.mean(axis=0)
        found = decoder.run(reference=flat, F=F, z=z.mean(axis=0)[None])["frames"]
        close("shape_lengths_scipy: the mean of two rolls that hang on a vertex", found, [middle], 1e-10)
        flat, F = bow(*sheet(3, 0.0))
        frames = np.array([bow(x, sheet(3, 0.0)[1], turn)[0] for x, turn in zip((sheet(3, 0.5)[0], across(3, 0.5)), turns)])
        inputs = {"reference": flat, "F": F}
        z = encoder.run(**inputs, frames=frames)["z"].mean(axis=0)
        found, size = cosines(encoder, inputs, z, decoder.run(**inputs, z=z[None])["frames"][0], 1e-5)
        check("shape_lengths_scipy: the mean of two pairs of sheets that hang on a vertex is of no frame", size > 1e-4, f"{size:.2g}")
        close("shape_lengths_scipy: it decodes to a stationary frame", found, np.zeros(flat.size), 1e-8)

        cases = ("", 1.0, 0.5, 1e-5, 1e-8), (", of needles", 1e-3, 0.02, 1e-8, 1e-6), (", of needles bent more", 1e-3, 0.2, 1e-9, 1e-5)
        for name, squeeze, angle, h, near in cases:
            flat, F = sheet(4, 0.0, squeeze)
            frames = np.array([sheet(4, angle, squeeze)[0], across(4, angle, squeeze)])
            inputs = {"reference": flat, "F": F}
            z = encoder.run(**inputs, frames=frames)["z"].mean(axis=0)
            x = decoder.run(**inputs, z=z[None])["frames"][0]
            found, size = cosines(encoder, inputs, z, x, h)
            check(f"shape_lengths_scipy: the mean of two rolls across each other is of no frame{name}", size > 1e-4, f"{size:.2g}")
            close(f"shape_lengths_scipy: it decodes to a stationary frame{name}", found, np.zeros(x.size), near)
            moved = x + 1e-3 * squeeze * np.sin(np.arange(x.size)).reshape(x.shape)
            check(f"shape_lengths_scipy: a frame beside it is not stationary{name}", cosines(encoder, inputs, z, moved, h)[0].max() > 1e3 * near)

        held = np.count_nonzero(shortfalls(inputs, z, x[None]))
        check("shape_lengths_scipy: needles bent more would fall below a tenth of their areas", held > 0, f"{held} held")
        check("shape_lengths_scipy: they keep an area", areas(x, F).min() > 1e-2 * areas(flat, F).min())

        flat, F = TETRAHEDRON[0] * [1, 1, 0.05], TETRAHEDRON[1]
        inputs = {"reference": flat, "F": F}
        z = encoder.run(**inputs, frames=flat[None])["z"][0]
        z[1:12:2] += 2 * np.sin(7.0 * np.arange(6))  # angles that no tetrahedron has
        x = decoder.run(**inputs, z=z[None])["frames"][0]
        held = shortfalls(inputs, z, x[None]).max()
        check("shape_lengths_scipy: angles that cannot be push a triangle below a tenth of its area", held > 1e-3, f"{held:.1e}")
        found = cosines(encoder, inputs, z, x, 1e-6)[0]
        close("shape_lengths_scipy: with its term the frame is stationary", found, np.zeros(x.size), 1e-7)
        free = cosines(encoder, inputs, z, x, 1e-6, with_areas=False)[0].max()
        check("shape_lengths_scipy: without it, not", free > 1e-3, f"{free:.1e}")

        right = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
        z = np.array([[3.0, 0, 1, 0, 1, 0, *np.zeros(6)]])  # no triangle: it has no area to keep
        reply = decoder.request(reference=right, F=np.array([[0, 1, 2]]), z=z)
        check("shape_lengths_scipy: a triangle without height is an error", reply["status"] == "error" and "without height" in reply["message"])


def book_frames():
    x0, F = book(0, 0.9, -1.2)
    return {"reference": x0, "F": F}, np.array([book(0.3, 1.0, -2.0)[0], rigid(x0, SPIN, SHIFT)])


def test_lric(rng):
    with Oracle("shape_lric_numpy", "shape.lric_encode") as oracle:
        decode = {"stage": "shape.lric_decode"}
        flat, F = fold(0)
        for angle in (0.0, 0.8, -0.8):
            x = 2 * rigid(fold(angle)[0], SPIN, SHIFT)
            z = oracle.run(reference=flat, F=F, frames=x[None])["z"]
            # half-edges 01, 12, 20 of one triangle and 10, 03, 31 of the other hold 2, 2, 0; the edges are 01, 02, 03, 12, 13
            expected = [2, 2, angle, 0, 0, 0, 2, 0, 0, 2, 0, 0, 0, 0, 0, *SPIN, *x.mean(axis=0) / diagonal(flat)]
            close(f"lric: a fold of {angle}, twice as large and turned", z[0], expected)
            close(f"lric: decodes the fold of {angle}", oracle.run(**decode, reference=flat, F=F, z=np.array([expected]))["frames"], x[None])

        right = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
        pulled = right @ np.array([[2.0, 0.5, 0], [0.5, 1, 0], [0, 0, 1]])
        z = oracle.run(reference=right, F=np.array([[0, 1, 2]]), frames=pulled[None])["z"][0]
        close("lric: the stretch of a triangle at its half-edges", z[:12], [2, 0, 0, RT2 / 2, 0, 0, 1, 0, 0, 0, 0, 0])
        z = oracle.run(reference=right, F=np.array([[1, 2, 0]]), frames=pulled[None])["z"][0]
        # along (-1,1)/sqrt2 and (-1,-1)/sqrt2: U11 = 1 and U22 = 2, U12 = 1/2
        close("lric: the stretch in axes along e1", z[:9], [RT2 / 2, 0, 0, 2, 0, 0, 1, 0, 0], 1e-12)

        flat, F = strip(4)
        rolled = strip(4, 0.7)[0]
        z = oracle.run(reference=flat, F=F, frames=rolled[None])["z"][0]
        kinds, columns = edge_kinds(F), edge_columns(F)
        inner = [i for i, kind in enumerate(kinds) if kind == "brace" or kind == "ladder" and 0 < columns[i] < 4]
        close("lric: a roll's angles", [z[3 * i + 2] for i in inner], [0.7 if kinds[i] == "ladder" else 0 for i in inner])
        for name, (inputs, frames) in {"a world": world(rng), "a book": book_frames()}.items():
            z = oracle.run(**inputs, frames=frames)["z"]
            close(f"lric: decodes {name} it encodes", oracle.run(**decode, **inputs, z=z)["frames"], frames, 1e-10)
        x0, F = book(0, 0.9, -1.2)
        spine = oracle.run(reference=x0, F=F, frames=book(0.3, 1, -2)[0][None])["z"][0]
        close("lric: a book's spine: four stretches, then three angles", spine[:7], [1, 1, 1, 1, 0.3, 1, -2])
        check_odd_lric(rng, lambda x0, F, frames: oracle.run(reference=x0, F=F, frames=frames)["z"])
        check_odd_decode("lric", oracle.run, functools.partial(oracle.run, **decode), rng)
        flat, F = fold(0)
        z = oracle.run(reference=flat, F=F, frames=flat[None])["z"]
        z[0, :2] = 0  # U of both triangles along the edge they share
        check("lric: an edge without length", oracle.status(**decode, reference=flat, F=F, z=z) == "unsupported")
        twice = oracle.status(reference=right, F=np.array([[0, 1, 1]]), frames=right[None])
        check("lric: a triangle that names a vertex twice", twice == "unsupported")


def check_odd_lric(rng, encode):
    for name, odd in odd_kinds(rng).items():
        z = encode(odd.x0, odd.F, odd.frames)
        angles = [row[1:] for row in odd.edge_numbers(odd.frames[1])]
        halves = np.array([len(row) + 1 for row in angles])  # of an edge: one more than pairs
        begin = np.cumsum(np.append(0, np.maximum(3, 2 * halves - 1)))
        found = [z[1, start + half : start + half + len(row)] for start, half, row in zip(begin, halves, angles)]
        close(f"lric: {name}: angles", np.concatenate(found), np.concatenate(angles))
        close(f"lric: {name}: components, then further parts by lowest triangle", z[0, begin[-1] :], odd.placement())
        check_odd_motion(f"lric: {name}", encode, odd, begin[-1], 1e-11)
    check_threshold("lric", encode, 3 * 5 + 6, 6)


def test_patch(rng):
    with Oracle("shape_patch_numpy", "shape.patch_encode") as oracle:
        decode = {"stage": "shape.patch_decode"}
        still = [0, 0, 0, 1, 1, 1, 0, 0, 0]
        x0, F = TETRAHEDRON
        moved = rigid(x0, SPIN, SHIFT)
        inputs = {"reference": x0, "F": F, "patches": np.zeros(4, int)}
        expected = np.array([still * 4 + [*SPIN, *moved.mean(axis=0) / diagonal(x0)]])
        close("patch: one patch, moved", oracle.run(**inputs, frames=moved[None])["z"], expected)
        close("patch: one patch, decoded", oracle.run(**decode, **inputs, z=expected)["frames"], moved[None])

        flat, F = fold(0)
        flat[3, 1] = -2  # the second triangle has twice the area of the first
        bent = flat.copy()
        bent[3] = turning([0.9, 0, 0]) @ flat[3]
        turn = np.angle(1 + 2 * np.exp(0.9j))
        expected = [-turn, 0, 0, *still[3:], 0.9 - turn, 0, 0, *still[3:], turn, 0, 0, *bent.mean(axis=0) / diagonal(flat)]
        z = oracle.run(reference=flat, F=F, patches=np.zeros(2, int), frames=bent[None])["z"]
        close("patch: areas weigh the mean of rotations", z[0], expected)

        flat, F = strip(6)
        rolled = rigid(strip(6, 0.4)[0], SPIN, SHIFT)
        inputs = {"reference": flat, "F": F, "patches": np.repeat([1, 0, 2], 4)}  # two squares each; the lowest patch is the middle one
        bend = turning([0, 0.2, 0])  # from the middle of a patch to the second of its squares
        back, forth = [0, -0.2, 0, *still[3:]], [0, 0.2, 0, *still[3:]]
        first = rotation_vector(turning(SPIN) @ turning([0, 0.8, 0]) @ bend)  # of patch 0: the mean of squares 2 and 3
        pairs = [[0, -0.8, 0], [0, 0.8, 0]]  # (0,1), (0,2)
        centre = rolled.mean(axis=0) / diagonal(flat)
        expected = np.concatenate([np.tile(back * 2 + forth * 2, 3), np.ravel(pairs), first, centre])[None]
        close("patch: three patches of a roll", oracle.run(**inputs, frames=rolled[None])["z"], expected)
        close("patch: decodes the roll written by hand", oracle.run(**decode, **inputs, z=expected)["frames"], rolled[None])

        inputs, frames = world(rng)
        inputs["patches"] = np.array([0, 0, 2, 2, 2, 2, -1, 1, 1, 1, 1])
        z = oracle.run(**inputs, frames=frames)["z"]
        close("patch: decodes the world it encodes", oracle.run(**decode, **inputs, z=z)["frames"], frames, 1e-10)
        check_odd_patch(rng, oracle.run, functools.partial(oracle.run, **decode))
        across = inputs | {"patches": np.array([0, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0])}
        check("patch: a patch over two components", oracle.status(**across, frames=frames) == "error")


def check_odd_patch(rng, encode, decode):
    patches = np.array([-1, 0, 0, -1, 1, 5, 3, 3, 2, -1, 4])  # 0 and 2 in one component; 1, 5 and 3 in another: 1 and 5 share an edge
    for kind, odd in odd_kinds(rng).items():
        z = encode(reference=odd.x0, F=odd.F, patches=patches, frames=odd.frames[:1])["z"][0]
        triangles, rest = z[: 9 * 11].reshape(11, 9), z[9 * 11 :]
        close(f"patch: {kind}: all triangles turn with their patches", triangles, [[0, 0, 0, 1, 1, 1, 0, 0, 0]] * 11)
        close(f"patch: {kind}: one adjacent pair, then components", rest[:-6], [0, 0, 0, *odd.placement()[:-6]])
        close(f"patch: {kind}: further sets by lowest patch", rest[-6:], odd.bends[::-1].ravel())
    check_odd_decode("patch", encode, decode, rng, patches=patches)
    check_odd_decode("patch, both fans in one", encode, decode, rng, patches=np.array([-1, 0, 2, -1, 1, 1, 1, 1, 3, -1, 4]))


def rotation_vector(R):
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / np.linalg.norm(axis) * np.arccos((np.trace(R) - 1) / 2)


def run(rng):
    test_gradient(rng)
    test_lengths_encode(rng)
    test_lengths_decode(rng)
    test_lengths_means()
    test_lric(rng)
    test_patch(rng)
