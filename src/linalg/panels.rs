//! Vectors several at a time: what many of them need goes through registers once.

use std::slice::{ChunksExact, ChunksExactMut};

use faer::{ColRef, Mat};
use rayon::prelude::*;

use super::dense::columns_mut;
use super::entry::{Eight, Entry, filled};
use super::kernels::LANES;
use super::tiles::write_products;

/// Products that one thread takes before it pays that another helps.
const ALONE: usize = 200_000;

/// How many panels a thread takes at least, of so many products each.
pub fn alone(products: usize) -> usize {
    ALONE / products.max(1) + 1
}

/// The vectors of a matrix in panels: L after L, each panel entry by entry, the last filled up with zero vectors.
#[derive(Clone, Debug)]
pub struct Panels<const L: usize = LANES> {
    vectors: usize,
    length: usize,
    entries: Vec<Entry<L>>,
}

impl<const L: usize> Panels<L> {
    /// Zero vectors of so many entries.
    pub fn zeros(vectors: usize, length: usize) -> Self {
        Self {
            vectors,
            length,
            entries: vec![Entry::ZERO; vectors.div_ceil(L) * length],
        }
    }

    /// The rows of a matrix that is given by its columns, `column(j)` for j < length, each of `rows` numbers.
    pub fn of_rows<'a>(
        rows: usize,
        length: usize,
        column: impl Fn(usize) -> ColRef<'a, f64>,
    ) -> Self {
        let mut panels = Self::zeros(rows, length);
        (0..length).for_each(|j| panels.set_entry(j, column(j)));
        panels
    }

    /// Sets entry j of the vectors to the numbers of a column.
    pub fn set_entry(&mut self, j: usize, column: ColRef<'_, f64>) {
        let entries = self.entries.iter_mut().skip(j).step_by(self.length.max(1));
        match column.try_as_col_major() {
            Some(column) => {
                for (entry, part) in entries.zip(column.as_slice().chunks(L)) {
                    match part.first_chunk() {
                        Some(whole) => entry.0 = *whole,
                        None => entry[..part.len()].copy_from_slice(part),
                    }
                }
            }
            None => {
                let mut numbers = column.iter();
                entries.for_each(|entry| {
                    entry
                        .iter_mut()
                        .zip(&mut numbers)
                        .for_each(|(x, y)| *x = *y)
                });
            }
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
            for (part, entry) in column.chunks_mut(L).zip(entries) {
                for (x, number) in part.iter_mut().zip(entry.iter()) {
                    *x = factor * number;
                }
            }
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

    /// The panels, each `length` entries.
    pub fn iter(&self) -> ChunksExact<'_, Entry<L>> {
        self.entries.chunks_exact(self.length.max(1))
    }

    /// The panels, to be written.
    pub fn iter_mut(&mut self) -> ChunksExactMut<'_, Entry<L>> {
        self.entries.chunks_exact_mut(self.length.max(1))
    }

    /// [`Self::iter_mut`], for several threads.
    pub fn par_iter_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [Entry<L>]> {
        self.entries.par_chunks_exact_mut(self.length.max(1))
    }

    /// The inner products of the vectors with up to eight others, `weights` entry by entry, into a slice for each of these.
    pub fn products(&self, weights: &[Eight], into: &mut [&mut [f64]]) {
        for (first, panel) in (0..self.vectors).step_by(L).zip(self.iter()) {
            write_products(weights, panel, first..(first + L).min(self.vectors), into);
        }
    }
}

impl Panels {
    /// Completes a symmetric matrix of which each panel has the entries from its own rows on.
    pub fn mirror(&mut self) {
        let length = self.length;
        for (p, first) in (0..self.vectors).step_by(LANES).enumerate() {
            let (done, rest) = self.entries.split_at_mut(p * length);
            let panels = done.chunks_exact(length).zip(rest.chunks_mut(LANES));
            for (from, into) in panels {
                into.copy_from_slice(&transpose(&filled(&from[first..])));
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
}

/// The transpose of eight by eight numbers.
#[inline(always)]
fn transpose(x: &[Eight; LANES]) -> [Eight; LANES] {
    std::array::from_fn(|i| Entry(std::array::from_fn(|j| x[j][i])))
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
                .map(|j| Entry(std::array::from_fn(|p| ((p + 7 * j) as f64).cos())))
                .collect();
            let mut found = vec![vec![7.0; rows]; count];
            let panels = Panels::<16>::of_rows(rows, columns, |j| x.col(j));
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
            let panels = Panels::<LANES>::of_rows(rows, columns, |j| x.col(j));
            assert_eq!(panels.rows_matrix(), x);
            assert_eq!(panels.transposed().rows_matrix(), x.transpose());
            let strided = Panels::<LANES>::of_rows(columns, rows, |i| x.row(i).transpose());
            assert_eq!(strided.rows_matrix(), x.transpose());
        }
    }

    #[test]
    fn what_is_mirrored_is_symmetric() {
        for n in [0, 3, 8, 21] {
            let a = Mat::from_fn(n, n, |i, j| (i.min(j) * 30 + i.max(j)) as f64);
            let whole = Panels::<LANES>::of_rows(n, n, |j| a.col(j));
            let mut half = whole.clone();
            for (p, panel) in half.iter_mut().enumerate() {
                panel[..LANES * p].fill(Entry([7.0; LANES]));
            }
            half.mirror();
            assert_eq!(half.rows_matrix(), a);
        }
    }
}
