"""Closed forms for the oracles of signal.layout. Run by test_oracles.py."""

import numpy as np

from checking import Oracle, check, close


def distances(P):
    return np.linalg.norm(P[:, None] - P[None], axis=2)


def mixed(D, gamma, w):
    """delta from the distances and the lengths of paths."""
    delta = np.sqrt((1 - w) * D**2 + w * gamma**2)
    return delta * np.linalg.norm(D) / np.linalg.norm(delta)


def slope(P, delta):
    """The greatest derivative of the stress by a point's position, over the sum of that point's dissimilarities."""
    d = distances(P)
    ratio = np.divide(delta, d, out=np.ones_like(d), where=d > 0)
    pull = 2 * np.einsum("ij,ijc->ic", 1 - ratio, P[:, None] - P[None])
    return np.linalg.norm(pull, axis=1).max() / delta.sum(axis=1).max()


def stress(P, delta):
    return ((distances(P) - delta) ** 2).sum() / 2


def classical(delta):
    squares = delta**2
    eigenvalues, vectors = np.linalg.eigh(-(squares - squares.mean(axis=0) - squares.mean(axis=1)[:, None] + squares.mean()) / 2)
    return vectors[:, -2:] * np.sqrt(eigenvalues[-2:].clip(0))


def check_paths(program, layout):
    """Lengths of paths by hand, at w = 1 and mixed."""
    line = np.outer([0.0, 1, 5, 14], [0.6, 0, 0.8])  # steps 1, 4, 9 become 1, 2, 3 times the same
    gamma = distances(np.array([[0.0], [1], [3], [6]]))
    D = distances(line)
    for w in (0.0, 0.25, 0.5, 1.0):
        scaled = np.sqrt(14 / 3) * gamma
        close(f"{program}: uneven steps on a line, w = {w}", layout(line, w)["delta"], mixed(D, scaled, w))
    found = layout(line, 1.0)
    close(f"{program}: a path that nothing shortens is laid out straight", distances(found["P"]), found["delta"], 1e-10)

    there = np.array([0.0, 1, 2, 1.5, 0.5])[:, None] * [3.0, 4] + 7  # the way back falls between the poses of the way there
    root = np.sqrt(0.875)  # every joint is this times the distance, save the step back of half a length, which its halves undercut
    D = distances(there)
    for w in (0.5, 1.0):
        close(f"{program}: there and back, w = {w}", layout(there, w)["delta"], mixed(D, root * D, w))

    for h, name in ((0.0499, "on a step"), (0.0501, "beside a step")):
        X = np.array([[0.0, 0], [1, 0], [2, 5], [0.5, h]])
        D = distances(X)
        s = np.array([D[0, 1], D[1, 2], D[2, 3]])
        a = np.sqrt(s * s.mean())
        gamma = distances(np.concatenate([[0], np.cumsum(a)])[:, None])
        if h < 0.05:
            gamma[0, 3] = gamma[3, 0] = gamma[1, 3] = gamma[3, 1] = a[0] / 2
            gamma[0, 2] = gamma[2, 0] = min(a[0] + a[1], a[0] / 2 + a[2])
            gamma[1, 2] = gamma[2, 1] = min(a[1], a[0] / 2 + a[2])
            gamma[2, 3] = gamma[3, 2] = min(a[2], a[1] + a[0] / 2)
        close(f"{program}: a frame {name}", layout(X, 1.0)["delta"], mixed(D, gamma, 1.0))

    for h, joined in ((0.02, True), (0.04, False)):  # the frame's own step is 0.5 - h, a twentieth of it 0.024 and 0.023
        X = np.array([[0.0, 0], [1, 0], [2, 5], [0.5, 0.5], [0.5, h]])
        found = layout(X, 1.0)["delta"]
        check(f"{program}: its own steps count: {joined}", (found[0, 4] < found[0, 1]) == joined)
    past = np.array([[0.0, 0], [1, 0], [2, 5], [1.03, 0.03]])  # 0.0424 from the end of step 0, u = 1; 0.0235 from step 1 beyond its start
    close(f"{program}: beyond the end of a step", layout(past, 1.0)["delta"][1, 3], 0, 1e-12)

    held = np.array([[0.0, 0], [0, 0], [3, 0], [3, 4], [0, 0]])  # steps 0, 3, 4, 5, of mean 3
    to_3, to_3_4, back = np.sqrt(3.0 * np.array([3, 4, 5]))
    gamma = np.array([[0, to_3, back], [to_3, 0, to_3_4], [back, to_3_4, 0]])[np.ix_([0, 0, 1, 2, 0], [0, 0, 1, 2, 0])]
    close(f"{program}: a held pose, come back to", layout(held, 0.5)["delta"], mixed(distances(held), gamma, 0.5))
    nearly = held + [[0, 0], [1e-9, 0], [0, 0], [0, 0], [0, 1e-9]]
    close(f"{program}: nearly held", layout(nearly, 0.5)["delta"], layout(held, 0.5)["delta"], 1e-8)


def check_scaling(program, layout, rng, vanishing):
    plane = np.cumsum(rng.normal(size=(15, 2)), axis=0) @ np.linalg.qr(rng.normal(size=(6, 6))).Q[:2]
    found = layout(plane, 0.0)
    close(f"{program}: w = 0 gives the distances", found["delta"], distances(plane))
    close(f"{program}: what is flat is laid out as it is", distances(found["P"]), distances(plane), 1e-10)
    angle = np.arange(30) * 2 * np.pi / 10.5  # 10.5 poses a turn: the third turn is the first again, the second lies between
    round_and_round = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(2 * angle), 0.2 * np.sin(3 * angle)])
    walk = np.cumsum(rng.normal(size=(40, 5)), axis=0)
    for name, X in (("turns", round_and_round), ("a walk", walk)):
        for w in (0.0, 0.5, 1.0):
            found = layout(X, w)
            steep = slope(found["P"], found["delta"])
            check(f"{program}: {name}, w = {w}: the gradient vanishes", steep < vanishing, f"{steep:.1e}")
            check(f"{program}: {name}, w = {w}: not above the start", stress(**found) <= stress(classical(found["delta"]), found["delta"]))
            close(f"{program}: {name}, w = {w}: the distances keep their sum of squares", np.linalg.norm(found["delta"]) / np.linalg.norm(distances(X)), 1)
            Q = np.linalg.qr(rng.normal(size=(X.shape[1], X.shape[1]))).Q
            turned = layout(3 * X @ Q + 5, w)
            close(f"{program}: {name}, w = {w}: turned and scaled", turned["delta"] / 3, found["delta"], 1e-10)
    turns = layout(round_and_round, 1.0)["delta"]
    close(f"{program}: the third turn is the first", turns[:9, 21:30].diagonal(), np.zeros(9), 1e-7)


def run(rng):
    for program, vanishing in (("signal_layout_numpy", 1e-12), ("signal_layout_sklearn", 1e-5)):
        with Oracle(program, "signal.layout") as oracle:
            layout = lambda X, w: oracle.run(X=X, weight=np.array([w]))
            check_paths(program, layout)
            check_scaling(program, layout, rng, vanishing)
            check(f"{program}: weight 2", oracle.status(X=np.eye(4), weight=np.array([2.0])) == "error")
            still = oracle.request(X=np.ones((5, 3)), weight=np.array([0.5]))
            if program.endswith("numpy"):
                close(f"{program}: one pose", still["out.P"], np.zeros((5, 2)))
                close(f"{program}: one pose's dissimilarities", still["out.delta"], np.zeros((5, 5)), 0)
            else:
                check(f"{program}: one pose", still["status"] == "unsupported")
