//! Least squares by a QR factorisation that grows a column at a time.

use faer::MatRef;

use super::kernels::{axpy_squares, combine, dot, norm_squared, project};

/// A column whose part outside the span of the columns before it is smaller than this share of it adds nothing but rounding.
const INDEPENDENT: f64 = 1e-12;
/// When projecting leaves less than this share of a column, it is projected once more ("twice is enough", Parlett 1980).
const REPROJECT: f64 = 0.1;

/// An orthonormal basis of the columns appended so far, and what least squares leaves of the right-hand sides.
pub struct AppendedQr {
    /// n, the length of a column.
    rows: usize,
    /// Orthonormal columns, one after the other.
    basis: Vec<f64>,
    /// n x m by columns.
    residual: Vec<f64>,
    row_squares: Vec<f64>,
    projections: Vec<f64>,
}

impl AppendedQr {
    /// Starts with no columns: the residual is the right-hand sides, n x m.
    pub fn new(right_hand_sides: MatRef<'_, f64>) -> Self {
        let rows = right_hand_sides.nrows();
        let columns = right_hand_sides.col_iter();
        let residual: Vec<f64> = columns.flat_map(|c| c.iter().copied()).collect();
        let square = |i| (residual.iter().skip(i).step_by(rows)).map(|x| x * x).sum();
        Self {
            rows,
            basis: Vec::new(),
            row_squares: (0..rows).map(square).collect(),
            residual,
            projections: Vec::new(),
        }
    }

    /// Appends a column of n numbers and takes its direction out of the residual. Returns false, changing nothing, where the column lies in the
    /// span of those before it. O(n (columns + m)).
    pub fn append(&mut self, mut column: Vec<f64>) -> bool {
        let length = norm_squared(&column).sqrt();
        let mut left = self.project_out(&mut column);
        if left < REPROJECT * length {
            left = self.project_out(&mut column);
        }
        if left.is_nan() || left <= INDEPENDENT * length {
            return false;
        }
        column.iter_mut().for_each(|x| *x /= left);
        self.row_squares.fill(0.0);
        for residual in self.residual.chunks_exact_mut(self.rows.max(1)) {
            let share = dot(&column, residual);
            axpy_squares(-share, &column, residual, &mut self.row_squares);
        }
        self.basis.extend_from_slice(&column);
        true
    }

    /// Takes the span of the basis out of `column`; returns the length of what is left.
    fn project_out(&mut self, column: &mut [f64]) -> f64 {
        let n = self.rows;
        let basis = |j: usize| &self.basis[j * n..(j + 1) * n];
        project(
            self.basis.len() / n.max(1),
            basis,
            column,
            &mut self.projections,
        );
        self.projections.iter_mut().for_each(|x| *x = -*x);
        combine(&self.projections, basis, column);
        norm_squared(column).sqrt()
    }

    /// The sum of squares of each of the n rows of the residual: of the right-hand sides less their projections on the columns.
    pub fn row_squares(&self) -> &[f64] {
        &self.row_squares
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::dense::Qr;
    use faer::Mat;

    #[test]
    fn residual_is_that_of_least_squares() {
        let a = Mat::from_fn(20, 6, |i, j| ((i + 2) as f64 * (j as f64 + 0.7)).sin());
        let b = Mat::from_fn(20, 3, |i, j| ((i * (j + 1)) as f64).cos());
        let mut grown = AppendedQr::new(b.as_ref());
        for j in 0..6 {
            assert!(grown.append(a.col_as_slice(j).to_vec()));
        }
        let mut qtb = b.clone();
        let qr = Qr::new(a.clone());
        qr.apply_transpose(&mut qtb);
        let residual = &b - &a * qr.solve_upper(&qtb);
        for (i, square) in grown.row_squares().iter().enumerate() {
            let expected: f64 = (0..3).map(|j| residual[(i, j)].powi(2)).sum();
            assert!((square - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn a_dependent_column_is_refused() {
        let b = Mat::from_fn(5, 1, |i, _| i as f64);
        let mut grown = AppendedQr::new(b.as_ref());
        assert!(grown.append(vec![1.0; 5]));
        assert!(!grown.append(vec![3.0; 5]));
        assert!(!grown.append(vec![0.0; 5]));
    }
}
