//! A matrix laid out for products with many vectors at a time.

use faer::MatRef;

use super::kernels::{LANES, fused};

/// Vectors that go through registers together.
pub const TOGETHER: usize = 8;

/// Eight rows after eight rows, each by columns, the last padded with zeros: what eight vectors at a time need of it goes through registers once.
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

    /// y += sum_j a_j x_j over the columns for several vectors y of weights a, with the bits of [`super::kernels::combine_fused`].
    pub fn combine(&self, a: [&[f64]; TOGETHER], y: &mut [&mut [f64]; TOGETHER]) {
        let panels = self.blocks.chunks_exact(self.columns.max(1));
        for (first, panel) in (0..self.rows).step_by(LANES).zip(panels) {
            let last = (first + LANES).min(self.rows);
            let mut sums = [[0.0; LANES]; TOGETHER];
            for (sum, y) in sums.iter_mut().zip(y.iter()) {
                sum[..last - first].copy_from_slice(&y[first..last]);
            }
            combine_panel(a, panel, &mut sums);
            for (sum, y) in sums.iter().zip(y.iter_mut()) {
                y[first..last].copy_from_slice(&sum[..last - first]);
            }
        }
    }
}

fused! {
    fn combine_panel(a: [&[f64]; TOGETHER], columns: &[[f64; LANES]], sums: &mut [[f64; LANES]; TOGETHER]) {
        let a = a.map(|a| &a[..columns.len()]);
        // Of its own, so that it stays in registers.
        let mut own = *sums;
        for (j, x) in columns.iter().enumerate() {
            for (sum, a) in own.iter_mut().zip(a) {
                for lane in 0..LANES {
                    sum[lane] = a[j].mul_add(x[lane], sum[lane]);
                }
            }
        }
        *sums = own;
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;
    use crate::linalg::kernels::combine_fused;

    #[test]
    fn vectors_together_have_the_bits_of_each_by_itself() {
        for (rows, columns) in [(0, 3), (3, 0), (7, 5), (8, 4), (21, 14)] {
            let x = Mat::from_fn(rows, columns, |i, j| ((3 * i + 5 * j) as f64).sin());
            let weights = std::array::from_fn::<_, TOGETHER, _>(|p| -> Vec<f64> {
                (0..columns).map(|j| ((p + 7 * j) as f64).cos()).collect()
            });
            let mut expected =
                std::array::from_fn::<_, TOGETHER, _>(|p| vec![0.1 * p as f64; rows]);
            let mut found = expected.clone();
            for (a, y) in weights.iter().zip(&mut expected) {
                combine_fused(a, |j| x.col_as_slice(j), y);
            }
            let weights = weights.each_ref().map(|a| &a[..]);
            Panels::new(x.as_ref()).combine(weights, &mut found.each_mut().map(|y| &mut y[..]));
            assert_eq!(found, expected);
        }
    }
}
