//! The dissimilarities of frames that a layout in pose space follows (section 3.2.1).

use faer::MatRef;
use rayon::prelude::*;

use crate::linalg::kernels::{LANES, norm_squared, total, vectorised};

/// Dissimilarities that one thread works out before another could begin to help.
const ALONE: usize = 7_500;

/// The dissimilarities delta_ij = ||x_i - x_j||, n x n, kept whole so that rows are contiguous.
#[derive(Clone, Debug)]
pub struct Dissimilarities {
    n: usize,
    values: Vec<f64>,
}

impl Dissimilarities {
    /// From coordinates X, m x n. O(n^2 m).
    pub fn new(coordinates: MatRef<'_, f64>) -> Self {
        let n = coordinates.ncols();
        let x = coordinates.to_owned();
        let mut values = vec![0.0; n * n];
        values
            .par_chunks_mut(n.max(1))
            .with_min_len(ALONE / n.max(1) + 1)
            .enumerate()
            .for_each(|(i, row)| {
                for (j, delta) in row.iter_mut().enumerate() {
                    *delta = separation(x.col_as_slice(i), x.col_as_slice(j));
                }
            });
        Self { n, values }
    }

    /// delta_ij of every pair, which must be symmetric and 0 on the diagonal.
    pub(super) fn from_fn(n: usize, mut delta: impl FnMut(usize, usize) -> f64) -> Self {
        let mut values = Vec::with_capacity(n * n);
        for i in 0..n {
            values.extend((0..n).map(|j| delta(i, j)));
        }
        Self { n, values }
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    /// The greatest of them.
    pub(super) fn greatest(&self) -> f64 {
        self.values.iter().copied().fold(0.0, f64::max)
    }

    /// The sum of squares over all ordered pairs.
    pub(super) fn sum_of_squares(&self) -> f64 {
        norm_squared(&self.values)
    }

    /// delta, n x n.
    pub fn matrix(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.values, self.n, self.n)
    }

    /// delta_i1 .. delta_in.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.n..(i + 1) * self.n]
    }

    /// Rows and columns in another order.
    pub(super) fn permuted(&self, order: &[usize]) -> Self {
        let rows = order.iter().map(|&i| self.row(i));
        let values = rows.flat_map(|row| order.iter().map(|&j| row[j])).collect();
        Self { n: self.n, values }
    }
}

vectorised! {
    /// The distance between two points of the same dimension; symmetric to the bit.
    pub fn separation(a: &[f64], b: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        let (a_chunks, a_rest) = a.as_chunks::<LANES>();
        let (b_chunks, b_rest) = b.as_chunks::<LANES>();
        for (x, y) in a_chunks.iter().zip(b_chunks) {
            for lane in 0..LANES {
                lanes[lane] += (x[lane] - y[lane]) * (x[lane] - y[lane]);
            }
        }
        for ((lane, x), y) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
            *lane += (x - y) * (x - y);
        }
        total(lanes).sqrt()
    }
}
