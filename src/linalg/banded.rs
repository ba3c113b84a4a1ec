//! Least squares with a band of four: the systems of cubic splines.

/// Entries a row.
pub const BAND: usize = 4;
const INVERSE_STEPS: usize = 4;

/// min sum_i (sum_j a_ij c_(first_i + j) - b_i)^2 by Givens rotations, one row at a time; right-hand sides are points of the plane.
///
/// O(rows) when rows come by non-decreasing `first`; any order is right.
pub struct BandedLeastSquares {
    upper: Vec<[f64; BAND]>,
    right: Vec<[f64; 2]>,
    residual: f64,
}

impl BandedLeastSquares {
    /// For `columns` unknowns, at least [`BAND`].
    pub fn new(columns: usize) -> Self {
        Self {
            upper: vec![[0.0; BAND]; columns],
            right: vec![[0.0; 2]; columns],
            residual: 0.0,
        }
    }

    /// Adds the equation sum_j row_j c_(first + j) = b.
    pub fn add(&mut self, first: usize, mut row: [f64; BAND], mut b: [f64; 2]) {
        for pivot in first..self.upper.len() {
            if row == [0.0; BAND] {
                break;
            }
            let upper = &mut self.upper[pivot];
            let length = upper[0].hypot(row[0]);
            if length > 0.0 {
                let (cosine, sine) = (upper[0] / length, row[0] / length);
                for (u, r) in upper.iter_mut().zip(&mut row) {
                    (*u, *r) = (cosine * *u + sine * *r, cosine * *r - sine * *u);
                }
                for (u, r) in self.right[pivot].iter_mut().zip(&mut b) {
                    (*u, *r) = (cosine * *u + sine * *r, cosine * *r - sine * *u);
                }
            }
            row = [row[1], row[2], row[3], 0.0];
        }
        self.residual += b[0] * b[0] + b[1] * b[1];
    }

    /// The ratio of the smallest to the largest pivot: near 0 where the equations leave freedom.
    pub fn pivot_ratio(&self) -> f64 {
        let pivots = self.upper.iter().map(|row| row[0].abs());
        let (low, high) = pivots.fold((f64::INFINITY, 0.0f64), |(low, high), p| {
            (low.min(p), high.max(p))
        });
        if high > 0.0 { low / high } else { 0.0 }
    }

    /// An estimate, from above and close, of the least singular value over the largest pivot: inverse iteration with R^T R, O(columns).
    pub fn reciprocal_condition(&self) -> f64 {
        let columns = self.upper.len();
        let largest = self
            .upper
            .iter()
            .map(|row| row[0].abs())
            .fold(0.0, f64::max);
        let mut x: Vec<f64> = (0..columns)
            .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        let mut growth = 0.0;
        for _ in 0..INVERSE_STEPS {
            let norm = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            x.iter_mut().for_each(|v| *v /= norm);
            self.solve_transposed(&mut x);
            self.solve_upper(&mut x);
            growth = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            if !growth.is_finite() {
                return 0.0;
            }
        }
        1.0 / growth.sqrt() / largest
    }

    fn solve_transposed(&self, x: &mut [f64]) {
        for i in 0..x.len() {
            x[i] /= self.upper[i][0];
            let value = x[i];
            for j in 1..BAND.min(x.len() - i) {
                x[i + j] -= self.upper[i][j] * value;
            }
        }
    }

    fn solve_upper(&self, x: &mut [f64]) {
        for i in (0..x.len()).rev() {
            for j in 1..BAND.min(x.len() - i) {
                x[i] -= self.upper[i][j] * x[i + j];
            }
            x[i] /= self.upper[i][0];
        }
    }

    /// The unknowns, for equations of full rank.
    pub fn solve(&self) -> Vec<[f64; 2]> {
        let mut c = self.right.clone();
        for i in (0..c.len()).rev() {
            for j in 1..BAND.min(c.len() - i) {
                let (known, factor) = (c[i + j], self.upper[i][j]);
                c[i][0] -= factor * known[0];
                c[i][1] -= factor * known[1];
            }
            c[i] = c[i].map(|x| x / self.upper[i][0]);
        }
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_can_be_singular_though_no_pivot_is_small() {
        // The bidiagonal matrix with 1 on the diagonal and -2 beside it: pivots are 1, the least singular value about 2^-39.
        let mut system = BandedLeastSquares::new(40);
        for i in 0..40 {
            let row = if i < 37 {
                [1.0, -2.0, 0.0, 0.0]
            } else {
                [0.0; BAND]
            };
            if i < 37 {
                system.add(i, row, [0.0; 2]);
            }
        }
        system.add(36, [0.0, 1.0, -2.0, 0.0], [0.0; 2]);
        system.add(36, [0.0, 0.0, 1.0, -2.0], [0.0; 2]);
        system.add(36, [0.0, 0.0, 0.0, 1.0], [0.0; 2]);
        assert!(system.pivot_ratio() > 0.9);
        let found = system.reciprocal_condition();
        assert!((1e-13..1e-11).contains(&found), "{found}");
    }

    #[test]
    fn solves_a_consistent_banded_system() {
        let truth: Vec<[f64; 2]> = (0..7).map(|i| [i as f64, (i * i) as f64]).collect();
        let mut system = BandedLeastSquares::new(7);
        for i in 0..20 {
            let first = i * 4 / 20;
            let row = [1.0 + i as f64 * 0.1, 0.3, (i as f64).sin(), -0.4];
            let b = std::array::from_fn(|a| (0..4).map(|j| row[j] * truth[first + j][a]).sum());
            system.add(first, row, b);
        }
        assert!(system.pivot_ratio() > 1e-6 && system.reciprocal_condition() > 1e-6);
        for (c, t) in system.solve().iter().zip(&truth) {
            assert!((c[0] - t[0]).abs() < 1e-9 && (c[1] - t[1]).abs() < 1e-9);
        }
    }
}
