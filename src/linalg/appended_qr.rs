//! Least squares by a QR factorisation that grows a column at a time.

use faer::{Mat, MatRef};

use super::kernels::{add_squares, axpy, combine, dot, norm_squared};

/// A column whose part outside the span of the columns before it is smaller than this share of it adds nothing but rounding.
const INDEPENDENT: f64 = 1e-12;
/// When projecting leaves less than this share of a column, it is projected once more ("twice is enough", Parlett 1980).
const REPROJECT: f64 = 0.1;

/// An orthonormal basis of the columns appended so far, and what least squares leaves of the right-hand sides.
pub struct AppendedQr {
    basis: Vec<Vec<f64>>,
    residual: Mat<f64>,
    row_squares: Vec<f64>,
    projections: Vec<f64>,
}

impl AppendedQr {
    /// Starts with no columns: the residual is the right-hand sides, n x m.
    pub fn new(right_hand_sides: MatRef<'_, f64>) -> Self {
        let residual = right_hand_sides.to_owned();
        let mut row_squares = vec![0.0; residual.nrows()];
        for j in 0..residual.ncols() {
            add_squares(residual.col_as_slice(j), &mut row_squares);
        }
        Self {
            basis: Vec::new(),
            residual,
            row_squares,
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
        for j in 0..self.residual.ncols() {
            let residual = self.residual.col_as_slice_mut(j);
            let share = dot(&column, residual);
            axpy(-share, &column, residual);
            add_squares(residual, &mut self.row_squares);
        }
        self.basis.push(column);
        true
    }

    /// Takes the span of the basis out of `column`; returns the length of what is left.
    fn project_out(&mut self, column: &mut [f64]) -> f64 {
        self.projections.clear();
        self.projections
            .extend(self.basis.iter().map(|q| -dot(q, column)));
        combine(&self.projections, |j| &self.basis[j], column);
        norm_squared(column).sqrt()
    }

    /// The square of the norm of each row of the residual.
    pub fn row_squares(&self) -> &[f64] {
        &self.row_squares
    }

    /// n x m: the right-hand sides less their projections on the columns.
    pub fn residual(&self) -> MatRef<'_, f64> {
        self.residual.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::dense::Qr;

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
        assert!((grown.residual() - &residual).norm_max() < 1e-13);
        for i in 0..20 {
            assert!((grown.row_squares()[i] - residual.row(i).squared_norm_l2()).abs() < 1e-13);
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
