//! A matrix laid out for products with many vectors.

use faer::MatRef;

use super::kernels::{LANES, vectorised_wider};

/// Eight rows after eight rows, each by columns, the last padded with zeros: what four vectors at a time need of it goes through registers once.
pub struct Panels {
    rows: usize,
    columns: usize,
    blocks: Vec<[f64; LANES]>,
}

impl Panels {
    /// A copy of the matrix.
    pub fn new(matrix: MatRef<'_, f64>) -> Self {
        let (rows, columns) = matrix.shape();
        let mut blocks = vec![[0.0; LANES]; rows.div_ceil(LANES) * columns];
        for (j, column) in matrix.col_iter().enumerate() {
            for (i, &x) in column.iter().enumerate() {
                blocks[i / LANES * columns + j][i % LANES] = x;
            }
        }
        Self {
            rows,
            columns,
            blocks,
        }
    }

    /// y += sum_j a_j x_j over the columns for four vectors y of weights a, with the bits of [`super::kernels::combine`].
    pub fn combine4(&self, a: [&[f64]; 4], mut y: [&mut [f64]; 4]) {
        let panels = self.blocks.chunks_exact(self.columns.max(1));
        for (first, panel) in (0..self.rows).step_by(LANES).zip(panels) {
            let last = (first + LANES).min(self.rows);
            let mut sums = [[0.0; LANES]; 4];
            for (sum, y) in sums.iter_mut().zip(&y) {
                sum[..last - first].copy_from_slice(&y[first..last]);
            }
            combine_panel(a, panel, &mut sums);
            for (sum, y) in sums.iter().zip(&mut y) {
                y[first..last].copy_from_slice(&sum[..last - first]);
            }
        }
    }
}

vectorised_wider! {
    fn combine_panel(a: [&[f64]; 4], columns: &[[f64; LANES]], sums: &mut [[f64; LANES]; 4]) {
        let (fours, rest) = columns.as_chunks::<4>();
        let [a0, a1, a2, a3] = a.map(|a| &a.as_chunks::<4>().0[..fours.len()]);
        let [mut y0, mut y1, mut y2, mut y3] = *sums;
        for (j, four) in fours.iter().enumerate() {
            add4(&a0[j], four, &mut y0);
            add4(&a1[j], four, &mut y1);
            add4(&a2[j], four, &mut y2);
            add4(&a3[j], four, &mut y3);
        }
        *sums = [y0, y1, y2, y3];
        for (sum, a) in sums.iter_mut().zip(a) {
            for (a, x) in a[4 * fours.len()..].iter().zip(rest) {
                for lane in 0..LANES {
                    sum[lane] += a * x[lane];
                }
            }
        }
    }
}

#[inline(always)]
fn add4(a: &[f64; 4], x: &[[f64; LANES]; 4], y: &mut [f64; LANES]) {
    for i in 0..LANES {
        y[i] += (a[0] * x[0][i] + a[1] * x[1][i]) + (a[2] * x[2][i] + a[3] * x[3][i]);
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;
    use crate::linalg::kernels::combine;

    #[test]
    fn four_vectors_have_the_bits_of_each_by_itself() {
        for (rows, columns) in [(0, 3), (3, 0), (7, 5), (8, 4), (21, 14)] {
            let x = Mat::from_fn(rows, columns, |i, j| ((3 * i + 5 * j) as f64).sin());
            let weights = [0, 1, 2, 3].map(|p| -> Vec<f64> {
                (0..columns).map(|j| ((p + 7 * j) as f64).cos()).collect()
            });
            let mut expected = [0, 1, 2, 3].map(|p| vec![0.1 * p as f64; rows]);
            let mut found = expected.clone();
            for (a, y) in weights.iter().zip(&mut expected) {
                combine(a, |j| x.col_as_slice(j), y);
            }
            let weights = weights.each_ref().map(|a| &a[..]);
            Panels::new(x.as_ref()).combine4(weights, found.each_mut().map(|y| &mut y[..]));
            assert_eq!(found, expected);
        }
    }
}
