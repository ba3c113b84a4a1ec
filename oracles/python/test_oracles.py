"""Tests the oracles of this folder through the wire protocol, against closed forms. Run it with the interpreter of the virtual environment:
one line a check, exit code 1 if any fails.
"""

import itertools
import sys
import tempfile
from pathlib import Path

import numpy as np

import test_edits
import test_halfway
import test_poisson
import test_shapes
from checking import Oracle, check, close, failures


def phi(points, sites):
    r = np.linalg.norm(points[:, None] - sites, axis=2)
    return np.where(r > 0, r**2 * np.log(np.where(r > 0, r, 1)), 0)


def evaluate(g, sites, points):
    return g[0] + phi(points, sites) @ g[1:-2] + points @ g[-2:]


def test_parameters():
    with Oracle("signal_parameters_numpy", "signal.parameters") as oracle:
        P = np.array([[0.0, 0], [1, 0], [1, 4], [1, 4], [4, 8]])
        close("parameters: roots of 1, 4, 0, 5", oracle.run(P=P)["t"], [0, 1, 3, 3, 3 + np.sqrt(5)])


def test_knots():
    with Oracle("signal_knots_numpy", "signal.knots") as oracle:
        t = np.cumsum([0.0, 1, 3, 2, 5, 4, 1, 2])
        for rule in ("literal", "symmetric"):
            u = oracle.run(t=t, k=10, rule=rule)["u"]
            close(f"knots: {rule} k = n+2 interpolates", u, [0, 0, *t, t[-1], t[-1]], 0)
            close(f"knots: {rule} k = 4 is one span", oracle.run(t=t, k=4, rule=rule)["u"], [0] * 3 + [t[-1]] * 3, 0)
        interior = {(6, "literal"): [(t[1] + 2 * t[2]) / 3, (2 * t[4] + t[5]) / 3], (5, "literal"): [t[3]]}
        interior |= {(6, "symmetric"): [(2 * t[2] + t[3]) / 3, (t[4] + 2 * t[5]) / 3], (5, "symmetric"): [(t[3] + t[4]) / 2]}
        for (k, rule), expected in interior.items():
            close(f"knots: {rule} k = {k} by hand", oracle.run(t=t, k=k, rule=rule)["u"][3:-3], expected, 1e-14)
        check("knots: k = 3", oracle.status(t=t, k=3, rule="literal") == "unsupported")
        check("knots: unknown rule", oracle.status(t=t, k=5, rule="uniform") == "unsupported")


def test_rho(rng):
    with Oracle("signal_rho_scipy", "signal.rho") as oracle:
        line = oracle.run(t=2.5 * np.arange(6.0), query=np.linspace(1, 6, 11))
        close("rho: a line", line["values"], np.linspace(0, 12.5, 11))
        close("rho: a line's slopes", line["slopes"], np.full(6, 2.5))
        held = oracle.run(t=np.array([0.0, 1, 1, 2]), query=np.linspace(2, 3, 5))
        close("rho: a held pose's slopes", held["slopes"], [1, 0, 0, 1])
        stop = oracle.run(t=np.array([0.0, 7, 8, 8, 9]), query=np.ones(1))["slopes"]  # Delta = 7, 1, 0, 1
        close("rho: a stop's slopes vanish before the others are limited", stop, [7, 3, 0, 0, 1])
        close("rho: a held pose stays", held["values"], np.ones(5))
        limited = oracle.run(t=np.array([0.0, 1, 6, 7]), query=np.array([1.0, 2, 3, 4]))  # Delta = 1, 5, 1
        close("rho: limited to the circle of 3", limited["slopes"], 3 / np.hypot(1, 3) * np.array([1, 3, 3, 1]))
        close("rho: rho(i) = t_i", limited["values"], [0, 1, 6, 7])
        sweep = oracle.run(t=np.array([0.0, 1, 31, 32]), query=np.ones(1))["slopes"]  # Delta = 1, 30, 1
        close("rho: both ends limited", sweep, 3 / np.hypot(1, 15.5) * np.array([1, 15.5, 15.5, 1]))
        twice = oracle.run(t=np.array([0.0, 10, 11, 12, 22]), query=np.ones(1))["slopes"]  # Delta = 10, 1, 1, 10
        first = 3 / np.hypot(5.5, 1)
        second = 3 / np.hypot(first, 5.5)
        close("rho: one sweep from left to right", twice, [10, 5.5 * first, first * second, 5.5 * second, 10])
        t = np.cumsum(rng.exponential(size=80) ** 4)
        q = np.linspace(1, 80, 4001)
        check("rho: monotone", np.diff(oracle.run(t=t, query=q)["values"]).min() >= -1e-12 * t[-1])
        check("rho: one frame", oracle.status(t=np.zeros(1), query=np.ones(1)) == "unsupported")
        check("rho: t decreases", oracle.status(t=np.array([0.0, 2, 1]), query=np.ones(1)) == "error")


def test_rbf(rng):
    P, query = 3 * rng.normal(size=(30, 2)) + [5, -2], rng.normal(size=(9, 2))
    affine, offset = rng.normal(size=(2, 4)), rng.normal(size=4)
    X, every = rng.normal(size=(30, 4)), rng.permutation(30)
    for program in ("signal_rbf_scipy", "signal_rbf_numpy"):
        with Oracle(program, "signal.rbf") as oracle:
            plane = oracle.run(P=P, X=offset + P @ affine, sites=every, query=query)
            exact = np.vstack([offset, np.zeros((30, 4)), affine])
            close(f"{program}: an affine map's coefficients", plane["g"], exact, 1e-10)
            close(f"{program}: an affine map elsewhere", plane["query_values"], offset + query @ affine, 1e-10)
            fit = oracle.run(P=P, X=X, sites=every, query=query)
            close(f"{program}: l = n interpolates", fit["values"], X, 1e-10)
            close(f"{program}: g in the units of P", evaluate(fit["g"], P[every], query), fit["query_values"], 1e-9)
            conditions = np.column_stack([np.ones(30), P[every]]).T @ fit["g"][1:-2]
            close(f"{program}: side conditions", conditions, np.zeros((3, 4)), 1e-10)
            far = oracle.run(P=40 * P + 100, X=X, sites=every, query=40 * query + 100)
            close(f"{program}: scale does not matter", far["query_values"], fit["query_values"], 1e-8)
            if program == "signal_rbf_scipy":
                check("signal_rbf_scipy: l < n", oracle.status(P=P, X=X, sites=every[:9], query=query) == "unsupported")
                continue
            few = every[:12]
            T = np.column_stack([np.ones(12), P[few]])
            true = np.vstack([offset, np.linalg.qr(T, mode="complete").Q[:, 3:] @ rng.normal(size=(9, 4)), affine])
            found = oracle.run(P=P, X=evaluate(true, P[few], P), sites=few, query=query)
            close(f"{program}: l < n recovers a spline", found["g"], true, 1e-9)
            low = oracle.run(P=P, X=X, sites=few[:3], query=query)
            A = np.column_stack([np.ones(30), P])
            close(f"{program}: l = 3 is the affine fit", low["values"], A @ np.linalg.solve(A.T @ A, A.T @ X), 1e-10)
            residual = X - oracle.run(P=P, X=X, sites=few, query=query)["values"]
            basis = np.column_stack([A, phi(P, P[few]) @ np.linalg.qr(T, mode="complete").Q[:, 3:]])
            close(f"{program}: the residual is orthogonal to the space", basis.T @ residual, np.zeros((12, 4)), 1e-9)
            line = np.outer(np.arange(8.0), [1, 2])
            flat = oracle.run(P=line, X=X[:8], sites=np.arange(8), query=line)
            close(f"{program}: collinear sites interpolate", flat["values"], X[:8], 1e-10)
            check(f"{program}: two sites", oracle.status(P=P, X=X, sites=few[:2], query=query) == "unsupported")


def test_sites(rng):
    n = 40
    P = np.cumsum(rng.normal(size=(n, 2)), axis=0)
    X = np.column_stack([P, rng.normal(size=(n, 5))])
    centred = X - X.mean(axis=0)
    off_plane = centred @ np.linalg.eigh(centred.T @ centred)[1][:, :-2]
    A = np.column_stack([np.ones(n), P])
    answers = []
    for program in ("signal_sites_numpy", "signal_sites_numpy_incremental"):
        with Oracle(program, "signal.sites") as oracle, Oracle("signal_rbf_numpy", "signal.rbf") as rbf:
            answer = oracle.run(P=P, X=X, count=n)
            answers.append(answer)
            order, errors = answer["order"], answer["errors"]
            farthest = np.argsort(-np.square(off_plane).sum(axis=1))[:4]
            close(f"{program}: first four", order[:4], farthest, 0)
            check(f"{program}: a permutation", sorted(order) == list(range(n)))
            check(f"{program}: errors decrease to 0", np.all(np.diff(errors) <= 1e-9) and errors[-1] == 0, f"{errors[0]:.3g}")
            close(f"{program}: affine error", errors[0], np.square(X - A @ np.linalg.pinv(A) @ X).sum(), 1e-9)
            for l in (4, 11, 30):
                distance = np.linalg.norm(X - rbf.run(P=P, X=X, sites=order[:l], query=P)["values"], axis=1)
                close(f"{program}: error with {l} sites", errors[l - 3], np.square(distance).sum(), 1e-9)
                distance[order[:l]] = -1
                check(f"{program}: site {l} is the worst frame", order[l] == np.argmax(distance))
            head = oracle.run(P=P, X=X, count=9)
            close(f"{program}: a prefix", head["order"], order[:9], 0)
            plane = oracle.run(P=P, X=P @ rng.normal(size=(2, 2)), count=12)
            close(f"{program}: ties go to the lower index", plane["order"], np.arange(12), 0)
            close(f"{program}: an affine map leaves no error", plane["errors"], np.zeros(10), 0)
            line = oracle.run(P=np.outer(np.arange(9.0), [1, 2]), X=rng.normal(size=(9, 3)), count=9)
            check(f"{program}: collinear poses interpolate", line["errors"][-1] == 0)
            double = oracle.run(P=np.tile(P[:8], (2, 1)), X=X[:16], count=16)
            between = np.square(X[:8] - X[8:16]).sum() / 2
            close(f"{program}: coincident poses leave half their squared distance", double["errors"][-1], between, 1e-9)
            locations = [len(set(double["order"][:l] % 8)) for l in range(3, 17)]
            still = np.diff(locations) == 0
            close(f"{program}: a coincident site changes nothing", np.diff(double["errors"])[still], np.zeros(still.sum()), 1e-9)
            check(f"{program}: count = 3", oracle.status(P=P, X=X, count=3) == "unsupported")
    close("sites: both orders", answers[0]["order"], answers[1]["order"], 0)
    close("sites: both errors", answers[0]["errors"], answers[1]["errors"], 1e-9)


def test_spline(rng):
    with Oracle("signal_spline_scipy", "signal.spline") as oracle:
        cubic = lambda x: np.column_stack([1 - x + x**3 / 9, 2 * x**2 - x**3 / 7])
        t, q = np.sort(rng.uniform(0, 6, 20)), np.linspace(0, 6, 31)
        t[[0, -1]] = 0, 6
        clamped = np.array([0.0, 0, 0, 1, 2.5, 4, 6, 6, 6])
        fit = oracle.run(t=t, u=clamped, P=cubic(t), query=q)
        close("spline: a cubic, k < n", fit["query_values"], cubic(q), 1e-10)
        close("spline: its values at t", fit["values"], cubic(t), 1e-10)
        greville = np.convolve(np.concatenate([clamped[:1], clamped, clamped[-1:]])[1:-1], np.ones(3) / 3, "valid")
        line = oracle.run(t=t, u=clamped, P=np.column_stack([t, -t]), query=q)["control"]
        close("spline: a line's control points are Greville's", line, np.column_stack([greville, -greville]), 1e-10)
        uniform = oracle.run(t=2 + t / 2, u=np.arange(8.0), P=cubic(t), query=2 + q / 2)
        close("spline: uniform knots, J = [u_2, u_{k-1}]", uniform["query_values"], cubic(q), 1e-9)

        three, hat, half = np.arange(3.0), np.array([[0.0, 0], [1, 2], [0, 0]]), np.array([0.5, 1.5])
        natural = oracle.run(t=three, u=np.array([0.0, 0, 0, 1, 2, 2, 2]), P=hat, query=half)
        close("spline: natural at k = n+2", natural["query_values"], [[0.6875, 1.375]] * 2)
        one_span = np.array([0.0, 0, 0, 2, 2, 2])
        parabola = oracle.run(t=three, u=one_span, P=hat, query=half)
        close("spline: smoothest cubic at k = n+1", parabola["query_values"], [[0.75, 1.5]] * 2)
        straight = oracle.run(t=three[::2], u=one_span, P=hat[:2], query=half)
        close("spline: a straight line at n = 2", straight["query_values"], [[0.25, 0.5], [0.75, 1.5]])
        finer = oracle.run(t=three, u=np.array([0.0, 0, 0, 0.5, 1, 1.5, 2, 2, 2]), P=hat, query=half)
        close("spline: the natural spline among more knots", finer["query_values"], [[0.6875, 1.375]] * 2)
        spread = np.array([[-1.0, 0], [1, 0], [1, 2], [3, 0], [-3, 0]])
        repeated = oracle.run(t=np.array([0.0, 0, 1, 2, 2]), u=one_span, P=spread, query=half)
        close("spline: repeated t, means, then smoothest", repeated["query_values"], [[0.75, 1.5]] * 2)
        held = np.repeat(t, 2)
        pairs = cubic(held) + np.tile([[1.0], [-1]], (20, 1))
        paired = oracle.run(t=held, u=clamped, P=pairs, query=q)
        close("spline: repeated t, k < n", paired["query_values"], cubic(q), 1e-10)
        crowded = np.array([0.0, 0, 0, 0.2, 0.4, 0.6, 0.8, 9, 9, 9])
        deficient = oracle.run(t=np.arange(10.0), u=crowded, P=cubic(np.arange(10.0)), query=q)
        close("spline: least norm where no t is seen", deficient["control"][1:4], np.zeros((3, 2)), 1e-10)
        check("spline: t outside J", oracle.status(t=t, u=clamped / 2, P=cubic(t), query=q) == "error")


def test_psi():
    with Oracle("signal_psi_scipy", "signal.psi") as oracle:
        sites = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
        g = np.zeros((7, 2))
        g[-2:] = np.eye(2)
        h0, H = np.array([1.0, 2, 3]), np.array([[1.0, 0, 0], [0, 0, 2]])
        ramp = np.column_stack([np.arange(4.0), np.zeros(4)])
        tau = np.linspace(1, 4, 13)
        given = dict(h0=h0, H=H, sites=sites, control=ramp, u=np.array([0.0, 0, 0, 3, 3, 3]), t=np.arange(4.0), tau=tau)
        close("psi: a straight motion", oracle.run(g=g, **given)["Z"], h0 + np.outer(tau - 1, [1, 0, 0]))
        steep = oracle.run(g=g, **(given | {"t": np.array([0.0, 0.1, 2.9, 3]), "tau": np.array([1.5])}))["Z"]
        ends = 0.3 / np.hypot(0.1, 1.45) * np.array([0.1, 1.45])  # slopes limited to three secants of 0.1
        close("psi: rho is limited", steep, [h0 + [(0.1 + (ends[0] - ends[1]) / 4) / 2, 0, 0]])
        g[1:5, 1] = [1, -1, -1, 1]  # the side conditions hold: a square's saddle
        found = oracle.run(g=g, **given)["Z"]
        p = np.column_stack([tau - 1, np.zeros(13)])
        close("psi: a saddle", found, h0 + (p + phi(p, sites) @ g[1:5]) @ H)
        held = oracle.run(g=g, **(given | {"t": np.array([0.0, 1, 1, 3])}))["Z"]
        close("psi: a held pose", held[4:9], np.tile(held[4], (5, 1)))
        still = oracle.run(g=np.zeros((7, 0)), **(given | {"H": np.zeros((0, 3))}))["Z"]
        close("psi: m = 0", still, np.tile(h0, (13, 1)))
        check("psi: wrong shapes", oracle.status(g=g[1:], **given) == "error")


CUBE = np.array(list(itertools.product([0.0, 1], repeat=3)))
CUBE_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def write_obj(path, V, F):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in V.tolist()] + [f"f {a} {b} {c}" for a, b, c in (F + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def test_read():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        boxes = [
            (CUBE, CUBE_FACES, [8, 12, 0], [6, 1, 0, 0, 0, 1, 1, 1]),
            (2 * CUBE - 5, CUBE_FACES[:, ::-1], [8, 12, 0], [24, -8, -5, -5, -5, -3, -3, -3]),
            (CUBE, CUBE_FACES[2:], [8, 10, 4], [5, 1, 0, 0, 0, 1, 1, 1]),
            (np.vstack([CUBE, [[9, 9, 9]], CUBE[:1]]), CUBE_FACES, [10, 12, 0], [6, 1, 0, 0, 0, 9, 9, 9]),
        ]
        paths = [write_obj(folder / f"{i}.obj", V, F) for i, (V, F, _, _) in enumerate(boxes)]
        textured = folder / "textured.obj"
        textured.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n")
        for program in ("sequence_read_trimesh", "sequence_read_pymeshlab"):
            with Oracle(program, "sequence.read") as oracle:
                found = oracle.run(paths="\n".join(paths))
                close(f"{program}: counts of a closed, turned, open and unmerged cube", found["counts"], [b[2] for b in boxes], 0)
                close(f"{program}: measures of them", found["measures"], [b[3] for b in boxes], 1e-12)
                check(f"{program}: no such file", oracle.status(paths=str(folder / "none.obj")) == "error")
                expected = "unsupported" if program.endswith("trimesh") else "ok"
                check(f"{program}: texture coordinates", oracle.status(paths=str(textured)) == expected)


def test_distance(rng):
    for program, tolerance in (("sequence_distance_libigl", 1e-14), ("sequence_distance_pymeshlab", 3e-7)):
        with Oracle(program, "sequence.distance") as oracle:
            around = 2 * CUBE - 0.5  # every corner sqrt(3)/2 from the cube
            shifted = CUBE + [0.25, 0, 0]  # four corners 0.25 out; the other four lie on faces of B
            one_far = np.vstack([CUBE[:-1], [[1, 1, 4]]])
            inside = CUBE / 2 + 0.25  # every corner 0.25 inside
            A, B = np.stack([around, CUBE, shifted, one_far, inside]), np.stack([CUBE] * 5)
            found = oracle.run(A=A, B=B, F=CUBE_FACES)
            close(f"{program}: hausdorff", found["hausdorff"], [np.sqrt(3) / 2, 0, 0.25, 3, 0.25], tolerance)
            close(f"{program}: mean", found["mean"], [np.sqrt(3) / 2, 0, 0.125, 0.375, 0.25], tolerance)
            turned = np.linalg.qr(rng.normal(size=(3, 3))).Q
            far = oracle.run(A=10 * A @ turned, B=10 * B @ turned, F=CUBE_FACES)
            close(f"{program}: turned and scaled", far["mean"], 10 * found["mean"], 10 * tolerance)
            check(f"{program}: a face without its vertex", oracle.status(A=A, B=B, F=CUBE_FACES + 1) == "error")


if __name__ == "__main__":
    test_parameters()
    test_knots()
    test_rho(np.random.default_rng(1))
    test_rbf(np.random.default_rng(2))
    test_sites(np.random.default_rng(3))
    test_spline(np.random.default_rng(4))
    test_psi()
    test_read()
    test_distance(np.random.default_rng(5))
    test_shapes.run(np.random.default_rng(6))
    test_poisson.run(np.random.default_rng(7))
    test_halfway.run()
    test_edits.run(np.random.default_rng(8))
    print(f"{len(failures)} failed" if failures else "all passed")
    sys.exit(bool(failures))
