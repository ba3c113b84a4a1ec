//! A QR factorisation by Householder's reflections, eight columns at a time in panels (Schreiber & Van Loan 1989): for matrices that fit in a cache, where it
//! takes half of the time of faer's.

use super::entry::{Eight, Entry};
use super::kernels::{LANES, fused, total};
use super::panels::Panels;
use super::tiles::{gather, subtract_gathered, subtract_spread};
use super::upper_triangular::UpperTriangular;

/// A = Q R for a matrix A with at least as many rows as columns.
#[derive(Clone, Debug)]
pub struct Reflections {
    blocks: Vec<BlockReflection>,
    r: UpperTriangular,
}

impl Reflections {
    /// Factors the matrix whose columns are some vectors. O(entries vectors^2).
    pub fn new(mut a: Panels) -> Self {
        let columns = a.vectors();
        let mut found = Self {
            blocks: Vec::new(),
            r: UpperTriangular::default(),
        };
        for (first, panel) in (0..columns).step_by(LANES).zip(a.iter_mut()) {
            found.apply_transpose(panel);
            let (above, rest) = panel.split_at_mut(first);
            let (block, corner) = BlockReflection::of(rest, (columns - first).min(LANES));
            found.blocks.push(block);
            found.r.push(above, &corner);
        }
        found
    }

    /// Replaces L vectors b, entry by entry, by Q^T b, with the full square Q.
    pub fn apply_transpose<const L: usize>(&self, b: &mut [Entry<L>]) {
        for (i, block) in self.blocks.iter().enumerate() {
            block.apply_transpose(&mut b[LANES * i..]);
        }
    }

    /// Replaces L vectors b, entry by entry, by Q b, with the full square Q.
    pub fn apply<const L: usize>(&self, b: &mut [Entry<L>]) {
        for (i, block) in self.blocks.iter().enumerate().rev() {
            block.apply(&mut b[LANES * i..]);
        }
    }

    /// R, whose diagonal may have any sign.
    pub fn r(&self) -> &UpperTriangular {
        &self.r
    }
}

/// The product of P reflections, Q = I - V T V^T.
#[derive(Clone, Debug)]
pub struct BlockReflection<const P: usize = LANES> {
    /// V, row by row.
    vectors: Vec<[f64; P]>,
    t: [[f64; P]; P],
    t_transposed: [[f64; P]; P],
}

impl<const P: usize> BlockReflection<P> {
    /// What reduces a matrix of P columns, given row by row, to a triangle, for the first `count` columns, at most P and 8; and this triangle.
    /// O(rows count).
    pub fn of_few(rows: &[[f64; P]], count: usize) -> (Self, UpperTriangular) {
        let entry = |row: &[f64; P]| std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
        let mut panel: Vec<Eight> = rows.iter().map(|row| Entry(entry(row))).collect();
        let (found, corner) = Self::of(&mut panel, count.min(P).min(LANES));
        let mut r = UpperTriangular::default();
        r.push(&[], &corner);
        (found, r)
    }

    /// What reduces the first `count` of eight columns to a triangle; and this triangle, 0 in the other columns.
    fn of(columns: &mut [Eight], count: usize) -> (Self, [Eight; LANES]) {
        let (corner, taus) = reflect(columns, count);
        let t: [[f64; P]; P] = together(columns, &taus);
        let vectors = columns.iter().map(|row| std::array::from_fn(|k| row[k]));
        let found = Self {
            vectors: vectors.collect(),
            t_transposed: std::array::from_fn(|i| std::array::from_fn(|j| t[j][i])),
            t,
        };
        (found, corner)
    }

    /// Replaces L vectors b, entry by entry, by Q^T b.
    pub fn apply_transpose<const L: usize>(&self, b: &mut [Entry<L>]) {
        self.subtract(&self.t, b);
    }

    /// Replaces L vectors b, entry by entry, by Q b.
    pub fn apply<const L: usize>(&self, b: &mut [Entry<L>]) {
        self.subtract(&self.t_transposed, b);
    }

    /// Subtracts V S^T V^T b.
    fn subtract<const L: usize>(&self, s: &[[f64; P]; P], b: &mut [Entry<L>]) {
        let mut turned = [Entry::ZERO; P];
        gather(s, &self.products(b), &mut turned);
        subtract_spread(&self.vectors, &turned, b);
    }

    /// V^T b.
    fn products<const L: usize>(&self, b: &[Entry<L>]) -> [Entry<L>; P] {
        let mut sums = [Entry::ZERO; P];
        gather(&self.vectors, b, &mut sums);
        sums
    }
}

impl BlockReflection<4> {
    /// Replaces a symmetric matrix A by Q^T A Q = A - V Z - Z^T V^T, where Z = T^T (V^T A - H V^T) and H = V^T A V T / 2.
    pub fn conjugate(&self, a: &mut Panels) {
        let v: Vec<[Eight; 4]> = self.vectors.chunks(LANES).map(columns).collect();
        let mut z: Vec<[Eight; 4]> = a.iter().map(|panel| self.products(panel)).collect();
        let h = self.half(&v, &z);
        for (z, v) in z.iter_mut().zip(&v) {
            let mut inner = *z;
            subtract_gathered(&h, v, &mut inner);
            *z = [Entry::ZERO; 4];
            gather(&self.t, &inner, z);
        }
        let entry = |i: usize, k: usize| match k {
            0..4 => self.vectors[i][k],
            _ => z[i / LANES][k - 4][i % LANES],
        };
        let both: Vec<[f64; LANES]> = (0..self.vectors.len())
            .map(|i| std::array::from_fn(|k| entry(i, k)))
            .collect();
        for ((panel, z), v) in a.iter_mut().zip(&z).zip(&v) {
            let other = std::array::from_fn(|k| if k < 4 { z[k] } else { v[k - 4] });
            subtract_spread::<_, LANES, LANES>(&both, &other, panel);
        }
    }

    /// H^T, from V and A V.
    fn half(&self, v: &[[Eight; 4]], av: &[[Eight; 4]]) -> [[f64; 4]; 4] {
        let mut lanes = [[Entry::ZERO; 4]; 4];
        for (v, av) in v.iter().zip(av) {
            for (sums, av) in lanes.iter_mut().zip(av) {
                for (sum, v) in sums.iter_mut().zip(v) {
                    (0..LANES).for_each(|lane| sum[lane] += av[lane] * v[lane]);
                }
            }
        }
        let vav = lanes.map(|row| row.map(|lanes| total(*lanes)));
        let entry = |i: usize, k: usize| (0..4).map(|j| vav[i][j] * self.t[j][k]).sum::<f64>();
        std::array::from_fn(|k| std::array::from_fn(|i| 0.5 * entry(i, k)))
    }
}

/// The columns of up to eight rows, filled up with zeros.
fn columns<const P: usize>(rows: &[[f64; P]]) -> [Eight; P] {
    let entry = |i: usize, k: usize| rows.get(i).map_or(0.0, |row| row[k]);
    std::array::from_fn(|k| Entry(std::array::from_fn(|i| entry(i, k))))
}

/// Reduces the first `count` of eight columns to a triangle, which is given back with the scales tau of the reflections I - tau v v^T; their
/// vectors take the columns' place. The other columns become 0.
fn reflect(columns: &mut [Eight], count: usize) -> ([Eight; LANES], Eight) {
    let (mut corner, mut taus) = ([Entry::ZERO; LANES], Entry::ZERO);
    for k in 0..count.min(columns.len()) {
        let rows = &mut columns[k..];
        // The products of column k with all eight.
        let products = products(rows, k);
        let [head, norm] = [rows[0][k], products[k].sqrt()];
        let diagonal = if head > 0.0 { -norm } else { norm };
        // With v = x - diagonal e: v . v / 2 = |x|^2 - diagonal x_0.
        let half = products[k] - diagonal * head;
        taus[k] = if half > 0.0 { 1.0 / half } else { 0.0 };
        let mut shares = Entry::ZERO;
        for lane in k + 1..LANES {
            shares[lane] = taus[k] * (products[lane] - diagonal * rows[0][lane]);
        }
        rows[0][k] -= diagonal;
        subtract(rows, k, &shares);
        corner[k][k] = diagonal;
        corner[k][k + 1..].copy_from_slice(&rows[0][k + 1..]);
        rows[0][k + 1..].fill(0.0);
    }
    for entry in columns.iter_mut() {
        entry[count..].fill(0.0);
    }
    (corner, taus)
}

/// T of I - V T V^T, the product of I - tau_k v_k v_k^T in the order of k: upper triangular.
fn together<const P: usize>(vectors: &[Eight], taus: &Eight) -> [[f64; P]; P] {
    let mut gram = [Entry::ZERO; LANES];
    gather(vectors, vectors, &mut gram);
    let mut t = [[0.0; P]; P];
    for k in 0..P {
        for i in 0..k {
            let sum: f64 = (i..k).map(|j| t[i][j] * gram[j][k]).sum();
            t[i][k] = -taus[k] * sum;
        }
        t[k][k] = taus[k];
    }
    t
}

/// Vector k's products with all eight.
fn products(vectors: &[Eight], k: usize) -> Eight {
    let mut sums = [Entry::ZERO; 4];
    products_in_four(vectors, k, &mut sums);
    let sum = |lane: usize| (sums[0][lane] + sums[2][lane]) + (sums[1][lane] + sums[3][lane]);
    Entry(std::array::from_fn(sum))
}

fused! {
    /// Every fourth entry in a sum of its own, so that one does not wait for the other.
    fn products_in_four(vectors: &[Eight], k: usize, sums: &mut [Eight; 4]) {
        let k = k % LANES;
        let mut own = *sums;
        let (fours, rest) = vectors.as_chunks::<4>();
        for four in fours {
            for (sum, x) in own.iter_mut().zip(four) {
                for lane in 0..LANES {
                    sum[lane] = x[k].mul_add(x[lane], sum[lane]);
                }
            }
        }
        for (sum, x) in own.iter_mut().zip(rest) {
            for lane in 0..LANES {
                sum[lane] = x[k].mul_add(x[lane], sum[lane]);
            }
        }
        *sums = own;
    }
}

fused! {
    /// Takes from each vector its share of vector k.
    fn subtract(vectors: &mut [Eight], k: usize, shares: &Eight) {
        let k = k % LANES;
        for x in vectors {
            let factor = -x[k];
            for lane in 0..LANES {
                x[lane] = factor.mul_add(shares[lane], x[lane]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::Mat;

    use super::*;

    fn sample(rows: usize, columns: usize) -> Mat<f64> {
        Mat::from_fn(rows, columns, |i, j| {
            ((i + 2) as f64 * (j as f64 + 0.7)).sin()
        })
    }

    /// The columns of a matrix in panels.
    fn panels(a: &Mat<f64>) -> Panels {
        Panels::of_rows(a.ncols(), a.nrows(), |i| a.row(i).transpose())
    }

    #[test]
    fn least_squares_have_the_residual_at_right_angles() {
        for (rows, columns) in [(1, 1), (5, 3), (8, 8), (30, 8), (41, 19), (64, 40)] {
            let (a, x) = (sample(rows, columns), sample(columns, 8));
            let qr = Reflections::new(panels(&a));
            let noise = Mat::from_fn(rows, 8, |i, j| ((7 * i + 11 * j) as f64).cos());
            let b = &a * &x + &noise;
            let mut panel: Vec<Eight> = (0..rows)
                .map(|i| Entry(std::array::from_fn(|lane| b[(i, lane)])))
                .collect();
            qr.apply_transpose(&mut panel);
            panel.resize(rows.max(columns.next_multiple_of(LANES)), Entry::ZERO);
            qr.r().solve(&mut panel);
            let found = Mat::from_fn(columns, 8, |i, lane| panel[i][lane]);
            let residual = &b - &a * found;
            assert!(
                (a.transpose() * residual).norm_max() < 1e-11,
                "{rows} x {columns}"
            );
        }
    }

    #[test]
    fn what_is_applied_both_ways_is_as_it_was() {
        let a = sample(37, 21);
        let qr = Reflections::new(panels(&a));
        let given: Vec<Eight> = (0..37)
            .map(|i| Entry(std::array::from_fn(|lane| ((i * 3 + lane) as f64).cos())))
            .collect();
        let mut b = given.clone();
        qr.apply_transpose(&mut b);
        let norm = |b: &[Eight]| b.iter().flat_map(|x| **x).map(|x| x * x).sum::<f64>();
        assert!((norm(&b) - norm(&given)).abs() < 1e-12 * norm(&given));
        qr.apply(&mut b);
        for (b, given) in b.iter().zip(&given) {
            assert!(
                b.iter()
                    .zip(given.iter())
                    .all(|(b, g)| (b - g).abs() < 1e-13)
            );
        }
    }

    #[test]
    fn what_is_conjugated_is_applied_from_both_sides() {
        for (rows, count) in [(1, 1), (7, 2), (8, 3), (29, 4)] {
            let few: Vec<[f64; 4]> = (0..rows)
                .map(|i| {
                    std::array::from_fn(|k| {
                        if k < count {
                            (i as f64 * (k as f64 + 0.3)).cos()
                        } else {
                            0.0
                        }
                    })
                })
                .collect();
            let (q, _) = BlockReflection::of_few(&few, count.min(rows));
            let a = Mat::from_fn(rows, rows, |i, j| ((i * j + i + j) as f64).sin());
            let mut once = panels(&a);
            q.conjugate(&mut once);
            let mut twice = panels(&a);
            twice.iter_mut().for_each(|panel| q.apply_transpose(panel));
            let mut twice = twice.transposed();
            twice.iter_mut().for_each(|panel| q.apply_transpose(panel));
            let difference = once.rows_matrix() - twice.rows_matrix();
            assert!(
                difference.norm_max() < 1e-13,
                "{rows} {count}: {difference:?}"
            );
        }
    }
}
