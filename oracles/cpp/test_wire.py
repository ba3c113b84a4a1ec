"""Asks the C++ and R oracles what has a closed-form answer, and what is not a request at all.

    target/oracles/venv/bin/python oracles/cpp/test_wire.py [folder of the built C++ programs, else target/oracles/cpp]

A program that is not there is skipped, and said so; the exit code is 1 if any check failed.
"""

import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent / "python"))
import checking  # noqa: E402
import test_halfway  # noqa: E402
import test_poisson  # noqa: E402
import test_quality  # noqa: E402
import test_shapes  # noqa: E402
from wire import read_message, write_message  # noqa: E402

BUILD = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else FOLDER.parents[1] / "target/oracles/cpp")
RSCRIPT = shutil.which("Rscript")


class Oracle:
    def __init__(self, command):
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def ask(self, **records):
        write_message(self.process.stdin, records)
        return read_message(self.process.stdout)

    def run(self, stage, **inputs):
        named = {"in." + name: value for name, value in inputs.items()}
        return self.ask(op="run", stage=stage, samples=3, batch=2 if stage != "sequence.read" else 1, **named)

    def close(self):
        self.process.stdin.close()
        return self.process.wait(timeout=20)


def near(reply, **expected):
    assert reply["status"] == "ok", reply
    assert reply["seconds"].shape == (3,) and (reply["seconds"] > 0).all(), reply["seconds"]
    for name, value in expected.items():
        np.testing.assert_allclose(reply["out." + name], value, rtol=1e-12, atol=1e-12, err_msg=name)


def refused(reply, status="unsupported"):
    assert reply["status"] == status and reply["message"], reply


def obj(vertices, faces):
    file = tempfile.NamedTemporaryFile("w", suffix=".obj", dir=SCRATCH, delete=False)
    with file:
        file.writelines("v {} {} {}\n".format(*v) for v in vertices)
        file.writelines("f {} {} {}\n".format(*(i + 1 for i in f)) for f in faces)
    return file.name


def check_read(oracle):
    """Every coordinate here is a float, so that OpenMesh's float parser loses nothing."""
    corners = [(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 2)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    cube = obj(corners, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])
    simplex, sides = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    paths = "\n".join([cube, obj(simplex, sides), obj(simplex, sides[:3])])
    near(oracle.run("sequence.read", paths=paths),
         counts=[[8, 12, 0], [4, 4, 0], [4, 3, 3]],
         measures=[[24, 8, 0, 0, 0, 2, 2, 2], [1.5 + 3**0.5 / 2, 1 / 6, 0, 0, 0, 1, 1, 1], [1.5, 0, 0, 0, 0, 1, 1, 1]])
    fins = [(0, 1, 2), (1, 0, 3), (0, 1, 3)]
    refused(oracle.run("sequence.read", paths=obj(simplex, fins)), "error")  # an edge with three triangles
    refused(oracle.run("sequence.read", paths=obj(simplex, [(0, 1, 1)])), "error")
    refused(oracle.run("sequence.read", paths="/nowhere.obj"), "error")


def check_distance(oracle):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    frames = np.stack([square, square + 5])
    near(oracle.run("sequence.distance", A=frames + [0, 0, 0.75], B=frames, F=faces), hausdorff=[0.75, 0.75], mean=[0.75, 0.75])
    beside = square + [[2, 0, 0]]  # distances 1, 2, 2, 1
    near(oracle.run("sequence.distance", A=beside[None], B=square[None], F=faces), hausdorff=[2], mean=[1.5])
    refused(oracle.run("sequence.distance", A=square[None], B=square[None], F=np.array([[0, 1, 1]])))
    refused(oracle.run("sequence.distance", A=square[None], B=square[None], F=np.array([[0, 1, 4]])), "error")
    refused(oracle.run("sequence.distance", A=square[None] * np.nan, B=square[None], F=faces), "error")


def settle():
    """What the checks shared with the Python oracles have found so far, and no more than once."""
    found, checking.failures[:] = list(checking.failures), []
    assert not found, found


def check_lengths(oracle):
    """The closed forms of python/test_shapes.py, which asks the Python oracles the same."""

    def encode(x0, F, frames):
        reply = oracle.run("shape.lengths_encode", reference=x0, F=F, frames=frames)
        return None if reply["status"] == "unsupported" else reply["out.z"]

    test_shapes.check_lengths_encode("openmesh", encode, np.random.default_rng(1), books=False, turned_over=False, near=3e-8)
    test_shapes.check_odd_lengths("openmesh", encode, np.random.default_rng(2), books=False, near=3e-8)
    test_shapes.check_threshold("openmesh", encode, 2 * 5 + 6, 6)
    settle()
    flat, F = test_shapes.strip(2)
    flaps = oracle.run("shape.lengths_encode", reference=flat, F=np.concatenate([F, test_shapes.NEEDLE]), frames=flat[None])
    np.testing.assert_allclose(flaps["out.z"][0, 1:20:2], np.zeros(10), atol=3e-8)
    for height in (0, 1e-15):  # collapsed triangles
        refused(oracle.run("shape.lengths_encode", reference=flat, F=F, frames=flat[None] * [1, height, 1]))
    low = oracle.run("shape.lengths_encode", reference=flat, F=F, frames=flat[None] * [1, 1e-11, 1])
    np.testing.assert_allclose(low["out.z"][0, 1:18:2], np.zeros(9), atol=3e-8)
    refused(oracle.run("shape.lengths_encode", reference=flat, F=np.array([[0, 1, 1]]), frames=flat[None]))
    refused(oracle.run("shape.lengths_encode", reference=flat, F=F + 9, frames=flat[None]), "error")


def check_poisson(oracle):
    """The closed forms of python/test_poisson.py, which asks the Python oracle the same."""
    test_poisson.check_poisson("c++", oracle.run, np.random.default_rng(1))
    settle()


def check_halfway(oracle):
    """The closed forms of python/test_halfway.py, which asks the Python oracle the same."""
    test_halfway.check_halfway("cgal", lambda **inputs: oracle.run("shape.halfway", **inputs), books=False)
    settle()


def check_quality(oracle):
    """The closed forms of python/test_quality.py, which asks the Python oracles the same."""

    def request(**inputs):
        return oracle.run("mesh.quality", **inputs)

    def ask(frames, F):
        return {name[4:]: value for name, value in request(frames=frames, F=F).items() if name.startswith("out.")}

    test_quality.check_measures("cgal", ask, 1e-14)
    test_quality.check_faces("cgal", ask, exactly=True)
    test_quality.check_refusals("cgal", lambda **inputs: request(**inputs)["status"])
    settle()


def check_rho(oracle):
    query = np.linspace(1, 6, 31)
    near(oracle.run("signal.rho", t=2 * np.arange(6.0), query=query), values=2 * (query - 1), slopes=np.full(6, 2.0))
    near(oracle.run("signal.rho", t=np.array([0.0, 1, 1, 2]), query=np.array([1.5, 2.5])), values=[0.625, 1], slopes=[1, 0, 0, 1])
    # (alpha, beta) = (1, 5.5) leaves the circle and M: both limiters act, alike
    scale = 3 / np.hypot(1, 5.5)
    near(oracle.run("signal.rho", t=np.array([0.0, 1, 11]), query=np.array([1.0])), values=[0], slopes=[scale, 5.5 * scale, 10])
    # r-help, February 2010: R's answer here is not monotone
    refused(oracle.run("signal.rho", t=np.array([-12, -10, 3.5, 4.45, 4.5, 140, 142, 142]), query=np.array([4.5])))


def check_spline(oracle):
    t, query = np.linspace(0, 3, 20) ** 1.5, np.linspace(0, 3**1.5, 17)
    u = np.r_[[0] * 3, np.linspace(0, t[-1], 6)[1:-1], [t[-1]] * 3]

    def cubic(x):
        return np.stack([x**3 - 4 * x**2, 1 + x - x**3 / 3], axis=1)

    near(oracle.run("signal.spline", t=t, u=u, P=cubic(t), query=query), values=cubic(t), query_values=cubic(query))
    refused(oracle.run("signal.spline", t=t[:5], u=u, P=cubic(t[:5]), query=query))
    crowded = np.r_[0, np.linspace(0.9, 1, 18) * t[-1], t[-1]]
    refused(oracle.run("signal.spline", t=crowded, u=u, P=cubic(crowded), query=query))


def check_h(oracle):
    mean, direction = np.array([1.0, 2, 3, 4]), np.array([1.0, -5, 1, 3]) / 6
    X = np.array([[-3.0], [1], [2]])
    near(oracle.run("signal.h", Z=mean - X * direction, m=2), h0=mean, H=[-direction], X=X, sigma=[14**0.5])
    near(oracle.run("signal.h", Z=mean - X * direction, m=0), h0=mean, H=np.empty((0, 4)), X=np.empty((3, 0)), sigma=[])


def check_manners(command, stage):
    oracle = Oracle(command)
    assert oracle.ask(op="version")["version"]
    refused(oracle.ask(op="run", stage="no.such", samples=1, batch=1))
    refused(oracle.ask(op="run", stage=stage, samples=1, batch=1), "error")
    refused(oracle.ask(op="run"), "error")
    refused(oracle.ask(), "error")
    refused(oracle.ask(op="dance"), "error")
    assert oracle.ask(op="version")["status"] == "ok"
    assert oracle.close() == 0, "exit code at the end of the requests"

    record = struct.pack("<H", 2) + b"op"
    nonsense = {
        "text": b"hello, world",
        "half a head": b"MSE",
        "half a message": b"MSEQ" + struct.pack("<I", 1) + record,
        "absurd size": b"MSEQ" + struct.pack("<I", 1) + record + struct.pack("<BBQQ", 1, 2, 2**40, 2**40),
        "a size that is a lie": b"MSEQ" + struct.pack("<I", 1) + record + struct.pack("<BBQ", 1, 1, 2**50),
        "no such dtype": b"MSEQ" + struct.pack("<I", 1) + record + struct.pack("<BB", 9, 0),
    }
    for what, request in nonsense.items():
        done = subprocess.run(command, input=request, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=20)
        assert done.returncode >= 0, f"{what}: killed by signal {-done.returncode}"
        assert b"error" in done.stdout, f"{what}: no error reply"


PROGRAMS = [
    ([str(BUILD / "sequence_read_openmesh")], "sequence.read", check_read),
    ([str(BUILD / "sequence_distance_cgal")], "sequence.distance", check_distance),
    ([str(BUILD / "mesh_quality_cgal")], "mesh.quality", check_quality),
    ([str(BUILD / "shape_lengths_openmesh")], "shape.lengths_encode", check_lengths),
    ([str(BUILD / "shape_halfway_cgal")], "shape.halfway", check_halfway),
    ([str(BUILD / "shape_poisson_cholmod")], "shape.poisson_factor", check_poisson),
    ([str(BUILD / "shape_poisson_eigen")], "shape.poisson_factor", check_poisson),
    ([RSCRIPT, "--vanilla", str(FOLDER.parent / "r" / "signal_rho_r.R")], "signal.rho", check_rho),
    ([RSCRIPT, "--vanilla", str(FOLDER.parent / "r" / "signal_spline_r.R")], "signal.spline", check_spline),
    ([RSCRIPT, "--vanilla", str(FOLDER.parent / "r" / "signal_h_r.R")], "signal.h", check_h),
]

passed = failed = 0
with tempfile.TemporaryDirectory() as SCRATCH:
    for command, stage, check in PROGRAMS:
        name = pathlib.Path(command[-1]).name
        if command[0] is None or not pathlib.Path(command[0]).exists():
            print(f"skipped {name}: {command[0] or 'Rscript'} is not there")
            continue
        try:
            oracle = Oracle(command)
            check(oracle)
            assert oracle.close() == 0
            check_manners(command, stage)
        except Exception as error:
            failed += 1
            print(f"FAILED  {name}: {type(error).__name__}: {error}")
        else:
            passed += 1
            print(f"passed  {name}")
print(f"{passed} passed, {failed} failed")
sys.exit(1 if failed else 0)
