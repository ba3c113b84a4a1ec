"""Closed forms for the oracles of mesh.quality. Run by test_oracles.py, and by ../cpp/test_wire.py."""

import itertools

import numpy as np

from checking import Oracle, check, close

SIMPLEX = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
CUBE = np.array(list(itertools.product([0.0, 1], repeat=3)))
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def edge_meets(edges, triangles):
    """(e, f): whether edge e (two points) crosses triangle f, in general position, by signs of volumes."""
    p, q = edges[:, None, 0], edges[:, None, 1]
    a, b, c = (triangles[None, :, i] for i in range(3))
    side = lambda u, v, w, x: np.einsum("...i,...i", np.cross(v - u, w - u), x - u) > 0
    round_ = [side(p, q, x, y) for x, y in ((a, b), (b, c), (c, a))]
    return (side(a, b, c, p) != side(a, b, c, q)) & (round_[0] == round_[1]) & (round_[1] == round_[2])


def crossing(triangles):
    """(f, f): which of them cross: an edge of the one goes through the other."""
    f = len(triangles)
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3)
    through = edge_meets(edges, triangles).reshape(f, 3, f).any(axis=1)
    through[np.diag_indices(f)] = False
    return through | through.T


def check_measures(name, ask, near):
    frames = np.stack([CUBE, 2 * CUBE - 5, CUBE * [1, 2, 3], CUBE * [-1, 1, 1]])
    found = ask(frames, CUBE_FACES)
    close(f"{name}: areas of boxes", found["area"], [6, 24, 22, 6], 24 * near)
    close(f"{name}: volumes of boxes", found["volume"], [1, 8, 6, -1], 1e-12)
    if "intersecting_faces" in found:
        close(f"{name}: boxes do not meet themselves", found["intersecting_faces"], np.zeros(4), 0)
    if "intersections" in found:
        close(f"{name}: no pair in boxes", found["intersections"], np.zeros(4), 0)
    two = ask(np.stack([np.vstack([SIMPLEX, SIMPLEX + d]) for d in (5, 0.1)]), np.vstack([SIDES, SIDES + 4]))
    close(f"{name}: the volume of two simplices", two["volume"], [1 / 3] * 2, 1e-12)
    close(f"{name}: their area", two["area"], [3 + 3**0.5] * 2, 5 * near)
    open_ = ask(CUBE[None] - [0.0, 0, 1], CUBE_FACES[2:])
    close(f"{name}: the area of an open cube", open_["area"], [5], 5 * near)
    if "volume" in open_:  # about the origin, on the plane of the upper side, the side x = 0 left out: it has no part in the sum either
        close(f"{name}: the volume of an open cube", open_["volume"], [1], 1e-12)
        close(f"{name}: the same about another point", ask(CUBE[None] + [1.0, 0, 0], CUBE_FACES[2:])["volume"], [4 / 3], 1e-12)


def check_faces(name, ask, exactly):
    """`exactly`: pairs are counted too, and touching is decided."""

    def meets(what, points, F, pairs, faces):
        found = ask(np.asarray(points, float)[None], np.asarray(F))
        close(f"{name}: {what}: triangles that meet others", found["intersecting_faces"], [faces], 0)
        if exactly:
            close(f"{name}: {what}: pairs", found["intersections"], [pairs], 0)

    spike = np.array([[-0.3, -0.2, -1], [0.7, -0.1, -1], [0.15, 0.8, -1], [0.2, 0.21, 0.22]])
    both = np.vstack([SIDES, SIDES + 4])
    meets("a spike inside a simplex", np.vstack([SIMPLEX, spike]), both, 3, 4)  # its three sides go through the floor
    spike = np.array([[0.15, 0.16, -1], [0.27, 0.2, -1], [0.19, 0.28, -1], [0.2, 0.21, 9]])
    meets("a spike through a simplex", np.vstack([SIMPLEX, spike]), both, 6, 5)  # floor and slope
    meets("a simplex within another", np.vstack([SIMPLEX, SIMPLEX / 8 + 0.1]), both, 0, 0)
    first = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    pair = [[0, 1, 2], [3, 4, 5]]
    meets("two triangles that cross", [*first, [1, 1, -1], [1, 1.3, 1], [2, 1, 3]], pair, 1, 2)
    meets("two whose boxes overlap", [*first, [3, 3, -1], [3, 3.3, 1], [3.2, 3, 1]], pair, 0, 0)
    fan = [[0, 1, 2], [0, 3, 4]]
    meets("one common vertex and no more", [*first, [1, 1, 1], [1, 2, 3]], fan, 0, 0)
    meets("one common vertex and a crossing", [*first, [1, 1, 1], [1, 2, -3]], fan, 0, 2)
    meets("two common vertices", [*first, [1, 1, 1]], [[0, 1, 2], [1, 0, 3]], 0, 0)

    rng = np.random.default_rng(4)
    soup = rng.uniform(size=(70, 1, 3)) + 0.15 * rng.normal(size=(70, 3, 3))
    cross = crossing(soup)
    meets("a soup", soup.reshape(-1, 3), np.arange(210).reshape(-1, 3), cross.sum() // 2, cross.any(axis=1).sum())
    if exactly:
        meets("a corner on a triangle", [*first, [1, 1, 0], [1, 1.3, 1], [2, 1, 3]], pair, 1, 2)
        meets("a corner a hair above it", [*first, [1, 1, 5e-324], [1, 1.3, 1], [2, 1, 3]], pair, 0, 0)
        meets("corners in one place", [*first, [0, 0, 0], [-1, 0, 1], [-1, -1, 1]], pair, 1, 2)
        meets("two in one plane that overlap", [*first, [1, 1, 0], [5, 1, 0], [1, 5, 0]], pair, 1, 2)
        meets("two in one plane apart", [*first, [4, 4, 0], [4, 3, 0], [3, 4, 0]], pair, 0, 0)
        meets("one common vertex and a common edge's part", [*first, [2, 0, 0], [1, -1, 1]], fan, 0, 2)


def check_refusals(name, status):
    F = np.array([[0, 1, 2]])
    check(f"{name}: a face without its vertex", status(frames=SIMPLEX[None], F=F + 2) == "error")
    if "trimesh" not in name:
        check(f"{name}: a triangle of no area", status(frames=np.array([[[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]]), F=F) == "unsupported")


def run():
    for program, near in (("mesh_quality_trimesh", 1e-14), ("mesh_quality_pymeshlab", 2e-7)):
        with Oracle(program, "mesh.quality") as oracle:
            ask = lambda frames, F: oracle.run(frames=frames, F=F)
            check_measures(program, ask, near)
            check_refusals(program, oracle.status)
            if program.endswith("pymeshlab"):
                check_faces(program, ask, exactly=False)
