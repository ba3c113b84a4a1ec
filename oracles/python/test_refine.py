"""Closed forms for the oracle of signal.refine. Run by test_oracles.py."""

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.distance import cdist
from scipy.special import xlogy

from checking import Oracle, check, close

NAMES = ("control", "sites", "g", "H", "h0")


def curve(start, control):
    u = start["u"]
    return BSpline(np.concatenate([u[:1], u, u[-1:]]), control, 3)(start["t"])


def phi(p, s):
    r = cdist(p, s)
    return xlogy(r**2, r)


def error(start, control, sites, g, H, h0):
    """E by its formula."""
    p, l = curve(start, control), len(sites)
    X = g[0] + phi(p, sites) @ g[1 : l + 1] + p @ g[l + 1 :]
    return start["w"] @ np.square(start["Y"] - h0 - X @ H).sum(axis=1)


def closed_form(start, control, sites):
    """E of the best g, H and h0: what is left of the targets by the projection and by its leading eigenvectors."""
    p, root = curve(start, control), np.sqrt(start["w"])[:, None]
    Y = root * (start["Y"] - start["w"] @ start["Y"] / start["w"].sum())
    null = np.linalg.svd(np.vstack([np.ones(len(sites)), sites.T])).Vh[3:].T
    A = np.linalg.qr(root * np.column_stack([np.ones(len(p)), p, phi(p, sites) @ null])).Q
    leading = np.linalg.eigh((A.T @ Y) @ (A.T @ Y).T).eigenvectors[:, -len(start["H"]) :]
    return np.square(Y - A @ leading @ (leading.T @ A.T @ Y)).sum()


def slope(start, control, sites, of=("control", "sites"), step=1e-6):
    """The norm of the gradient of the closed form, by central differences, times the diagonal of the sites' box, over E."""
    points = {"control": control, "sites": sites}
    diagonal = np.linalg.norm(np.ptp(sites, axis=0))
    derivatives = []
    for name in of:
        for index in np.ndindex(points[name].shape):
            move = np.zeros(points[name].shape)
            move[index] = step * diagonal
            ends = [closed_form(start, **points | {name: points[name] + sign * move}) for sign in (1, -1)]
            derivatives.append((ends[0] - ends[1]) / (2 * step))
    return np.linalg.norm(derivatives) / closed_form(start, control, sites)


def waves(rng, n, k, l, m, r=9):
    """Smooth targets, and a start that knows the first two principal coordinates."""
    t = np.linspace(0, 1, n)
    Y = np.column_stack([f(2 * np.pi * j * t) / j**1.5 for j in range(1, 7) for f in (np.cos, np.sin)]) @ rng.normal(size=(12, r))
    Y = Y - Y.mean(axis=0)
    Y = Y @ np.linalg.svd(Y).Vh.T
    u = np.concatenate([np.zeros(2), np.linspace(0, 1, k - 2), np.ones(2)])
    sites = Y[np.linspace(0, n - 1, l + 1).astype(int)[:l], :2]
    B = BSpline.design_matrix(t, np.concatenate([u[:1], u, u[-1:]]), 3).toarray()
    g = np.vstack([np.zeros((l + 1, m)), np.eye(2, m)])
    given = {"Y": Y, "w": np.where(np.arange(n) % 2, 0.5, 1), "t": t, "u": u, "control": np.linalg.lstsq(B, Y[:, :2])[0], "sites": sites, "g": g}
    return given | {"H": np.eye(m, r), "h0": np.zeros(r), "iterations": 10000}


def check_answer(what, start, found):
    E = error(start, *(found[name] for name in NAMES))
    total = start["w"] @ np.square(start["Y"]).sum(axis=1)
    close(f"{what}: E by its formula", E / total, found["error"][0] / total, 1e-11)
    close(f"{what}: E by the closed form", closed_form(start, found["control"], found["sites"]) / total, E / total, 1e-11)
    check(f"{what}: below the start", E < closed_form(start, start["control"], start["sites"]), f"{E:.4g}")
    close(f"{what}: H is orthonormal", found["H"] @ found["H"].T, np.eye(len(found["H"])), 1e-12)
    s, kernels = found["sites"], found["g"][1:-2]
    moments = np.column_stack([np.ones(len(s)), s]).T @ kernels
    close(f"{what}: side conditions", moments / max(1, np.abs(kernels).max()), np.zeros(moments.shape), 1e-11)
    return E


def beside(rng, noise):
    """Targets near a signal of the same sizes, and a start beside it: a minimum with the sites apart is near."""
    start = waves(rng, 40, 8, 6, 3)
    null = np.linalg.svd(np.vstack([np.ones(6), start["sites"].T])).Vh[3:].T
    g = np.vstack([rng.normal(size=(1, 3)), null @ rng.normal(size=(3, 3)), rng.normal(size=(2, 3))])
    H, h0 = np.linalg.qr(rng.normal(size=(9, 3))).Q.T, rng.normal(size=9)
    p = curve(start, start["control"])
    Y = h0 + (g[0] + phi(p, start["sites"]) @ g[1:7] + p @ g[7:]) @ H
    start |= {"Y": Y + noise * rng.normal(size=Y.shape), "g": g, "H": H, "h0": h0}
    return start | {name: start[name] + 0.02 * rng.normal(size=start[name].shape) for name in ("control", "sites")}


def check_free(oracle, name, rng):
    start = beside(rng, 0.02)
    found = oracle.run(**start)
    E = check_answer(f"{name}: six sites", start, found)
    steep = slope(start, found["control"], found["sites"])
    check(f"{name}: six sites: the gradient vanishes", steep < 1e-5, f"{steep:.1e}")
    turned = 7 * np.linalg.qr(rng.normal(size=(2, 2))).Q
    moved = {"control": start["control"] @ turned + 40, "sites": start["sites"] @ turned + 40}
    moved["g"] = np.vstack([start["g"][:-2] / 49, turned.T @ start["g"][-2:] / 49])  # of no account: the engine begins with the closed form
    again = oracle.run(**start | moved)
    close(f"{name}: the pose plane moved, turned and scaled", check_answer(f"{name}: elsewhere", start | moved, again) / E, 1, 1e-9)


def check_exact(oracle, name, rng):
    start = beside(rng, 0)
    total = start["w"] @ np.square(start["Y"] - start["Y"].mean(axis=0)).sum(axis=1)
    found = oracle.run(**start)
    left = error(start, *(found[name] for name in NAMES)) / total
    check(f"{name}: an exact signal is found again", left < 1e-9, f"{left:.1e}")


def check_affine(oracle, name, rng):
    """l = 3: g is affine, and A C H any matrix of rank 2 of splines: what the projection on them leaves."""
    start = waves(rng, 30, 7, 3, 4)
    start["control"] = start["control"] + 0.2 * rng.normal(size=start["control"].shape)
    root, u = np.sqrt(start["w"])[:, None], start["u"]
    Y = root * (start["Y"] - start["w"] @ start["Y"] / start["w"].sum())
    B = np.linalg.qr(root * BSpline.design_matrix(start["t"], np.concatenate([u[:1], u, u[-1:]]), 3).toarray()).Q
    least = np.square(Y).sum() - np.square(np.linalg.svd(B.T @ Y).S[:2]).sum()
    found = oracle.run(**start)
    close(f"{name}: three sites", found["error"][0] / least, 1, 1e-9)
    check(f"{name}: three sites: rank two", found["H"].shape == (2, 9) and found["g"].shape == (6, 2))


def check_held(oracle, name, rng):
    start = waves(rng, 24, 10, 8, 5)
    found = oracle.run(**start)
    check_answer(f"{name}: eight sites", start, found)
    close(f"{name}: the sites stay", found["sites"], start["sites"], 1e-13)
    steep = slope(start, found["control"], found["sites"], of=("control",))
    check(f"{name}: the gradient by the control points vanishes", steep < 1e-4, f"{steep:.1e}")


def run(rng):
    name = "signal_refine_scipy"
    with Oracle(name, "signal.refine") as oracle:
        check_free(oracle, name, rng)
        check_exact(oracle, name, rng)
        check_affine(oracle, name, rng)
        start = waves(rng, 20, 8, 5, 3)
        check(f"{name}: a weight of 0", oracle.status(**start | {"w": np.zeros(20)}) == "error")
        check(f"{name}: a knot too few", oracle.status(**start | {"u": start["u"][1:]}) == "error")
    with Oracle(f"{name} held", "signal.refine") as oracle:
        check_held(oracle, f"{name} held", rng)
