"""Closed forms for the oracles of shape.halfway: rigid motions, which cost no energy, and a tube bent far, whose lengths and orientation are known.
Run by test_oracles.py, and for the C++ oracle by ../cpp/test_wire.py.
"""

import numpy as np

from checking import Oracle, check, close
from test_shapes import SHIFT, SPIN, book, mean_length, rigid, strip

SIDES = 8
STILL = 5e-3  # for a tube 19 long: the engines end when 10 iterations move nothing by 1e-5 of the diagonal, and their steps shrink slowly


def tube(rings, angle=0.0):
    """Rings of unit distance and radius 1.5 around a segment, or an arc of the same length that turns by `angle` about +y; open."""
    turn = angle * np.arange(rings)[:, None] / (rings - 1)
    radius = (rings - 1) / angle if angle else 1.0
    zero = np.zeros_like(turn)
    centre = np.hstack([radius * np.sin(turn), zero, radius * (np.cos(turn) - 1)]) if angle else np.arange(rings)[:, None] * [1.0, 0, 0]
    up = np.hstack([np.sin(turn), zero, np.cos(turn)])
    around = 2 * np.pi * np.arange(SIDES)[:, None] / SIDES
    x = centre[:, None] + 1.5 * (np.cos(around) * [0, 1, 0] + np.sin(around) * up[:, None])
    a = (SIDES * np.arange(rings - 1)[:, None] + np.arange(SIDES)).ravel()
    b = np.where(a % SIDES < SIDES - 1, a + 1, a + 1 - SIDES)
    return x.reshape(-1, 3), np.concatenate([np.column_stack([a, b, b + SIDES]), np.column_stack([a, b + SIDES, a + SIDES])])


def agreeing_normals(x, y, F):
    normals = [np.cross(p[F[:, 1]] - p[F[:, 0]], p[F[:, 2]] - p[F[:, 0]]) for p in (x, y)]
    return np.vecdot(*normals).min() > 0


def check_halfway(program, ask, books=True, rest=1e-9):
    """`ask` (start, end, F, handles, targets) gives a reply; `rest` is how far what is at rest may move."""
    x, F = tube(20)
    ends = np.concatenate([np.arange(2 * SIDES), np.arange(len(x) - 2 * SIDES, len(x))])
    straight = {"start": x, "end": x, "F": F}

    def frame(handles, targets, scale=1.0):
        reply = ask(**{**straight, "start": scale * x, "end": scale * x}, handles=handles, targets=scale * targets)
        check(f"{program}: {len(handles)} handles", reply["status"] == "ok", reply.get("message", ""))
        return reply["out.frame"]

    close(f"{program}: nothing moves", frame(ends, x[ends]), x, rest)
    moved = rigid(x, SPIN, SHIFT)
    one = np.arange(3 * SIDES)
    close(f"{program}: one grip takes all along", frame(one, moved[one]), moved, STILL)
    close(f"{program}: two grips turn and move as one", frame(ends, moved[ends]), moved, STILL)
    close(f"{program}: scattered handles move as one", frame(np.arange(0, len(x), 7), moved[::7]), moved, STILL)
    everything = np.random.default_rng(1).permutation(len(x))
    close(f"{program}: all vertices are handles", frame(everything, moved[everything]), moved, 1e-12)
    for degrees in (85, 170):
        bent = tube(20, np.radians(degrees))[0]
        found = frame(ends, bent[ends])
        close(f"{program}: a tube bent by {degrees} degrees holds its handles", found[ends], bent[ends], 1e-12)
        ratio = mean_length(found, F) / mean_length(x, F)
        check(f"{program}: and keeps its mean edge length", abs(ratio - 1) < 0.012, f"{ratio:.4f}")
        check(f"{program}: and follows the arc", np.linalg.norm(found - bent, axis=1).max() < 0.15)
        check(f"{program}: and turns no triangle over", agreeing_normals(found, bent, F))
        close(f"{program}: and knows no unit", frame(ends, bent[ends], scale=1e-3), 1e-3 * found, 1e-6)
    average = mean_length((x + bent) / 2, F) / mean_length(x, F)
    check(f"{program}: which a mean of positions does not", average < 0.8, f"{average:.4f}")

    check(f"{program}: no handle", ask(**straight, handles=np.empty(0, int), targets=np.empty((0, 3)))["status"] == "unsupported")
    lonely = {name: np.vstack([straight[name], SHIFT]) for name in ("start", "end")}
    check(f"{program}: a vertex of no triangle, free", ask(**lonely, F=F, handles=ends, targets=x[ends])["status"] == "unsupported")
    ends = np.append(ends, len(x))
    reply = ask(**lonely, F=F, handles=ends, targets=lonely["start"][ends])
    close(f"{program}: a vertex of no triangle, held", reply.get("out.frame", []), lonely["start"], rest)
    flat = {"start": strip(2)[0], "end": strip(2)[0], "F": np.concatenate([strip(2)[1], [[4, 2, 0]]])}
    hold = {"handles": np.array([0]), "targets": np.zeros((1, 3))}
    check(f"{program}: a degenerate triangle", ask(**flat, **hold)["status"] == "unsupported")
    check(f"{program}: a handle twice", ask(**straight, handles=np.array([0, 0]), targets=np.zeros((2, 3)))["status"] == "error")
    check(f"{program}: a handle without its vertex", ask(**straight, handles=np.array([-1]), targets=np.zeros((1, 3)))["status"] == "error")
    x0, F = book(0.3, 0.9, -1.2)
    reply = ask(start=x0, end=x0, F=F, handles=np.arange(3), targets=rigid(x0, SPIN, SHIFT)[:3])
    if books:
        close(f"{program}: a book moves with a page", reply.get("out.frame", []), rigid(x0, SPIN, SHIFT), STILL)
    else:
        check(f"{program}: a book is unsupported", reply["status"] == "unsupported")


def run():
    with Oracle("shape_halfway_libigl", "shape.halfway") as oracle:
        check_halfway("shape_halfway_libigl", oracle.request, rest=1e-5)
