"""signal.insert_knots by numpy, all knots at once and no Boehm: control point i of a cubic spline is the blossom (polar form) of any of its
pieces that touch it at knots i+1, i+2, i+3 (Ramshaw 1989), so the new control points are blossoms of the old curve at three new knots each. The
values are blossoms of the new curve at three times the same parameter.
"""

import platform

import numpy as np

from signal_insert_knots_scipy import check
from wire import Unsupported, serve


def blossom(knots, control, piece, arguments):
    """Of the pieces [knots[j], knots[j+1]], j in `piece` (N), at `arguments` (N,3): de Boor's algorithm with an argument a level."""
    index = piece[:, None] + np.arange(-3, 1)
    points = control[index]
    for level, x in enumerate(arguments.T, start=1):
        low, high = knots[index[:, level:]], knots[index[:, level:] + 4 - level]
        ratio = ((x[:, None] - low) / (high - low))[..., None]
        points = (1 - ratio) * points[:, :-1] + ratio * points[:, 1:]
    return points[:, 0]


def pieces(knots, x):
    """The piece of each parameter, the last at the end of J."""
    k = len(knots) - 4
    last = np.searchsorted(knots, knots[k], side="left") - 1
    return np.clip(np.searchsorted(knots, x, side="right") - 1, 3, last)


def insertion(knots, control, insert):
    merged = np.sort(np.concatenate([knots, insert]), kind="stable")
    count = len(control) + len(insert)
    starts = np.arange(3, count)
    starts = starts[merged[starts] < merged[starts + 1]]  # the pieces of the new curve
    i = np.arange(count)
    piece = starts[np.minimum(np.searchsorted(starts, i), len(starts) - 1)]  # the first at or after i, which lies within the support of i
    return merged, blossom(knots, control, pieces(knots, merged[piece]), merged[i[:, None] + [1, 2, 3]])


def prepare(stage, inputs):
    if stage != "signal.insert_knots":
        raise Unsupported(f"no stage {stage} here")
    control, u, insert, query = (inputs[name] for name in ("control", "u", "insert", "query"))
    check(control, u, insert, query)
    knots = np.concatenate([u[:1], u, u[-1:]])

    def call():
        merged, moved = insertion(knots, control, insert)
        values = blossom(merged, moved, pieces(merged, query), np.repeat(query[:, None], 3, axis=1))
        return {"u": merged[1:-1], "control": moved, "values": values}

    return call


if __name__ == "__main__":
    serve(f"numpy {np.__version__}, Python {platform.python_version()}", prepare)
