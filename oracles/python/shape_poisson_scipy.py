"""shape.poisson_factor and shape.poisson_solve by SuperLU (scipy.sparse.linalg.splu) in its symmetric mode, minimum degree on A + A^T.

SuperLU's numeric factorisation cannot be asked for alone. For poisson_factor the ordering is found before, and the matrix permuted by it, so that
`seconds` holds SuperLU's symbolic and numeric work without the ordering.
"""

import numpy as np

from shape_mesh import Mesh, Poisson, serve_version, spd_factor
from wire import Unsupported, serve


def prepare(stage, inputs):
    if stage not in ("shape.poisson_factor", "shape.poisson_solve"):
        raise Unsupported(f"no stage {stage} here")
    mesh = Mesh(inputs["reference"], inputs["F"])
    poisson = Poisson(mesh)
    free, A = poisson.free, poisson.grounded
    if not len(free):
        raise Unsupported("there is no equation to solve")
    right = (poisson.laplacian @ mesh.reference)[free]

    def answer(part):
        x = np.zeros((mesh.V, 3))
        x[free] = part
        return {"solution": mesh.place(x, np.zeros((mesh.C, 3)))}

    if stage == "shape.poisson_solve":
        solver, result = spd_factor(A), answer(spd_factor(A).solve(right))
        return lambda: (solver.solve(right), result)[1]
    order = np.argsort(spd_factor(A).perm_c)
    permuted = A[order][:, order].tocsc()
    part = np.empty_like(right)
    part[order] = spd_factor(permuted, "NATURAL").solve(right[order])
    result = answer(part)
    return lambda: (spd_factor(permuted, "NATURAL"), result)[1]


if __name__ == "__main__":
    serve(serve_version(), prepare)
