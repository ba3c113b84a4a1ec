"""Closed forms for the oracles of signal.insert_knots and signal.transfer. Run by test_oracles.py."""

import numpy as np

from checking import Oracle, check, close


def products(u, a):
    """Control points of (x^3, (x-a)^3 where x > a else 0) over the paper's knots u, a among them: products of three knots (Marsden's identity)."""
    three = np.stack([u[:-2], u[1:-1], u[2:]], axis=1)
    return np.column_stack([three.prod(axis=1), np.where(three[:, 0] >= a, (three - a).prod(axis=1), 0)])


def power(x, a):
    return np.column_stack([x**3, np.maximum(x - a, 0) ** 3])


def test_insert_knots(rng):
    for program in ("signal_insert_knots_scipy", "signal_insert_knots_numpy"):
        with Oracle(program, "signal.insert_knots") as oracle:
            bezier = np.array([[0.0, 0], [0, 4], [4, 4], [8, 0]])
            u, half = np.array([0.0, 0, 0, 1, 1, 1]), np.array([0.5])
            split = [[0, 0], [0, 2], [1, 3], [2.5, 3], [4, 3], [6, 2], [8, 0]]  # de Casteljau's
            found = oracle.run(control=bezier, u=u, insert=np.full(3, 0.5), query=half)
            close(f"{program}: a Bezier curve split in its middle", found["control"], split)
            close(f"{program}: its middle", found["values"], [[2.5, 3]])
            close(f"{program}: its knots", found["u"], [0, 0, 0, 0.5, 0.5, 0.5, 1, 1, 1], 0)

            clamped = np.array([0.0, 0, 0, 1, 2.5, 2.5, 4, 6, 6, 6])
            for name, u, insert in (
                ("clamped", clamped, np.array([3.0, 0.5, 2.5, 5, 1, 1, 0.5])),  # unordered, repeated, and on knots
                ("uniform", np.arange(10.0), np.array([6.5, 2.25, 6.9, 4, 4, 2.1])),
                ("half clamped", np.array([0.0, 0, 0, 1, 3, 4, 5, 6, 7]), np.array([0.1, 4.9, 4])),
            ):
                a = u[4]
                query = np.linspace(u[2], u[-3], 41)
                found = oracle.run(control=products(u, a), u=u, insert=insert, query=query)
                merged = np.sort(np.concatenate([u, insert]))
                close(f"{program}: {name} knots are merged", found["u"], merged, 0)
                close(f"{program}: {name}: control points are products of new knots", found["control"], products(merged, a), 1e-10)
                close(f"{program}: {name}: the curve stays", found["values"], power(query, a), 1e-10)
                control = rng.normal(size=(len(u) - 2, 2))
                before = oracle.run(control=control, u=u, insert=np.empty(0), query=query)
                close(f"{program}: {name}: no knot changes nothing", before["control"], control, 1e-14)
                after = oracle.run(control=control, u=u, insert=insert, query=query)
                close(f"{program}: {name}: any curve stays", after["values"], before["values"])
            good = {"control": products(clamped, 1), "u": clamped, "query": half}
            check(f"{program}: a fourth of a kind", oracle.status(**good, insert=np.full(2, 2.5)) == "error")
            check(f"{program}: at the end of J", oracle.status(**good, insert=np.array([6.0])) == "error")
            check(f"{program}: a query outside J", oracle.status(**good | {"query": np.array([6.5])}, insert=half) == "error")
            check(f"{program}: a control point too many", oracle.status(**good | {"control": np.zeros((9, 2))}, insert=half) == "error")


def test_transfer(rng):
    Q, R = rng.normal(size=(5, 40)) + 3, rng.normal(size=(5, 17))
    X = rng.normal(size=(9, 4))
    exact = Q[0] + X @ (Q[1:] - Q[0])
    beside = np.linalg.qr((Q[1:] - Q[0]).T, mode="complete").Q[:, 4:].T  # orthogonal to all examples
    for program in ("signal_transfer_numpy", "signal_transfer_numpy normal", "signal_transfer_scipy"):
        with Oracle(program, "signal.transfer") as oracle:
            found = oracle.run(Z=exact, Q=Q, R=R)
            close(f"{program}: coordinates of combinations", found["X"], X)
            close(f"{program}: the combinations of the targets", found["W"], R[0] + X @ (R[1:] - R[0]))
            off = oracle.run(Z=exact + rng.normal(size=(9, 36)) @ beside, Q=Q, R=R)
            close(f"{program}: what no example has is left out", off["X"], X)
            examples = oracle.run(Z=Q, Q=Q, R=R)
            close(f"{program}: an example becomes its target", examples["W"], R)
            two = oracle.run(Z=np.array([[3.0, 5, 1]]), Q=np.array([[1.0, 1, 1], [2, 3, 1]]), R=np.array([[0.0], [10]]))
            close(f"{program}: one example, by hand", two["W"], [[20]])  # (2,4,0).(1,2,0) / 5 = 2
            dependent = {"Z": exact, "Q": Q[[0, 1, 2, 3, 4, 4]], "R": R[[0, 1, 2, 3, 4, 4]]}
            if program.endswith("normal"):
                check(f"{program}: dependent examples", oracle.status(**dependent) == "unsupported")
                check(f"{program}: more examples than numbers", oracle.status(Z=exact[:, :2], Q=Q[:, :2], R=R) == "unsupported")
            else:
                shared = np.column_stack([X[:, :3], X[:, 3] / 2, X[:, 3] / 2])
                close(f"{program}: the least norm shares among equals", oracle.run(**dependent)["X"], shared)
                still = oracle.run(Z=exact, Q=Q[[0, 0, 0]], R=R[[0, 1, 2]])
                close(f"{program}: examples at rest say nothing", still["X"], np.zeros((9, 2)))
                H = Q[1:, :2] - Q[0, :2]
                wide = oracle.run(Z=exact[:, :2], Q=Q[:, :2], R=R)["X"]
                close(f"{program}: more examples than numbers: exact", wide @ H, exact[:, :2] - Q[0, :2])
                close(f"{program}: and of least norm", wide @ np.linalg.svd(H.T).Vh[2:].T, np.zeros((9, 2)))
            check(f"{program}: no example", oracle.status(Z=exact, Q=Q[:1], R=R[:1]) == "error")
            check(f"{program}: an example without its target", oracle.status(Z=exact, Q=Q, R=R[1:]) == "error")


def run(rng):
    test_insert_knots(rng)
    test_transfer(rng)
