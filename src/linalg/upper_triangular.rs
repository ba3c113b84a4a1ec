//! An upper triangular matrix in panels, as a QR or a Cholesky factorisation leaves it, and its solutions for several vectors at a time.

use super::entry::{Eight, Entry, filled};
use super::kernels::{LANES, fused};
use super::panels::Panels;
use super::tiles::{subtract_gathered, subtract_spread};

/// R, upper triangular: its columns in panels of eight, each down to the diagonal.
#[derive(Clone, Debug, Default)]
pub struct UpperTriangular {
    /// Panel p has 8 p entries above the corner and 8 of the corner, whose entries below the diagonal are not read.
    entries: Vec<Eight>,
    /// 1 / R_ii, and 0 where R_ii is 0.
    inverses: Vec<Eight>,
}

impl UpperTriangular {
    /// R of A = R^T R, with a positive diagonal, for a symmetric positive definite A of as many vectors as entries, of which the lower triangle is read;
    /// None where it is not positive definite. O(n^3 / 3).
    pub fn cholesky(a: &Panels) -> Option<Self> {
        let panels = a.vectors().div_ceil(LANES);
        let mut factor = Self {
            entries: Vec::with_capacity(start(panels)),
            inverses: Vec::with_capacity(panels),
        };
        let mut above = Vec::with_capacity(a.length());
        for (first, panel) in (0..a.vectors()).step_by(LANES).zip(a.iter()) {
            above.clear();
            above.extend_from_slice(&panel[..first]);
            factor.solve_transposed(&mut above);
            let mut rest = bordered(&panel[first..]);
            subtract_gathered(&above, &above, &mut rest);
            factor.push(&above, &corner_factor(&rest)?);
        }
        Some(factor)
    }

    /// Adds eight columns: what is above the corner, and the corner. Where its diagonal is 0, so will be the solutions.
    pub fn push(&mut self, above: &[Eight], corner: &[Eight; LANES]) {
        let inverse = |d: f64| if d == 0.0 { 0.0 } else { 1.0 / d };
        self.inverses
            .push(Entry(std::array::from_fn(|i| inverse(corner[i][i]))));
        self.entries.extend_from_slice(above);
        self.entries.extend_from_slice(corner);
    }

    /// The number of panels.
    fn count(&self) -> usize {
        self.inverses.len()
    }

    /// Above the corner of a panel, and the corner.
    fn panel(&self, p: usize) -> (&[Eight], &[Eight; LANES]) {
        let first = start(p);
        let (above, rest) = self.entries[first..].split_at(LANES * p);
        (above, rest.first_chunk().expect("a panel has a corner"))
    }

    /// Replaces L vectors b, entry by entry, by R^-1 b: as many entries as R has columns, in whole eights.
    pub fn solve<const L: usize>(&self, b: &mut [Entry<L>]) {
        for p in (0..self.count()).rev() {
            let (above, corner) = self.panel(p);
            let (head, x) = part(b, p);
            solve_corner(corner, &self.inverses[p], x);
            subtract_spread(above, x, head);
        }
    }

    /// Replaces L vectors b, entry by entry, by R^-T b.
    pub fn solve_transposed<const L: usize>(&self, b: &mut [Entry<L>]) {
        for p in 0..self.count() {
            let (above, corner) = self.panel(p);
            let (head, x) = part(b, p);
            subtract_gathered(above, head, x);
            solve_corner_transposed(corner, &self.inverses[p], x);
        }
    }
}

/// The entries of panels before panel p.
fn start(p: usize) -> usize {
    LANES * (p * (p + 1) / 2)
}

/// The entries before those of a panel, and its own.
fn part<const L: usize>(b: &mut [Entry<L>], p: usize) -> (&mut [Entry<L>], &mut [Entry<L>; LANES]) {
    let (head, rest) = b.split_at_mut(LANES * p);
    (head, rest.first_chunk_mut().expect("eight entries a panel"))
}

/// Eight rows of a corner of a symmetric matrix, filled up by those of the identity.
fn bordered(corner: &[Eight]) -> [Eight; LANES] {
    let mut eight = filled(corner);
    for i in corner.len()..LANES {
        eight.iter_mut().for_each(|row| row[i] = 0.0);
        eight[i][i] = 1.0;
    }
    eight
}

/// R with A = R^T R for eight columns of a symmetric matrix.
fn corner_factor(a: &[Eight; LANES]) -> Option<[Eight; LANES]> {
    let mut r = *a;
    for i in 0..LANES {
        // What the rows above have left of row i, which by symmetry is column i of A from the diagonal on.
        let mut row: [f64; LANES] = std::array::from_fn(|j| a[i.min(j)][i.max(j)]);
        for above in &r[..i] {
            for j in i..LANES {
                row[j] -= above[i] * above[j];
            }
        }
        if !(row[i] > 0.0 && row[i] < f64::INFINITY) {
            return None;
        }
        let root = row[i].sqrt();
        r[i] = Entry(row.map(|x| x / root));
        r[i][i] = root;
    }
    Some(r)
}

fused! {
    fn solve_corner[const L: usize](corner: &[Eight; LANES], inverses: &Eight, x: &mut [Entry<L>; LANES]) {
        for first in (0..L).step_by(LANES) {
            let mut own: [[f64; LANES]; LANES] = std::array::from_fn(|i| std::array::from_fn(|lane| x[i][first + lane]));
            for i in (0..LANES).rev() {
                let mut sum = own[i];
                // The latest last: the others need not wait for it.
                for j in (i + 1..LANES).rev() {
                    for lane in 0..LANES {
                        sum[lane] = (-corner[i][j]).mul_add(own[j][lane], sum[lane]);
                    }
                }
                own[i] = sum.map(|x| x * inverses[i]);
            }
            for (x, own) in x.iter_mut().zip(&own) {
                x[first..first + LANES].copy_from_slice(own);
            }
        }
    }
}

fused! {
    fn solve_corner_transposed[const L: usize](corner: &[Eight; LANES], inverses: &Eight, x: &mut [Entry<L>; LANES]) {
        for first in (0..L).step_by(LANES) {
            let mut own: [[f64; LANES]; LANES] = std::array::from_fn(|i| std::array::from_fn(|lane| x[i][first + lane]));
            for i in 0..LANES {
                let mut sum = own[i];
                for j in 0..i {
                    for lane in 0..LANES {
                        sum[lane] = (-corner[j][i]).mul_add(own[j][lane], sum[lane]);
                    }
                }
                own[i] = sum.map(|x| x * inverses[i]);
            }
            for (x, own) in x.iter_mut().zip(&own) {
                x[first..first + LANES].copy_from_slice(own);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    /// A positive definite matrix, and right sides for eight vectors.
    fn system(n: usize) -> (Mat<f64>, Vec<Eight>) {
        let root = Mat::from_fn(n + 3, n, |i, j| ((i + 2) as f64 * (j as f64 + 0.7)).sin());
        let x = |i: usize, lane: usize| ((3 * i + 5 * lane) as f64).cos();
        let x = (0..n).map(|i| Entry(std::array::from_fn(|lane| x(i, lane))));
        (root.transpose() * &root, x.collect())
    }

    #[test]
    fn cholesky_solves_what_is_positive_definite_and_refuses_the_rest() {
        for n in [0, 5, 8, 24, 43] {
            let (a, x) = system(n);
            let panels = |sign: f64| {
                let a = sign * &a;
                Panels::of_rows(n, n, |j| a.col(j))
            };
            let factor = UpperTriangular::cholesky(&panels(1.0)).unwrap();
            let mut b: Vec<Eight> = (0..n)
                .map(|i| {
                    let product = |lane: usize| (0..n).map(|j| a[(i, j)] * x[j][lane]).sum();
                    Entry(std::array::from_fn(product))
                })
                .collect();
            b.resize(n.next_multiple_of(LANES), Entry::ZERO);
            factor.solve_transposed(&mut b);
            factor.solve(&mut b);
            for (b, x) in b.iter().zip(&x) {
                assert!(
                    b.iter().zip(x.iter()).all(|(b, x)| (b - x).abs() < 1e-6),
                    "{b:?} {x:?}"
                );
            }
            assert_eq!(UpperTriangular::cholesky(&panels(-1.0)).is_some(), n == 0);
        }
    }
}
