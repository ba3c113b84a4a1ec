//! Dense factorisations of faer, on one thread, with errors in place of panics.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::matmul::matmul;
use faer::linalg::qr::no_pivoting::factor::{
    QrParams, qr_in_place, qr_in_place_scratch, recommended_block_size,
};
use faer::linalg::{evd, householder, svd, triangular_solve};
use faer::{Accum, Auto, Conj, Mat, MatMut, MatRef, Par, Spec, diag::Diag};
use thiserror::Error;

use super::kernels::{axpy, clear_upper_halves, dot};

/// Why a dense factorisation failed.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum FactorError {
    /// The iteration for eigenvalues or singular values did not settle, which non-finite or extreme entries can cause.
    #[error(
        "the {factorisation} of a {rows} x {columns} matrix did not converge; look for extreme values in the input"
    )]
    NoConvergence {
        factorisation: &'static str,
        rows: usize,
        columns: usize,
    },
}

/// The exponent of the greatest entry when faer factors a matrix. Its norms also sum the squares of entries times 2^-511, which are denormal for entries
/// below 1, and each then costs hundreds of cycles. Here entries down to 2^-256 of the greatest stay clear of that, and squares of all of them of infinity.
const LIFTED: i32 = 256;

/// The power of two that lifts a matrix so: factorisations of it have the same bits but for the scale.
fn lift(a: MatRef<'_, f64>) -> f64 {
    let columns = (0..a.ncols()).map(|j| a.col(j).norm_max());
    let greatest = columns.fold(0.0, f64::max);
    if !greatest.is_normal() {
        return 1.0;
    }
    let exponent = (greatest.to_bits() >> 52) as i32 - 1023;
    2f64.powi((LIFTED - exponent).min(1000))
}

fn scale_by(mut a: MatMut<'_, f64>, factor: f64) {
    for j in 0..a.ncols() {
        a.as_mut().col_mut(j).iter_mut().for_each(|x| *x *= factor);
    }
}

/// C := A B, or C + A B, on one thread.
pub fn multiply(c: MatMut<'_, f64>, add: Accum, a: MatRef<'_, f64>, b: MatRef<'_, f64>) {
    matmul(c, add, a, b, 1.0, Par::Seq);
    clear_upper_halves();
}

/// The columns of a matrix whose columns are contiguous, as those of a [`Mat`] are; others are left out.
pub fn columns_mut(matrix: MatMut<'_, f64>) -> Vec<&mut [f64]> {
    let columns = matrix.col_iter_mut();
    let columns = columns.filter_map(|column| column.try_as_col_major_mut());
    columns.map(|column| column.as_slice_mut()).collect()
}

/// Eigenvalues by decreasing size and their unit eigenvectors as columns.
pub struct SymmetricEigen {
    pub values: Vec<f64>,
    pub vectors: Mat<f64>,
}

/// The eigendecomposition of a symmetric matrix, of which the lower triangle is read. O(n^3).
pub fn symmetric_eigen(a: MatRef<'_, f64>) -> Result<SymmetricEigen, FactorError> {
    let n = a.nrows();
    let mut values = Diag::<f64>::zeros(n);
    let mut vectors = Mat::zeros(n, n);
    let scratch = evd::self_adjoint_evd_scratch::<f64>(
        n,
        evd::ComputeEigenvectors::Yes,
        Par::Seq,
        Default::default(),
    );
    evd::self_adjoint_evd(
        a,
        values.as_mut(),
        Some(vectors.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| FactorError::NoConvergence {
        factorisation: "eigendecomposition",
        rows: n,
        columns: n,
    })?;
    Ok(SymmetricEigen {
        values: values.column_vector().iter().rev().copied().collect(),
        vectors: Mat::from_fn(n, n, |i, j| vectors[(i, n - 1 - j)]),
    })
}

/// A = U diag(s) V^T with min(rows, columns) columns in U and V and decreasing s.
pub struct ThinSvd {
    pub u: Mat<f64>,
    pub s: Vec<f64>,
    pub v: Mat<f64>,
}

/// The thin singular value decomposition. O(rows columns min(rows, columns)).
pub fn thin_svd(a: MatRef<'_, f64>) -> Result<ThinSvd, FactorError> {
    let (rows, columns) = a.shape();
    let size = rows.min(columns);
    let (mut u, mut v) = (Mat::zeros(rows, size), Mat::zeros(columns, size));
    let mut s = Diag::<f64>::zeros(size);
    let lift = lift(a);
    let mut a = a.to_owned();
    scale_by(a.as_mut(), lift);
    let thin = svd::ComputeSvdVectors::Thin;
    let scratch = svd::svd_scratch::<f64>(rows, columns, thin, thin, Par::Seq, Default::default());
    svd::svd(
        a.as_ref(),
        s.as_mut(),
        Some(u.as_mut()),
        Some(v.as_mut()),
        Par::Seq,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .map_err(|_| FactorError::NoConvergence {
        factorisation: "singular value decomposition",
        rows,
        columns,
    })?;
    Ok(ThinSvd {
        u,
        s: s.column_vector().iter().map(|s| s / lift).collect(),
        v,
    })
}

/// Matrices of up to so many entries are factored in blocks of 16 columns, and blocks of up to so many column by column.
const SMALL: usize = 512 * 512;
const UNBLOCKED: usize = 100 * 100;

/// How a QR factorisation goes through a matrix: small ones in blocks of 16 columns without blocks in these, which measured is twice as fast as faer's
/// defaults at 200 x 140 and at 100 x 50.
fn blocks(rows: usize, columns: usize) -> (usize, Spec<QrParams, f64>) {
    let mut parameters = <QrParams as Auto<f64>>::auto();
    let recommended = recommended_block_size::<f64>(rows, columns);
    if rows * columns > SMALL {
        return (recommended, parameters.into());
    }
    parameters.blocking_threshold = UNBLOCKED;
    (rows.min(columns).clamp(1, 16), parameters.into())
}

/// A Householder QR factorisation, Q in its implicit form.
pub struct Qr {
    factors: Mat<f64>,
    coefficients: Mat<f64>,
}

impl Qr {
    /// Factors A (rows x columns), overwriting it. O(rows columns min(rows, columns)).
    pub fn new(mut a: Mat<f64>) -> Self {
        let (rows, columns) = a.shape();
        let lift = lift(a.as_ref());
        scale_by(a.as_mut(), lift);
        let (block, parameters) = blocks(rows, columns);
        let mut coefficients = Mat::zeros(block, rows.min(columns));
        let scratch = qr_in_place_scratch::<f64>(rows, columns, block, Par::Seq, parameters);
        qr_in_place(
            a.as_mut(),
            coefficients.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            parameters,
        );
        clear_upper_halves();
        for j in 0..columns {
            let r = a.col_as_slice_mut(j).iter_mut().take(j + 1);
            r.for_each(|x| *x /= lift);
        }
        Self {
            factors: a,
            coefficients,
        }
    }

    /// Entry (i, j) of R, i <= j.
    pub fn r(&self, i: usize, j: usize) -> f64 {
        self.factors[(i, j)]
    }

    /// Replaces B by Q^T B, with the full square Q.
    pub fn apply_transpose(&self, b: &mut Mat<f64>) {
        let scratch = self.scratch(b.ncols());
        householder::apply_block_householder_sequence_transpose_on_the_left_in_place_with_conj(
            self.factors.as_ref(),
            self.coefficients.as_ref(),
            Conj::No,
            b.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        clear_upper_halves();
    }

    /// Replaces B by Q B, with the full square Q.
    pub fn apply(&self, b: &mut Mat<f64>) {
        let scratch = self.scratch(b.ncols());
        householder::apply_block_householder_sequence_on_the_left_in_place_with_conj(
            self.factors.as_ref(),
            self.coefficients.as_ref(),
            Conj::No,
            b.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        clear_upper_halves();
    }

    fn scratch(&self, columns: usize) -> faer::dyn_stack::StackReq {
        householder::apply_block_householder_sequence_transpose_on_the_left_in_place_scratch::<f64>(
            self.factors.nrows(),
            self.coefficients.nrows(),
            columns,
        )
    }

    /// Solves R X = B's leading rows, for a factorisation of full column rank with rows >= columns.
    pub fn solve_upper(&self, b: &Mat<f64>) -> Mat<f64> {
        let columns = self.factors.ncols();
        let mut x = b.get(..columns, ..).to_owned();
        triangular_solve::solve_upper_triangular_in_place(
            self.factors.get(..columns, ..),
            x.as_mut(),
            Par::Seq,
        );
        clear_upper_halves();
        x
    }
}

/// A = L L^T of a symmetric positive definite matrix.
pub struct Cholesky {
    lower: Mat<f64>,
}

impl Cholesky {
    /// Factors A, of which the lower triangle is read, overwriting it; None where it is not positive definite. O(n^3 / 3).
    pub fn new(mut a: Mat<f64>) -> Option<Self> {
        let n = a.nrows();
        let scratch =
            llt::factor::cholesky_in_place_scratch::<f64>(n, Par::Seq, Default::default());
        let factored = llt::factor::cholesky_in_place(
            a.as_mut(),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        clear_upper_halves();
        factored.ok().map(|_| Self { lower: a })
    }

    /// Replaces b by A^-1 b. O(n^2).
    pub fn solve(&self, b: &mut [f64]) {
        let n = self.lower.nrows();
        for j in 0..n {
            let column = &self.lower.col_as_slice(j)[j..];
            b[j] /= column[0];
            let (head, tail) = b[j..].split_at_mut(1);
            axpy(-head[0], &column[1..], tail);
        }
        for j in (0..n).rev() {
            let column = &self.lower.col_as_slice(j)[j..];
            b[j] = (b[j] - dot(&column[1..], &b[j + 1..])) / column[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(rows: usize, columns: usize) -> Mat<f64> {
        Mat::from_fn(rows, columns, |i, j| {
            ((i + 2) as f64 * (j as f64 + 0.7)).sin()
        })
    }

    #[test]
    fn qr_solves_a_consistent_system() {
        let a = sample(9, 4);
        let x = sample(4, 2);
        let mut b = &a * &x;
        let qr = Qr::new(a);
        qr.apply_transpose(&mut b);
        assert!((qr.solve_upper(&b) - x).norm_max() < 1e-12);
    }

    #[test]
    fn cholesky_solves_and_refuses() {
        let a = sample(12, 7);
        let normal = a.transpose() * &a;
        let x: Vec<f64> = (0..7).map(|i| (i as f64).cos()).collect();
        let product = |i: usize| (0..7).map(|j| normal[(i, j)] * x[j]).sum();
        let mut b: Vec<f64> = (0..7).map(product).collect();
        Cholesky::new(normal.clone()).unwrap().solve(&mut b);
        assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-9));
        assert!(Cholesky::new(-normal).is_none());
    }

    #[test]
    fn svd_and_eigen_agree() {
        let a = sample(12, 5);
        let svd = thin_svd(a.as_ref()).unwrap();
        let eigen = symmetric_eigen((a.transpose() * &a).as_ref()).unwrap();
        for (s, lambda) in svd.s.iter().zip(&eigen.values) {
            assert!((s * s - lambda).abs() < 1e-12 * eigen.values[0]);
        }
    }
}
