"""shape.poisson_factor and shape.poisson_solve by SuperLU (scipy.sparse.linalg.splu): an LU factorisation of both triangles, ordered by minimum
degree on A^T + A, without pivoting off the diagonal. It does about twice the work of a Cholesky factorisation.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shape_mesh import serve_version
from wire import Unsupported, serve


def whole_matrix(rows, cols, values, n):
    if not rows.shape == cols.shape == values.shape or rows.ndim != 1 or not np.isfinite(values).all():
        raise ValueError("rows, cols and values are as long as each other, and finite")
    if np.any(cols < 0) or np.any(cols > rows) or np.any(rows >= n):
        raise ValueError("an entry is not in the lower triangle")
    off = rows != cols
    entries = np.concatenate([values, values[off]]), (np.concatenate([rows, cols[off]]), np.concatenate([cols, rows[off]]))
    return sparse.coo_matrix(entries, (n, n)).tocsc()


def prepare(stage, inputs):
    if stage not in ("shape.poisson_factor", "shape.poisson_solve"):
        raise Unsupported(f"no stage {stage} here")
    b = inputs["b"]
    if b.ndim != 2 or b.shape[1] != 3 or not len(b) or not np.isfinite(b).all():
        raise ValueError("b is (n,3), finite and not empty")
    A = whole_matrix(inputs["rows"], inputs["cols"], inputs["values"], len(b))

    def factor():
        return splu(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def checked(lu):
        if not np.array_equal(lu.perm_r, lu.perm_c) or np.any(lu.U.diagonal() <= 0):
            raise ValueError("the matrix is not positive definite")
        return lu

    if stage.endswith("factor"):

        def call():
            lu = factor()
            return lambda: {"x": checked(lu).solve(b)}

        return call
    lu = checked(factor())
    return lambda: {"x": lu.solve(b)}


if __name__ == "__main__":
    serve(serve_version(), prepare)
