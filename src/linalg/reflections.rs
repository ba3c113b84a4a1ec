//! A QR factorisation by Householder's reflections, eight columns at a time in panels (Schreiber & Van Loan 1989): for matrices that fit in a cache, where it
//! takes half of the time of faer's.

use super::kernels::{LANES, fused};
use super::panels::{Eight, Panels, gather, subtract_spread};
use super::upper_triangular::UpperTriangular;

/// A = Q R for a matrix A with at least as many rows as columns, of which P are in a panel.
#[derive(Clone, Debug)]
pub struct Reflections<const P: usize = LANES> {
    steps: Vec<Step<P>>,
    r: UpperTriangular,
}

/// The reflections I - V T V^T for the columns of a panel.
#[derive(Clone, Debug)]
struct Step<const P: usize> {
    /// V, from the first row that is not 0.
    vectors: Vec<[f64; P]>,
    t: [[f64; P]; P],
    t_transposed: [[f64; P]; P],
}

impl<const P: usize> Step<P> {
    /// Subtracts V T^T V^T b, or V T V^T b for the transpose of T.
    fn apply(&self, t: &[[f64; P]; P], b: &mut [Eight]) {
        let mut sums = [[0.0; LANES]; P];
        gather(&self.vectors, b, &mut sums);
        let mut turned = [[0.0; LANES]; P];
        gather(t, &sums, &mut turned);
        subtract_spread(&self.vectors, &turned, b);
    }
}

impl Reflections {
    /// Factors the matrix whose columns are some vectors. O(entries vectors^2).
    pub fn new(mut a: Panels) -> Self {
        let columns = a.vectors();
        let mut found = Self {
            steps: Vec::new(),
            r: UpperTriangular::default(),
        };
        for (first, panel) in (0..columns).step_by(LANES).zip(a.iter_mut()) {
            found.apply_transpose(panel);
            let (above, rest) = panel.split_at_mut(first);
            found.push(above, rest, (columns - first).min(LANES));
        }
        found
    }
}

impl<const P: usize> Reflections<P> {
    /// Factors a matrix of one panel, given row by row, of which the first `count` columns are taken, at most P and 8 of them. O(rows count).
    pub fn of_few(rows: &[[f64; P]], count: usize) -> Self {
        let entry = |row: &[f64; P]| std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
        let mut panel: Vec<Eight> = rows.iter().map(entry).collect();
        let mut found = Self {
            steps: Vec::new(),
            r: UpperTriangular::default(),
        };
        found.push(&[], &mut panel, count.min(P).min(LANES));
        found
    }

    /// Adds the reflections for the first `count` columns of a panel that those before have been applied to: its rows of R, and what is below.
    fn push(&mut self, above: &[Eight], rest: &mut [Eight], count: usize) {
        let (corner, taus) = reflect(rest, count);
        let inverses = std::array::from_fn(|i| if i < count { 1.0 / corner[i][i] } else { 0.0 });
        let t: [[f64; P]; P] = together(rest, &taus);
        let vectors = rest.iter().map(|row| std::array::from_fn(|k| row[k]));
        self.steps.push(Step {
            vectors: vectors.collect(),
            t_transposed: std::array::from_fn(|i| std::array::from_fn(|j| t[j][i])),
            t,
        });
        self.r.push(above, &corner, inverses);
    }

    /// Replaces eight vectors b, entry by entry, by Q^T b, with the full square Q.
    pub fn apply_transpose(&self, b: &mut [Eight]) {
        for (i, step) in self.steps.iter().enumerate() {
            step.apply(&step.t, &mut b[LANES * i..]);
        }
    }

    /// Replaces eight vectors b, entry by entry, by Q b, with the full square Q.
    pub fn apply(&self, b: &mut [Eight]) {
        for (i, step) in self.steps.iter().enumerate().rev() {
            step.apply(&step.t_transposed, &mut b[LANES * i..]);
        }
    }

    /// R, whose diagonal may have any sign.
    pub fn r(&self) -> &UpperTriangular {
        &self.r
    }
}

/// Reduces the first `count` of eight columns to a triangle, which is given back with the scales tau of the reflections I - tau v v^T; their
/// vectors take the columns' place. The other columns become 0.
fn reflect(columns: &mut [Eight], count: usize) -> ([Eight; LANES], Eight) {
    let (mut corner, mut taus) = ([[0.0; LANES]; LANES], [0.0; LANES]);
    for k in 0..count.min(columns.len()) {
        let rows = &mut columns[k..];
        // The products of column k with all eight.
        let products = products(rows, k);
        let [head, norm] = [rows[0][k], products[k].sqrt()];
        let diagonal = if head > 0.0 { -norm } else { norm };
        // With v = x - diagonal e: v . v / 2 = |x|^2 - diagonal x_0.
        let half = products[k] - diagonal * head;
        taus[k] = if half > 0.0 { 1.0 / half } else { 0.0 };
        let mut shares = [0.0; LANES];
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
    let mut gram = [[0.0; LANES]; LANES];
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
    let mut sums = [[0.0; LANES]; 4];
    products_in_four(vectors, k, &mut sums);
    std::array::from_fn(|lane| (sums[0][lane] + sums[2][lane]) + (sums[1][lane] + sums[3][lane]))
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
                .map(|i| std::array::from_fn(|lane| b[(i, lane)]))
                .collect();
            qr.apply_transpose(&mut panel);
            panel.resize(rows.max(columns.next_multiple_of(LANES)), [0.0; LANES]);
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
            .map(|i| std::array::from_fn(|lane| ((i * 3 + lane) as f64).cos()))
            .collect();
        let mut b = given.clone();
        qr.apply_transpose(&mut b);
        let norm = |b: &[Eight]| b.iter().flatten().map(|x| x * x).sum::<f64>();
        assert!((norm(&b) - norm(&given)).abs() < 1e-12 * norm(&given));
        qr.apply(&mut b);
        for (b, given) in b.iter().zip(&given) {
            assert!(b.iter().zip(given).all(|(b, g)| (b - g).abs() < 1e-13));
        }
    }
}
