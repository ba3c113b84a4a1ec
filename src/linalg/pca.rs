//! Principal components of many numbers in few samples: the route that costs one product of the data with itself.

use faer::prelude::{Reborrow, ReborrowMut};
use faer::{Accum, ColRef, Mat, MatMut, MatRef, Scale};
use rayon::prelude::*;

use super::dense::{FactorError, Qr, SymmetricEigen, multiply, symmetric_eigen, thin_svd};
use super::gram::Gram;
use super::kernels::{axpy, max_abs, norm_squared, subtract};

/// Rows of the data handled at a time; n columns of this many numbers stay in cache. Not a power of two: columns a page apart meet in the same lines of it.
const BLOCK: usize = 504;
/// Partial Gram matrices, added up in a fixed order: the result does not depend on the number of threads.
const PARTS: usize = 16;
/// Squared ratio of the last kept singular value to the first, below which the Householder route is taken: squaring the data costs the basis
/// up to eps over this ratio of its orthonormality, 2e-10 at worst.
const GRAM_LIMIT: f64 = 1e-6;

/// The principal components of n samples of d numbers.
pub struct Pca {
    /// The mean sample, d numbers.
    pub mean: Vec<f64>,
    /// d x m: orthonormal directions by decreasing singular value; each one's entry of largest magnitude is positive.
    pub basis: Mat<f64>,
    /// m x n: the samples' coordinates, basis^T (z - mean).
    pub coordinates: Mat<f64>,
    /// All singular values of the centred data that were found, decreasing; at least m of them.
    pub singular_values: Vec<f64>,
}

/// The first min(m, rank) principal components of `samples`, d x n with a sample a column.
///
/// The Gram matrix of the centred samples is formed block by block (n^2 d flops, no d x n temporary) and its eigenvectors give the basis. Where the
/// kept singular values spread too far for that, the singular values come from a Householder QR of the data, which costs four times as much and
/// a copy of the data, and has the accuracy of an SVD. Rank counts singular values above max(n, d) eps ||samples||_F: rounding in the centred
/// samples is relative to the samples.
pub fn pca(samples: MatRef<'_, f64>, m: usize) -> Result<Pca, FactorError> {
    let (d, n) = samples.shape();
    let m = m.min(n.saturating_sub(1)).min(d);
    if m == 0 {
        return Ok(empty(mean(samples), d, n));
    }
    if n >= d {
        return by_qr(samples, mean(samples), m);
    }
    // One core touches the memory of the basis while the other multiplies.
    let (basis, (gram, mean)) = rayon::join(|| Mat::zeros(d, m), || gram(samples));
    let eigen = symmetric_eigen(gram.as_ref())?;
    if squaring_is_safe(samples, &mean, &eigen, m) {
        Ok(by_gram(samples, mean, &eigen, basis))
    } else {
        by_qr(samples, mean, m)
    }
}

/// Whether the first m singular values, from the eigenvalues of the Gram matrix, are far enough above what squaring the data leaves of small ones.
fn squaring_is_safe(
    samples: MatRef<'_, f64>,
    mean: &[f64],
    eigen: &SymmetricEigen,
    m: usize,
) -> bool {
    let negligible = negligible(samples, mean, eigen.values.iter().copied());
    eigen.values[m - 1] > (GRAM_LIMIT * eigen.values[0]).max(negligible * negligible)
}

/// What a singular value must exceed to count, from the squares of all of them: ||samples||_F^2 is their sum and n |mean|^2.
fn negligible(samples: MatRef<'_, f64>, mean: &[f64], squares: impl Iterator<Item = f64>) -> f64 {
    let (d, n) = samples.shape();
    let frobenius = (squares.sum::<f64>() + n as f64 * norm_squared(mean)).sqrt();
    n.max(d) as f64 * f64::EPSILON * frobenius
}

fn empty(mean: Vec<f64>, d: usize, n: usize) -> Pca {
    Pca {
        mean,
        basis: Mat::zeros(d, 0),
        coordinates: Mat::zeros(0, n),
        singular_values: Vec::new(),
    }
}

fn mean(samples: MatRef<'_, f64>) -> Vec<f64> {
    let d = samples.nrows();
    let mut mean = vec![0.0; d];
    mean.par_chunks_mut(BLOCK)
        .enumerate()
        .for_each(|(b, mean)| mean_rows(samples.subrows(b * BLOCK, mean.len()), mean));
    mean
}

/// Adds the mean of the columns of these rows to zeros.
fn mean_rows(rows: MatRef<'_, f64>, mean: &mut [f64]) {
    for sample in rows.col_iter() {
        match sample.try_as_col_major() {
            Some(sample) => axpy(1.0, sample.as_slice(), mean),
            None => mean
                .iter_mut()
                .zip(sample.iter())
                .for_each(|(sum, x)| *sum += x),
        }
    }
    mean.iter_mut().for_each(|x| *x /= rows.ncols() as f64);
}

/// Writes rows `first..` of the centred samples into `block`, one sample a column.
fn centred_rows(samples: MatRef<'_, f64>, mean: &[f64], first: usize, block: MatMut<'_, f64>) {
    let rows = block.nrows();
    let mean = &mean[first..first + rows];
    let sources = samples.subrows(first, rows).col_iter();
    for (source, mut target) in sources.zip(block.col_iter_mut()) {
        match (
            source.try_as_col_major(),
            target.rb_mut().try_as_col_major_mut(),
        ) {
            (Some(source), Some(target)) => {
                subtract(source.as_slice(), mean, target.as_slice_mut())
            }
            _ => {
                let numbers = target.iter_mut().zip(source.iter()).zip(mean);
                numbers.for_each(|((y, x), mean)| *y = x - mean);
            }
        }
    }
}

/// The lower triangle of Y^T Y for the centred samples Y, and the mean sample, in one passage over the samples.
fn gram(samples: MatRef<'_, f64>) -> (Mat<f64>, Vec<f64>) {
    let (d, n) = samples.shape();
    let mut mean = vec![0.0; d];
    let rows = BLOCK * d.div_ceil(BLOCK).div_ceil(PARTS).max(1);
    let sum_of_part = |buffer: &mut Mat<f64>, (part, means): (usize, &mut [f64])| {
        let mut sum = Gram::zeros(n);
        for (block, mean) in means.chunks_mut(BLOCK).enumerate() {
            let samples = samples.subrows(part * rows + block * BLOCK, mean.len());
            mean_rows(samples, mean);
            let mut centred = buffer.get_mut(..mean.len(), ..);
            centred_rows(samples, mean, 0, centred.rb_mut());
            sum.add(centred.rb());
        }
        sum
    };
    let parts: Vec<Gram> = mean
        .par_chunks_mut(rows)
        .enumerate()
        .map_init(|| Mat::zeros(BLOCK, n), sum_of_part)
        .collect();
    let sum = parts.into_iter().reduce(Gram::plus);
    (sum.unwrap_or_else(|| Gram::zeros(n)).lower(), mean)
}

/// The Gram route: Y^T Y = V S^2 V^T gives the basis Y V S^-1. `basis` is d x m, and overwritten.
fn by_gram(
    samples: MatRef<'_, f64>,
    mean: Vec<f64>,
    eigen: &SymmetricEigen,
    mut basis: Mat<f64>,
) -> Pca {
    let (n, m) = (samples.ncols(), basis.ncols());
    let sigma: Vec<f64> = eigen.values.iter().map(|v| v.max(0.0).sqrt()).collect();
    let weights = Mat::from_fn(n, m, |i, j| eigen.vectors[(i, j)] / sigma[j]);
    let peaks = centred_product(samples, &mean, weights.as_ref(), basis.as_mut());
    let signs = turn(&mut basis, &peaks);
    Pca {
        mean,
        basis,
        coordinates: Mat::from_fn(m, n, |j, i| signs[j] * sigma[j] * eigen.vectors[(i, j)]),
        singular_values: sigma,
    }
}

/// Y W for the centred samples Y (d x n) and W (n x m), a block of rows at a time, and the peaks of each block.
fn centred_product(
    samples: MatRef<'_, f64>,
    mean: &[f64],
    w: MatRef<'_, f64>,
    product: MatMut<'_, f64>,
) -> Vec<Vec<f64>> {
    let n = samples.ncols();
    let blocks = product.par_row_chunks_mut(BLOCK).enumerate();
    let product_of_block =
        |buffer: &mut Mat<f64>, (block, mut target): (usize, MatMut<'_, f64>)| {
            let mut rows = buffer.get_mut(..target.nrows(), ..);
            centred_rows(samples, mean, block * BLOCK, rows.rb_mut());
            multiply(target.rb_mut(), Accum::Replace, rows.rb(), w);
            peaks(target.rb())
        };
    blocks
        .map_init(|| Mat::zeros(BLOCK, n), product_of_block)
        .collect()
}

/// The greatest magnitude in each column of a block of rows.
fn peaks(block: MatRef<'_, f64>) -> Vec<f64> {
    let columns = block.col_iter();
    let peak = |column: ColRef<'_, f64>| match column.try_as_col_major() {
        Some(column) => max_abs(column.as_slice()),
        None => column.norm_max(),
    };
    columns.map(peak).collect()
}

/// The Householder route: Y = Q R and R = U S V^T give Y = (Q U) S V^T.
fn by_qr(samples: MatRef<'_, f64>, mean: Vec<f64>, m: usize) -> Result<Pca, FactorError> {
    let (d, n) = samples.shape();
    let mut centred = Mat::zeros(d, n);
    centred_rows(samples, &mean, 0, centred.as_mut());
    let (u, svd_v, s) = if d > n {
        let qr = Qr::new(centred);
        let r = Mat::from_fn(n, n, |i, j| if i <= j { qr.r(i, j) } else { 0.0 });
        let svd = thin_svd(r.as_ref())?;
        let mut u = Mat::zeros(d, n);
        u.get_mut(..n, ..).copy_from(&svd.u);
        qr.apply(&mut u);
        (u, svd.v, svd.s)
    } else {
        let svd = thin_svd(centred.as_ref())?;
        (svd.u, svd.v, svd.s)
    };
    let negligible = negligible(samples, &mean, s.iter().map(|s| s * s));
    let m = m.min(s.iter().take_while(|&&s| s > negligible).count());
    let mut basis = u.get(.., ..m).to_owned();
    let signs = orient(&mut basis);
    Ok(Pca {
        mean,
        coordinates: Mat::from_fn(m, n, |j, i| signs[j] * s[j] * svd_v[(i, j)]),
        basis,
        singular_values: s,
    })
}

/// Turns each column so that its entry of largest magnitude (the first of equals) is positive; returns the signs applied.
pub(crate) fn orient(basis: &mut Mat<f64>) -> Vec<f64> {
    let blocks = basis.par_row_chunks(BLOCK);
    let peaks: Vec<Vec<f64>> = blocks.map(peaks).collect();
    turn(basis, &peaks)
}

/// [`orient`], from the peaks of each block of rows.
fn turn(basis: &mut Mat<f64>, peaks: &[Vec<f64>]) -> Vec<f64> {
    let sign = |j: usize| {
        let most = peaks.iter().map(|peaks| peaks[j]).fold(0.0, f64::max);
        let block = peaks.iter().position(|peaks| peaks[j] == most);
        let rows = &basis.col_as_slice(j)[block.unwrap_or(0) * BLOCK..];
        match rows.iter().find(|x| x.abs() == most) {
            Some(&x) if x < 0.0 => -1.0,
            _ => 1.0,
        }
    };
    let signs: Vec<f64> = (0..basis.ncols()).map(sign).collect();
    let columns = basis.par_col_iter_mut().zip(&signs);
    columns.for_each(|(mut column, &sign)| {
        if sign < 0.0 {
            column *= Scale(sign);
        }
    });
    signs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residual(samples: &Mat<f64>, pca: &Pca) -> f64 {
        let rebuilt = &pca.basis * &pca.coordinates;
        let mean = Mat::from_fn(samples.nrows(), samples.ncols(), |i, _| pca.mean[i]);
        (samples - mean - rebuilt).norm_l2()
    }

    #[test]
    fn both_routes_agree_and_the_full_rank_rebuilds() {
        let samples = Mat::from_fn(700, 9, |i, j| ((i + 1) as f64 * (j as f64 + 0.3)).sin());
        let whole = pca(samples.as_ref(), 8).unwrap();
        assert!(residual(&samples, &whole) < 1e-12 * samples.norm_l2());
        let (gram, mean) = gram(samples.as_ref());
        let eigen = symmetric_eigen(gram.as_ref()).unwrap();
        assert!(squaring_is_safe(samples.as_ref(), &mean, &eigen, 4));
        let gram = by_gram(samples.as_ref(), mean.clone(), &eigen, Mat::zeros(700, 4));
        let qr = by_qr(samples.as_ref(), mean, 4).unwrap();
        assert!((&gram.basis - &qr.basis).norm_max() < 1e-12);
        assert!((&gram.coordinates - &qr.coordinates).norm_max() < 1e-12 * samples.norm_l2());
    }

    #[test]
    fn columns_turn_by_the_first_of_their_greatest_entries() {
        let mut basis = Mat::from_fn(2 * BLOCK + 3, 3, |i, j| 0.1 * ((i * j) as f64).sin());
        basis[(BLOCK + 7, 0)] = -2.0;
        basis[(BLOCK - 1, 1)] = 2.0;
        basis[(2 * BLOCK + 1, 1)] = -2.0;
        basis[(5, 2)] = -2.0;
        basis[(2 * BLOCK + 2, 2)] = 2.0;
        let before = basis.clone();
        let signs = orient(&mut basis);
        assert_eq!(signs, [-1.0, 1.0, -1.0]);
        assert_eq!(
            basis,
            Mat::from_fn(before.nrows(), 3, |i, j| signs[j] * before[(i, j)])
        );
    }

    #[test]
    fn widely_spread_singular_values_keep_their_accuracy() {
        let samples = Mat::from_fn(300, 6, |i, j| {
            10f64.powi(-3 * j as i32) * ((i * (j + 2)) as f64 * 0.1).cos()
        });
        let whole = pca(samples.as_ref(), 5).unwrap();
        assert!(residual(&samples, &whole) < 1e-14 * samples.norm_l2());
        let gram = whole.basis.transpose() * &whole.basis;
        assert!((gram - Mat::<f64>::identity(5, 5)).norm_max() < 1e-13);
    }

    #[test]
    fn repeated_samples_cut_the_rank() {
        let samples = Mat::from_fn(50, 6, |i, j| 1e3 + ((i * (j % 3 + 1)) as f64).sin());
        assert_eq!(pca(samples.as_ref(), 5).unwrap().basis.ncols(), 2);
        assert_eq!(pca(samples.as_ref(), 0).unwrap().basis.ncols(), 0);
    }
}
