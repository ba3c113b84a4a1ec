//! The Gram matrix of many long vectors: their inner products with each other.

use faer::{Mat, MatRef};

use super::entry::{Eight, Entry};
use super::kernels::{LANES, dot, fused, has_avx512, one_at_a_time, total};

/// Vectors on each side of a tile of the matrix: sixteen inner products from eight vectors.
const TILE: usize = 4;

/// The lower triangle of a Gram matrix, as it is added up from blocks of the vectors' entries.
#[derive(Clone, Debug)]
pub struct Gram {
    vectors: usize,
    /// Row after row of tiles, each column by column.
    tiles: Vec<[[f64; TILE]; TILE]>,
}

impl Gram {
    /// No entries yet.
    pub fn zeros(vectors: usize) -> Self {
        let rows = vectors.div_ceil(TILE);
        Self {
            vectors,
            tiles: vec![[[0.0; TILE]; TILE]; rows * (rows + 1) / 2],
        }
    }

    /// Adds a block of the entries, rows x vectors. Its columns must be contiguous, as those of a [`Mat`] are: others would be left out. About
    /// rows * vectors^2 flops.
    ///
    /// Each inner product is summed in eight lanes, each product fused with its sum, whatever the instruction set; the last rows mod 8 follow by themselves.
    pub fn add(&mut self, block: MatRef<'_, f64>) {
        let columns = block.col_iter().filter_map(|x| x.try_as_col_major());
        let (columns, rests): (Vec<_>, Vec<_>) = columns
            .map(|column| column.as_slice().as_chunks::<LANES>())
            .unzip();
        let fours: Vec<[_; TILE]> = columns.chunks(TILE).map(repeated).collect();
        let mut lanes = [[Entry::ZERO; TILE]; TILE];
        let mut tiles = self.tiles.iter_mut();
        for (i, a) in fours.iter().enumerate() {
            for (b, tile) in fours[..=i].iter().zip(&mut tiles) {
                inner_products(a, b, &mut lanes);
                for (sum, lanes) in tile.as_flattened_mut().iter_mut().zip(lanes.as_flattened()) {
                    *sum += total(lanes.0);
                }
            }
        }
        if !block.nrows().is_multiple_of(LANES) {
            self.add_rests(&rests);
        }
    }

    /// Adds a few more entries of the vectors.
    fn add_rests(&mut self, rests: &[&[f64]]) {
        let fours: Vec<[_; TILE]> = rests.chunks(TILE).map(repeated).collect();
        let mut tiles = self.tiles.iter_mut();
        for (i, a) in fours.iter().enumerate() {
            for (b, tile) in fours[..=i].iter().zip(&mut tiles) {
                for (b, sums) in b.iter().zip(tile) {
                    for (a, sum) in a.iter().zip(sums) {
                        *sum += dot(a, b);
                    }
                }
            }
        }
    }

    /// The sum with other entries of the same vectors.
    pub fn plus(mut self, other: Self) -> Self {
        let others = other.tiles.as_flattened().as_flattened();
        let sums = self.tiles.as_flattened_mut().as_flattened_mut();
        sums.iter_mut().zip(others).for_each(|(sum, x)| *sum += x);
        self
    }

    /// The matrix, vectors x vectors, zero above the diagonal.
    pub fn lower(&self) -> Mat<f64> {
        Mat::from_fn(self.vectors, self.vectors, |i, j| {
            let (row, column) = (i / TILE, j / TILE);
            match i >= j {
                true => self.tiles[row * (row + 1) / 2 + column][j % TILE][i % TILE],
                false => 0.0,
            }
        })
    }
}

/// Four vectors, the last of them again where there are fewer.
fn repeated<T: Copy>(vectors: &[T]) -> [T; TILE] {
    std::array::from_fn(|p| vectors[p.min(vectors.len() - 1)])
}

fused! {
    /// The inner products of four vectors a with four vectors b, all of one length: `products[q][p]` has the lanes of a_p and b_q.
    fn inner_products(a: &[&[[f64; LANES]]; TILE], b: &[&[[f64; LANES]]; TILE], products: &mut [[Eight; TILE]; TILE]) {
        if has_avx512() {
            with_several(a, b, products);
        } else {
            for (b, products) in b.iter().zip(products) {
                with_several(a, &[*b], std::array::from_mut(products));
            }
        }
    }
}

/// The inner products with Q vectors in one passage: with as many as there are registers for.
#[inline(always)]
fn with_several<const Q: usize>(
    a: &[&[[f64; LANES]]; TILE],
    b: &[&[[f64; LANES]]; Q],
    products: &mut [[Eight; TILE]; Q],
) {
    let length = a[0].len();
    let (a, b) = (a.map(|a| &a[..length]), b.map(|b| &b[..length]));
    let mut own = [[[0.0; LANES]; TILE]; Q];
    for i in 0..length {
        // Copied first: the compiler would gather lanes otherwise.
        let x = a.map(|a| a[i]);
        one_at_a_time();
        for (sums, b) in own.iter_mut().zip(b) {
            let y = b[i];
            for (sums, x) in sums.iter_mut().zip(&x) {
                for ((sum, x), y) in sums.iter_mut().zip(x).zip(&y) {
                    *sum = x.mul_add(*y, *sum);
                }
            }
        }
    }
    for (sums, own) in products.iter_mut().zip(own) {
        for (sum, own) in sums.iter_mut().zip(own) {
            sum.0 = own;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_triangle_has_every_inner_product() {
        for (rows, vectors) in [(0, 3), (5, 1), (8, 4), (41, 7), (100, 12)] {
            let x = Mat::from_fn(rows, vectors, |i, j| ((3 * i + 5 * j) as f64).sin());
            let (mut first, mut second) = (Gram::zeros(vectors), Gram::zeros(vectors));
            first.add(x.subrows(0, rows / 3));
            second.add(x.subrows(rows / 3, rows - rows / 3));
            let found = first.plus(second).lower();
            let expected = x.transpose() * &x;
            for i in 0..vectors {
                for j in 0..vectors {
                    let expected = if i >= j { expected[(i, j)] } else { 0.0 };
                    assert!((found[(i, j)] - expected).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn several_at_a_time_have_the_bits_of_one() {
        let x = Mat::from_fn(40, 8, |i, j| ((7 * i + 3 * j) as f64).cos());
        let four = |first: usize| {
            std::array::from_fn(|p| x.col_as_slice(first + p).as_chunks::<LANES>().0)
        };
        let (a, b): ([_; TILE], [_; TILE]) = (four(0), four(4));
        let (mut at_once, mut picked) = ([[Entry::ZERO; TILE]; TILE], [[Entry::ZERO; TILE]; TILE]);
        with_several(&a, &b, &mut at_once);
        inner_products(&a, &b, &mut picked);
        assert_eq!(at_once, picked);
        for (q, b) in b.iter().enumerate() {
            for (p, a) in a.iter().enumerate() {
                let mut lanes = [0.0; LANES];
                for (x, y) in a.iter().zip(*b) {
                    lanes = std::array::from_fn(|lane| x[lane].mul_add(y[lane], lanes[lane]));
                }
                assert_eq!(at_once[q][p].0, lanes);
            }
        }
    }
}
