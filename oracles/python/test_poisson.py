"""Closed forms for the oracles of shape.poisson_factor and shape.poisson_solve: Laplacians of paths and boxes, whose solutions are parabolas and
sines. Run by test_oracles.py, and for the C++ oracles by ../cpp/test_wire.py.
"""

import numpy as np

from checking import Oracle, check, close


def lower(A, rng):
    """The lower triangle of a matrix as rows, cols and values, in any order."""
    rows, cols = np.nonzero(np.tril(A))
    order = rng.permutation(len(rows))
    return {"rows": rows[order], "cols": cols[order], "values": A[rows, cols][order].astype(float)}


def path(n):
    """The Laplacian of n points on a line, with a point of value 0 at either end."""
    return 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)


def box(n):
    """The Laplacian of n^3 points in a box that is 0 outside, and its eigenvectors of frequency (i,j,k) as functions of those."""
    one, L = np.eye(n), path(n)
    A = np.kron(np.kron(L, one), one) + np.kron(np.kron(one, L), one) + np.kron(np.kron(one, one), L)
    sine = lambda i: np.sin(np.pi * i * np.arange(1, n + 1) / (n + 1))
    mode = lambda i, j, k: np.kron(np.kron(sine(i), sine(j)), sine(k))
    value = lambda *ijk: sum(2 - 2 * np.cos(np.pi * i / (n + 1)) for i in ijk)
    return A, mode, value


def check_poisson(program, ask, rng):
    """`ask` (stage, rows, cols, values, b) gives a reply."""

    def refused(name, **inputs):
        for stage in ("shape.poisson_factor", "shape.poisson_solve"):
            reply = ask(stage, **inputs)
            check(f"{program}: {stage[14:]}: {name}", reply["status"] == "error" and "out.x" not in reply)

    n = 400
    i = np.arange(1.0, n + 1)
    parabola = i * (n + 1 - i) / 2
    load = np.column_stack([np.ones(n), -3 * np.ones(n), np.eye(n)[n // 2]])
    tent = np.minimum(i * (n - n // 2), (n // 2 + 1) * (n + 1 - i)) / (n + 1)
    A, mode, value = box(12)
    modes = [(1, 1, 1), (2, 1, 3), (12, 5, 1)]
    waves = np.column_stack([mode(*ijk) for ijk in modes])
    loads = waves * [value(*ijk) for ijk in modes]
    apart = np.diag([4.0, 1, 0.25, 2])
    for stage in ("shape.poisson_factor", "shape.poisson_solve"):

        def solve(name, A, b, x, tolerance=1e-11):
            reply = ask(stage, **lower(A, rng), b=b)
            check(f"{program}: {stage[14:]}: {name} is answered", reply["status"] == "ok", reply.get("message", ""))
            close(f"{program}: {stage[14:]}: {name}", reply["out.x"], x, tolerance)

        solve("a path's parabolas and tent", path(n), load, np.column_stack([parabola, -3 * parabola, tent]), 1e-7)  # of 2e4, condition 7e4
        solve("a box's sines", A, loads, waves)
        solve("unknowns that nothing joins", apart, np.ones((4, 3)), np.tile([[0.25], [1], [4], [0.5]], 3))
        solve("one unknown", np.array([[4.0]]), np.array([[2.0, -4, 0]]), [[0.5, -1, 0]])
        solve("zero stays zero", path(5), np.zeros((5, 3)), np.zeros((5, 3)))
    small = {"b": np.ones((2, 3))} | lower(path(2), rng)
    refused("a saddle", **(small | lower(np.array([[1.0, 2], [2, 1]]), rng)))
    refused("an entry above the diagonal", **(small | {"rows": np.array([0, 1, 0]), "cols": np.array([0, 1, 1])}))
    refused("an entry without its row", **(small | {"rows": np.array([0, 1, 2])}))
    refused("two right sides", **(small | {"b": np.ones((2, 2))}))
    refused("not a number", **(small | {"values": np.full(3, np.nan)}))


def run(rng):
    with Oracle("shape_poisson_scipy", "shape.poisson_factor") as oracle:
        check_poisson("shape_poisson_scipy", lambda stage, **inputs: oracle.request(stage=stage, samples=2, batch=2, **inputs), rng)
