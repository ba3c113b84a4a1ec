//! Vectors several at a time: what many of them need goes through registers once.

use std::borrow::Borrow;
use std::ops::{Deref, DerefMut, Range};
use std::slice::{ChunksExact, ChunksExactMut};

use faer::{ColRef, Mat};
use rayon::prelude::*;

use super::dense::columns_mut;
use super::kernels::{LANES, fused, has_avx512, one_at_a_time};

/// An entry of L vectors, a multiple of eight. It begins where a cache line does, so that no register is filled from two.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Entry<const L: usize>(pub [f64; L]);

/// An entry of eight vectors.
pub type Eight = Entry<LANES>;

impl<const L: usize> Entry<L> {
    pub const ZERO: Self = Self([0.0; L]);

    /// The numbers of entries, one after the other.
    pub fn flattened(entries: &mut [Self]) -> &mut [f64] {
        const { assert!(size_of::<Self>() == size_of::<[f64; L]>()) };
        // SAFETY: an entry is L numbers and, as has just been asserted, nothing else.
        unsafe { std::slice::from_raw_parts_mut(entries.as_mut_ptr().cast(), L * entries.len()) }
    }
}

impl<const L: usize> Deref for Entry<L> {
    type Target = [f64; L];
    fn deref(&self) -> &[f64; L] {
        &self.0
    }
}

impl<const L: usize> DerefMut for Entry<L> {
    fn deref_mut(&mut self) -> &mut [f64; L] {
        &mut self.0
    }
}

impl<const L: usize> Borrow<[f64; L]> for Entry<L> {
    fn borrow(&self) -> &[f64; L] {
        &self.0
    }
}

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

fused! {
    /// sums_p += sum_i w_ip x_i over the entries of P vectors w, a multiple of four, and L vectors x, in order, each product fused with the sum: W^T X.
    pub fn gather[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], x: &[Entry<L>], sums: &mut [Entry<L>; P]) {
        in_tiles(|w, x, sum| w.mul_add(x, sum), w, x, sums);
    }
}

fused! {
    /// The products W^T X of eight vectors w and L vectors x, of which there are as many as places, into these places of a slice for each w.
    fn write_products[const L: usize](w: &[Eight], x: &[Entry<L>], places: Range<usize>, into: &mut [&mut [f64]]) {
        let mut sums = [Entry::ZERO; LANES];
        in_tiles(|w, x, sum| w.mul_add(x, sum), w, x, &mut sums);
        for (sum, into) in sums.iter().zip(into) {
            write(&mut into[places.clone()], sum);
        }
    }
}

fused! {
    /// sums_p -= sum_i w_ip x_i, as [`gather`] adds it.
    pub fn subtract_gathered[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], x: &[Entry<L>], sums: &mut [Entry<L>; P]) {
        in_tiles(|w, x, sum| (-w).mul_add(x, sum), w, x, sums);
    }
}

/// All sums, as many at a time as there are registers for: AVX-512 has 32 of eight numbers, AVX2 16 of four.
#[inline(always)]
fn in_tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
) {
    const { assert!(P.is_multiple_of(4) && L.is_multiple_of(8)) };
    let (many, sixteens) = (has_avx512(), L.is_multiple_of(16));
    if many && sixteens && P.is_multiple_of(8) {
        for p in (0..P).step_by(8) {
            for lane in (0..L).step_by(16) {
                two_tiles::<_, P, L>(&add, w, x, sums, [p, lane]);
            }
        }
    } else if many && sixteens {
        tiles::<_, P, L, 4, 16>(add, w, x, sums);
    } else if many && P.is_multiple_of(8) {
        tiles::<_, P, L, 8, 8>(add, w, x, sums);
    } else {
        tiles::<_, P, L, 4, 8>(add, w, x, sums);
    }
}

/// All sums, those for Q vectors w and T vectors x at a time.
#[inline(always)]
fn tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize, const Q: usize, const T: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
) {
    for p in (0..P).step_by(Q) {
        for lane in (0..L).step_by(T) {
            let mut own: [[f64; T]; Q] = own(sums, [p, lane]);
            for (w, x) in w.iter().zip(x) {
                add_to(&mut own, &w.borrow()[p..p + Q], &x[lane..lane + T], &add);
            }
            keep(&own, sums, [p, lane]);
        }
    }
}

/// Two tiles of four by sixteen in one pass over x: as one, their loop would be too long for the compiler to unroll, and they would not stay in registers.
#[inline(always)]
fn two_tiles<W: Borrow<[f64; P]>, const P: usize, const L: usize>(
    add: impl Fn(f64, f64, f64) -> f64,
    w: &[W],
    x: &[Entry<L>],
    sums: &mut [Entry<L>; P],
    [p, lane]: [usize; 2],
) {
    let mut first: [[f64; 16]; 4] = own(sums, [p, lane]);
    let mut second: [[f64; 16]; 4] = own(sums, [p + 4, lane]);
    for (w, x) in w.iter().zip(x) {
        let (w, x) = (w.borrow(), &x[lane..lane + 16]);
        add_to(&mut first, &w[p..p + 4], x, &add);
        add_to(&mut second, &w[p + 4..p + 8], x, &add);
    }
    keep(&first, sums, [p, lane]);
    keep(&second, sums, [p + 4, lane]);
}

/// A copy of some sums, so that they stay in registers.
#[inline(always)]
fn own<const P: usize, const L: usize, const Q: usize, const T: usize>(
    sums: &[Entry<L>; P],
    [p, lane]: [usize; 2],
) -> [[f64; T]; Q] {
    std::array::from_fn(|i| std::array::from_fn(|j| sums[p + i][lane + j]))
}

/// Puts a copy back.
#[inline(always)]
fn keep<const P: usize, const L: usize, const Q: usize, const T: usize>(
    own: &[[f64; T]; Q],
    sums: &mut [Entry<L>; P],
    [p, lane]: [usize; 2],
) {
    for (sums, own) in sums[p..].iter_mut().zip(own) {
        sums[lane..lane + T].copy_from_slice(own);
    }
}

/// The products of one entry.
#[inline(always)]
fn add_to<const Q: usize, const T: usize>(
    own: &mut [[f64; T]; Q],
    w: &[f64],
    x: &[f64],
    add: impl Fn(f64, f64, f64) -> f64,
) {
    for (sums, w) in own.iter_mut().zip(w) {
        for (sum, x) in sums.iter_mut().zip(x) {
            *sum = add(*w, *x, *sum);
        }
    }
}

fused! {
    /// x_i -= sum_p w_ip y_p over the entries of P vectors w and L vectors x, in order, each product fused with the sum: X - W Y.
    pub fn subtract_spread[W: Borrow<[f64; P]>, const P: usize, const L: usize](w: &[W], y: &[Entry<L>; P], x: &mut [Entry<L>]) {
        let y = *y;
        for (w, x) in w.iter().zip(x) {
            one_at_a_time();
            for (w, y) in w.borrow().iter().zip(&y) {
                for lane in 0..L {
                    x[lane] = (-w).mul_add(y[lane], x[lane]);
                }
            }
        }
    }
}

/// Writes up to L numbers.
#[inline(always)]
fn write<const L: usize>(into: &mut [f64], numbers: &[f64; L]) {
    match into.as_mut_array() {
        Some(whole) => *whole = *numbers,
        None => into.copy_from_slice(&numbers[..into.len()]),
    }
}

/// The first eight entries, filled up with zeros.
pub fn filled<const L: usize>(entries: &[Entry<L>]) -> [Entry<L>; LANES] {
    std::array::from_fn(|i| entries.get(i).copied().unwrap_or(Entry::ZERO))
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
    fn what_is_subtracted_is_the_product() {
        let entry = |i: usize, p: usize| ((5 * i + 3 * p) as f64).sin();
        let w: Vec<Eight> = (0..11)
            .map(|i| Entry(std::array::from_fn(|p| entry(i, p))))
            .collect();
        let y = std::array::from_fn(|p| Entry(std::array::from_fn(|lane| entry(p, lane + 40))));
        let mut x = vec![Entry([1.0; LANES]); 11];
        subtract_spread(&w, &y, &mut x);
        for (i, x) in x.iter().enumerate() {
            for (lane, x) in x.iter().enumerate() {
                let sum: f64 = (0..LANES).map(|p| w[i][p] * y[p][lane]).sum();
                assert!((1.0 - x - sum).abs() < 1e-14);
            }
        }
        let (mut added, mut subtracted) = ([Entry::ZERO; LANES], [Entry::ZERO; LANES]);
        gather(&w, &x, &mut added);
        subtract_gathered(&w, &x, &mut subtracted);
        assert_eq!(added, subtracted.map(|sums| Entry(sums.map(|x| -x))));
    }

    /// One after the other, whatever the tiles.
    fn sums_are_in_order<const P: usize, const L: usize>() {
        let entry = |i: usize, p: usize| ((7 * i + 3 * p) as f64).sin();
        let w: Vec<[f64; P]> = (0..13)
            .map(|i| std::array::from_fn(|p| entry(i, p)))
            .collect();
        let x: Vec<Entry<L>> = (0..13)
            .map(|i| Entry(std::array::from_fn(|lane| entry(i, lane + 50))))
            .collect();
        let given = std::array::from_fn(|p| Entry(std::array::from_fn(|lane| entry(p, lane))));
        let (mut added, mut subtracted) = (given, given);
        gather(&w, &x, &mut added);
        subtract_gathered(&w, &x, &mut subtracted);
        for p in 0..P {
            for lane in 0..L {
                let products = w.iter().zip(&x).map(|(w, x)| (w[p], x[lane]));
                let [mut plus, mut minus] = [given[p][lane]; 2];
                products.for_each(|(w, x)| {
                    plus = w.mul_add(x, plus);
                    minus = (-w).mul_add(x, minus);
                });
                assert_eq!([added[p][lane], subtracted[p][lane]], [plus, minus]);
            }
        }
    }

    #[test]
    fn sums_of_every_shape_are_in_order() {
        sums_are_in_order::<4, 8>();
        sums_are_in_order::<8, 8>();
        sums_are_in_order::<4, 16>();
        sums_are_in_order::<8, 16>();
        sums_are_in_order::<12, 24>();
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
