//! Vectors eight at a time: what many of them need goes through registers once.

use std::slice::{ChunksExact, ChunksExactMut};

use faer::{ColRef, Mat};
use rayon::prelude::*;

use super::dense::columns_mut;
use super::kernels::{LANES, fused, one_at_a_time};

/// An entry of eight vectors.
pub type Eight = [f64; LANES];

/// Products that one thread takes before it pays that another helps.
const ALONE: usize = 200_000;

/// How many panels a thread takes at least, of so many products each.
pub fn alone(products: usize) -> usize {
    ALONE / products.max(1) + 1
}

/// The vectors of a matrix in panels: eight after eight, each panel entry by entry, the last filled up with zero vectors.
#[derive(Clone, Debug)]
pub struct Panels {
    vectors: usize,
    length: usize,
    entries: Vec<Eight>,
}

impl Panels {
    /// Zero vectors of so many entries.
    pub fn zeros(vectors: usize, length: usize) -> Self {
        Self {
            vectors,
            length,
            entries: vec![[0.0; LANES]; vectors.div_ceil(LANES) * length],
        }
    }

    /// The rows of a matrix that is given by its columns, `column(j)` for j < length, each of `rows` numbers.
    pub fn of_rows<'a>(
        rows: usize,
        length: usize,
        column: impl Fn(usize) -> ColRef<'a, f64>,
    ) -> Self {
        let mut entries = Vec::with_capacity(rows.div_ceil(LANES) * length);
        for first in (0..rows).step_by(LANES) {
            extend_by_rows(&mut entries, first, length, &column);
        }
        Self {
            vectors: rows,
            length,
            entries,
        }
    }

    /// The matrix whose rows are the vectors.
    pub fn rows_matrix(&self) -> Mat<f64> {
        let mut matrix = Mat::zeros(self.vectors, self.length);
        self.write_rows(1.0, &mut columns_mut(matrix.as_mut()));
        matrix
    }

    /// Writes the vectors, times a factor, over the rows of a matrix that is given by its columns.
    pub fn write_rows(&self, factor: f64, columns: &mut [&mut [f64]]) {
        for (j, column) in columns.iter_mut().enumerate().take(self.length) {
            let entries = self.entries.iter().skip(j).step_by(self.length);
            for (eight, entry) in column.chunks_mut(LANES).zip(entries) {
                write(eight, &entry.map(|x| factor * x));
            }
        }
    }

    /// The entries as vectors, and the vectors as entries.
    pub fn transposed(&self) -> Self {
        let mut entries = Vec::with_capacity(self.length.div_ceil(LANES) * self.vectors);
        for block in (0..self.length).step_by(LANES) {
            for (first, panel) in (0..self.vectors).step_by(LANES).zip(self.iter()) {
                let rest = &panel[block..];
                let turned = match rest.first_chunk() {
                    Some(whole) => transpose(whole),
                    None => transpose(&filled(rest)),
                };
                entries.extend_from_slice(&turned[..(self.vectors - first).min(LANES)]);
            }
        }
        Self {
            vectors: self.length,
            length: self.vectors,
            entries,
        }
    }

    /// How many vectors there are.
    pub fn vectors(&self) -> usize {
        self.vectors
    }

    /// How many entries each has.
    pub fn length(&self) -> usize {
        self.length
    }

    /// The panels, each `length` entries of eight vectors.
    pub fn iter(&self) -> ChunksExact<'_, Eight> {
        self.entries.chunks_exact(self.length.max(1))
    }

    /// The panels, to be written.
    pub fn iter_mut(&mut self) -> ChunksExactMut<'_, Eight> {
        self.entries.chunks_exact_mut(self.length.max(1))
    }

    /// [`Self::iter_mut`], for several threads.
    pub fn par_iter_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [Eight]> {
        self.entries.par_chunks_exact_mut(self.length.max(1))
    }

    /// The inner products of the vectors with up to eight others, `weights` entry by entry, into a slice for each of these.
    pub fn products(&self, weights: &[Eight], into: &mut [&mut [f64]]) {
        for (first, panel) in (0..self.vectors).step_by(LANES).zip(self.iter()) {
            let mut sums = [[0.0; LANES]; LANES];
            gather(weights, panel, &mut sums);
            for (sum, into) in sums.iter().zip(into.iter_mut()) {
                write(&mut into[first..(first + LANES).min(self.vectors)], sum);
            }
        }
    }
}

fused! {
    /// sums_p += sum_i w_ip x_i over the entries of P vectors w and eight x, in order, each product fused with the sum: W^T X.
    pub fn gather<const P: usize>(w: &[[f64; P]], x: &[Eight], sums: &mut [Eight; P]) {
        // Of its own, so that it stays in registers.
        let mut own = *sums;
        for (w, x) in w.iter().zip(x) {
            for (sum, w) in own.iter_mut().zip(w) {
                for lane in 0..LANES {
                    sum[lane] = w.mul_add(x[lane], sum[lane]);
                }
            }
        }
        *sums = own;
    }
}

fused! {
    /// sums_p -= sum_i w_ip x_i, as [`gather`] adds it.
    pub fn subtract_gathered<const P: usize>(w: &[[f64; P]], x: &[Eight], sums: &mut [Eight; P]) {
        let mut own = *sums;
        for (w, x) in w.iter().zip(x) {
            for (sum, w) in own.iter_mut().zip(w) {
                for lane in 0..LANES {
                    sum[lane] = (-w).mul_add(x[lane], sum[lane]);
                }
            }
        }
        *sums = own;
    }
}

fused! {
    /// x_i -= sum_p w_ip y_p over the entries of P vectors w and eight x, in order, each product fused with the sum: X - W Y.
    pub fn subtract_spread<const P: usize>(w: &[[f64; P]], y: &[Eight; P], x: &mut [Eight]) {
        let y = *y;
        for (w, x) in w.iter().zip(x) {
            one_at_a_time();
            for (w, y) in w.iter().zip(&y) {
                for lane in 0..LANES {
                    x[lane] = (-w).mul_add(y[lane], x[lane]);
                }
            }
        }
    }
}

/// Adds a panel: rows `first` to `first + 7` of a matrix that is given by its columns, `column(j)` for j < length.
pub fn extend_by_rows<'a>(
    entries: &mut Vec<Eight>,
    first: usize,
    length: usize,
    column: impl Fn(usize) -> ColRef<'a, f64>,
) {
    entries.extend((0..length).map(|j| eight_of(column(j), first)));
}

/// Entries `first` to `first + 7` of a column, filled up with zeros.
#[inline(always)]
fn eight_of(column: ColRef<'_, f64>, first: usize) -> Eight {
    match column.try_as_col_major() {
        Some(column) => {
            let rest = &column.as_slice()[first..];
            match rest.first_chunk() {
                Some(whole) => *whole,
                None => std::array::from_fn(|i| rest.get(i).copied().unwrap_or(0.0)),
            }
        }
        None => std::array::from_fn(|i| column.get(first..).iter().nth(i).copied().unwrap_or(0.0)),
    }
}

/// Writes up to eight numbers.
#[inline(always)]
fn write(into: &mut [f64], eight: &Eight) {
    match into.as_mut_array() {
        Some(whole) => *whole = *eight,
        None => into.copy_from_slice(&eight[..into.len()]),
    }
}

/// The first eight entries, filled up with zeros.
pub fn filled(entries: &[Eight]) -> [Eight; LANES] {
    std::array::from_fn(|i| entries.get(i).copied().unwrap_or([0.0; LANES]))
}

/// The transpose of eight by eight numbers.
#[inline(always)]
fn transpose(x: &[Eight; LANES]) -> [Eight; LANES] {
    std::array::from_fn(|i| std::array::from_fn(|j| x[j][i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::kernels::combine_fused;

    #[test]
    fn vectors_together_have_the_bits_of_each_by_itself() {
        for (rows, columns, count) in [(0, 3, 8), (7, 5, 3), (8, 4, 1), (21, 14, 8)] {
            let x = Mat::from_fn(rows, columns, |i, j| ((3 * i + 5 * j) as f64).sin());
            let weights: Vec<Eight> = (0..columns)
                .map(|j| std::array::from_fn(|p| ((p + 7 * j) as f64).cos()))
                .collect();
            let mut found = vec![vec![7.0; rows]; count];
            let panels = Panels::of_rows(rows, columns, |j| x.col(j));
            let mut into: Vec<&mut [f64]> = found.iter_mut().map(|y| &mut y[..]).collect();
            panels.products(&weights, &mut into);
            for (p, found) in found.iter().enumerate() {
                let own: Vec<f64> = weights.iter().map(|w| w[p]).collect();
                let mut expected = vec![0.0; rows];
                combine_fused(&own, |j| x.col_as_slice(j), &mut expected);
                assert_eq!(*found, expected);
            }
        }
    }

    #[test]
    fn rows_are_kept_and_transposed() {
        for (rows, columns) in [(0, 3), (3, 0), (5, 9), (16, 8), (21, 30)] {
            let x = Mat::from_fn(rows, columns, |i, j| (100 * i + j) as f64);
            let panels = Panels::of_rows(rows, columns, |j| x.col(j));
            assert_eq!(panels.rows_matrix(), x);
            assert_eq!(panels.transposed().rows_matrix(), x.transpose());
            let strided = Panels::of_rows(columns, rows, |i| x.row(i).transpose());
            assert_eq!(strided.rows_matrix(), x.transpose());
        }
    }

    #[test]
    fn what_is_subtracted_is_the_product() {
        let entry = |i: usize, p: usize| ((5 * i + 3 * p) as f64).sin();
        let w: Vec<Eight> = (0..11)
            .map(|i| std::array::from_fn(|p| entry(i, p)))
            .collect();
        let y = std::array::from_fn(|p| std::array::from_fn(|lane| entry(p, lane + 40)));
        let mut x = vec![[1.0; LANES]; 11];
        subtract_spread(&w, &y, &mut x);
        for (i, x) in x.iter().enumerate() {
            for (lane, x) in x.iter().enumerate() {
                let sum: f64 = (0..LANES).map(|p| w[i][p] * y[p][lane]).sum();
                assert!((1.0 - x - sum).abs() < 1e-14);
            }
        }
        let (mut added, mut subtracted) = ([[0.0; LANES]; LANES], [[0.0; LANES]; LANES]);
        gather(&w, &x, &mut added);
        subtract_gathered(&w, &x, &mut subtracted);
        assert_eq!(added, subtracted.map(|sums| sums.map(|x| -x)));
    }
}
