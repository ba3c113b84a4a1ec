//! Least squares with a band of four: the systems of cubic splines.

use super::kernels::vectorised;

/// Entries a row.
pub const BAND: usize = 4;
const INVERSE_STEPS: usize = 4;

/// min sum_i (sum_j a_ij c_(first_i + j) - b_i)^2 by Givens rotations, one row at a time; right-hand sides are points of the plane.
///
/// The rotations are free of square roots (Gentleman 1973): R = D^(1/2) U with a unit upper triangle U, and a row carries a weight. As stable as the
/// usual ones, and consecutive rows overlap in the processor: nothing but the weights waits for a division.
///
/// O(rows) when rows come by non-decreasing `first`; any order is right.
pub struct BandedLeastSquares {
    rows: Vec<Row>,
}

/// Three entries right of a diagonal, one that is always 0, and two right-hand sides: six numbers that one rotation treats alike.
type Line = [f64; 6];

/// The square of R's pivot, and the row of U, beyond its diagonal 1, with that of U's right-hand sides.
#[derive(Clone, Copy)]
struct Row {
    line: Line,
    square: f64,
}

/// Pivots start here in place of 0, so that nothing is divided by 0: far below the square of any entry that counts.
const EMPTY: f64 = 1e-300;

impl BandedLeastSquares {
    /// For `columns` unknowns, at least [`BAND`].
    pub fn new(columns: usize) -> Self {
        let empty = Row {
            line: [0.0; 6],
            square: EMPTY,
        };
        Self {
            rows: vec![empty; columns],
        }
    }

    /// Adds the equation sum_j row_j c_(first + j) = b.
    pub fn add(&mut self, first: usize, row: [f64; BAND], b: [f64; 2]) {
        let mut head = row[0];
        let mut line = [row[1], row[2], row[3], 0.0, b[0], b[1]];
        let mut weight = 1.0;
        for (done, pivot) in self.rows.iter_mut().skip(first).enumerate() {
            // Rows that come in order are used up after BAND rotations. Not looking before then leaves the processor nothing to guess.
            if done >= BAND && head == 0.0 && line[..3] == [0.0; 3] {
                break;
            }
            let share = weight * head;
            let square = pivot.square + share * head;
            let (cosine, sine) = (pivot.square / square, share / square);
            for j in 0..6 {
                let (u, x) = (pivot.line[j], line[j]);
                pivot.line[j] = cosine * u + sine * x;
                line[j] = x - head * u;
            }
            pivot.square = square;
            weight *= cosine;
            head = line[0];
            line = [line[1], line[2], 0.0, 0.0, line[4], line[5]];
        }
    }

    /// The ratio of the smallest to the largest pivot: near 0 where the equations leave freedom.
    pub fn pivot_ratio(&self) -> f64 {
        let (low, high) = self
            .rows
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(low, high), row| {
                (low.min(row.square), high.max(row.square))
            });
        if high > 0.0 { (low / high).sqrt() } else { 0.0 }
    }

    /// An estimate, from above and close, of the least singular value over the largest pivot: inverse iteration with R^T R, O(columns).
    pub fn reciprocal_condition(&self) -> f64 {
        let columns = self.rows.len();
        let largest = self.rows.iter().map(|row| row.square).fold(0.0, f64::max);
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
        1.0 / (growth * largest).sqrt()
    }

    /// x := D^-1 U^-T x.
    fn solve_transposed(&self, x: &mut [f64]) {
        for (i, row) in self.rows.iter().enumerate() {
            let value = x[i];
            for (x, u) in x[i + 1..].iter_mut().zip(&row.line[..BAND - 1]) {
                *x -= u * value;
            }
            x[i] = value / row.square;
        }
    }

    /// x := U^-1 x.
    fn solve_upper(&self, x: &mut [f64]) {
        for (i, row) in self.rows.iter().enumerate().rev() {
            let (before, after) = x.split_at_mut(i + 1);
            for (u, x) in row.line[..BAND - 1].iter().zip(after) {
                before[i] -= u * *x;
            }
        }
    }

    /// The unknowns, for equations of full rank.
    pub fn solve(&self) -> Vec<[f64; 2]> {
        let mut c: Vec<[f64; 2]> = self
            .rows
            .iter()
            .map(|row| [row.line[4], row.line[5]])
            .collect();
        for (i, row) in self.rows.iter().enumerate().rev() {
            for j in 1..BAND.min(c.len() - i) {
                let (known, factor) = (c[i + j], row.line[j - 1]);
                c[i][0] -= factor * known[0];
                c[i][1] -= factor * known[1];
            }
        }
        c
    }
}

/// Adds blocks of four neighbouring lines to a vector of lines. Blocks that come in order meet in registers: memory sees each line once.
pub struct Gather<'a, const N: usize> {
    sum: &'a mut [[f64; N]],
    first: usize,
    held: [[f64; N]; BAND],
}

impl<'a, const N: usize> Gather<'a, N> {
    /// Into `sum`, at least four lines.
    #[inline(always)]
    pub fn new(sum: &'a mut [[f64; N]]) -> Self {
        Self {
            sum,
            first: 0,
            held: [[0.0; N]; BAND],
        }
    }

    /// Adds `block` to the lines `first ..`.
    #[inline(always)]
    pub fn add(&mut self, first: usize, block: [[f64; N]; BAND]) {
        if first < self.first {
            (0..BAND).for_each(|_| self.step());
            self.first = first;
        }
        while self.first < first {
            self.step();
        }
        for (held, line) in self.held.iter_mut().zip(block) {
            for j in 0..N {
                held[j] += line[j];
            }
        }
    }

    /// Writes what is held.
    #[inline(always)]
    pub fn finish(mut self) {
        (0..BAND).for_each(|_| self.step());
    }

    #[inline(always)]
    fn step(&mut self) {
        let [a, b, c, d] = self.held;
        if let Some(line) = self.sum.get_mut(self.first) {
            for j in 0..N {
                line[j] += a[j];
            }
        }
        self.held = [b, c, d, [0.0; N]];
        self.first += 1;
    }
}

vectorised! {
    /// The upper half of the band of A^T A.
    pub fn products(equations: &[(usize, [f64; BAND])], sum: &mut [[f64; BAND]]) -> () {
        let mut gather = Gather::new(sum);
        for &(first, [a, b, c, d]) in equations {
            let shifted = [[a, b, c, d], [b, c, d, 0.0], [c, d, 0.0, 0.0], [d, 0.0, 0.0, 0.0]];
            let heads = [a, b, c, d];
            gather.add(first, std::array::from_fn(|i| shifted[i].map(|x| x * heads[i])));
        }
        gather.finish();
    }
}

/// The same least squares by its normal equations, U^T D U = A^T A: a third of the work of the rotations, for well-conditioned equations.
///
/// The error grows with the square of the condition, so the caller refines once and looks at how far that moved the solution.
pub struct BandedNormal {
    /// Diagonal and three entries right of it of A^T A, then of U with the diagonal inverted.
    rows: Vec<[f64; BAND]>,
}

impl BandedNormal {
    /// Of the equations with coefficients `row` from unknown `first` on, for `columns` unknowns; None where a pivot falls below `least` of its
    /// diagonal entry. O(rows + columns).
    pub fn new(columns: usize, equations: &[(usize, [f64; BAND])], least: f64) -> Option<Self> {
        let mut rows = vec![[0.0; BAND]; columns];
        products(equations, &mut rows);
        // What eliminations have taken from the next rows, so that no row waits for memory; the last is always 0.
        let mut taken = [[0.0; BAND]; BAND];
        for row in &mut rows {
            let line: [f64; BAND] = std::array::from_fn(|j| row[j] - taken[0][j]);
            if line[0].is_nan() || line[0] <= least * row[0] {
                return None;
            }
            let inverse = 1.0 / line[0];
            let unit = [line[1] * inverse, line[2] * inverse, line[3] * inverse];
            for r in 0..BAND - 1 {
                let later = taken[r + 1];
                taken[r] = std::array::from_fn(|j| {
                    let share = if r + j + 1 < BAND {
                        unit[r] * line[r + j + 1]
                    } else {
                        0.0
                    };
                    later[j] + share
                });
            }
            *row = [inverse, unit[0], unit[1], unit[2]];
        }
        Some(Self { rows })
    }

    /// Turns A^T b into the unknowns. O(columns).
    pub fn solve_in_place(&self, x: &mut [[f64; 2]]) {
        let n = self.rows.len();
        let mut ahead = [[0.0; 2]; BAND];
        for i in 0..n {
            let [inverse, a, b, c] = self.rows[i];
            let value = [x[i][0] - ahead[0][0], x[i][1] - ahead[0][1]];
            for (j, u) in [a, b, c].into_iter().enumerate() {
                ahead[j] = std::array::from_fn(|axis| ahead[j + 1][axis] + u * value[axis]);
            }
            x[i] = value.map(|v| v * inverse);
        }
        let mut known = [[0.0; 2]; BAND - 1];
        for i in (0..n).rev() {
            let [_, a, b, c] = self.rows[i];
            let value = std::array::from_fn(|axis| {
                x[i][axis] - a * known[0][axis] - b * known[1][axis] - c * known[2][axis]
            });
            known = [value, known[0], known[1]];
            x[i] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_equations_solve_and_refuse() {
        let truth: Vec<[f64; 2]> = (0..9).map(|i| [i as f64, (i * i) as f64]).collect();
        let row = |i: usize| [1.0 + i as f64 * 0.1, 0.3, (i as f64).sin(), -0.4];
        let equations: Vec<_> = (0..30).map(|i| (i * 6 / 30, row(i))).collect();
        let mut x = vec![[0.0; 2]; 9];
        for (first, row) in &equations {
            for axis in 0..2 {
                let b: f64 = (0..BAND).map(|j| row[j] * truth[first + j][axis]).sum();
                (0..BAND).for_each(|j| x[first + j][axis] += row[j] * b);
            }
        }
        BandedNormal::new(9, &equations, 1e-8)
            .unwrap()
            .solve_in_place(&mut x);
        for (x, t) in x.iter().zip(&truth) {
            assert!(
                (x[0] - t[0]).abs() < 1e-9 && (x[1] - t[1]).abs() < 1e-9,
                "{x:?} {t:?}"
            );
        }
        // Unknown 8 appears in no equation of the first ten.
        assert!(BandedNormal::new(9, &equations[..10], 1e-8).is_none());
    }

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
