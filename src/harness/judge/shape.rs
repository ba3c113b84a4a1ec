//! The shape signal: error (3), orthonormality, coordinates up to sign and to turns among equal singular values.

use faer::{Mat, MatRef};
use nalgebra::DMatrix;

use super::{Measured, error_gap, greatest, shaped, share, square};
use crate::arrays::{ArrayError, Bundle};
use crate::linalg::dense::thin_svd;

/// Neighbouring singular values closer than this share of the first leave their directions free to turn among themselves.
const EQUAL: f64 = 1e-6;

struct Answer {
    centred: Mat<f64>,
    h: Mat<f64>,
    x: Mat<f64>,
}

fn answer(inputs: &Bundle, outputs: &Bundle) -> Result<Answer, ArrayError> {
    let z = inputs.columns("Z")?;
    let (d, n) = z.shape();
    let h0 = shaped(outputs, "h0", &[d])?;
    let m = outputs.f64("H", 2)?.0[0];
    shaped(outputs, "H", &[m, d])?;
    shaped(outputs, "X", &[n, m])?;
    shaped(outputs, "sigma", &[m])?;
    Ok(Answer {
        centred: Mat::from_fn(d, n, |a, i| z[(a, i)] - h0[a]),
        h: outputs.matrix("H")?,
        x: outputs.matrix("X")?,
    })
}

fn error_h(a: &Answer) -> f64 {
    (&a.centred - &a.h * &a.x).squared_norm_l2()
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let a = answer(inputs, outputs)?;
    let z = inputs.columns("Z")?;
    let (d, n) = z.shape();
    let m = a.h.ncols();
    let size = z.norm_l2();
    let mean: Vec<f64> = (0..d)
        .map(|r| (0..n).map(|i| z[(r, i)]).sum::<f64>() / n as f64)
        .collect();
    let identity = Mat::<f64>::identity(m, m);
    let wanted = inputs.integer("m")?;
    // Fewer dimensions than asked are right only where the data have no more.
    let beyond_rank = if m < wanted { error_h(&a) } else { 0.0 };
    Ok(vec![
        ("error_h", error_h(&a)),
        ("mean", share(greatest(&mean, outputs.vector("h0")?), size)),
        (
            "orthonormality",
            (a.h.transpose() * &a.h - identity).norm_max(),
        ),
        (
            "projection",
            share((&a.x - a.h.transpose() * &a.centred).norm_max(), size),
        ),
        (
            "sign",
            (0..m)
                .filter(|&j| points_backwards(a.h.col_as_slice(j)))
                .count() as f64,
        ),
        ("too_many_dimensions", m.saturating_sub(wanted) as f64),
        ("too_few_dimensions", share(beyond_rank, size * size)),
    ])
}

/// (3) for m dimensions, and the coordinates X (m' x n) with m' cut to the rank. None where the SVD fails.
pub fn truncated(z: MatRef<'_, f64>, m: usize) -> Option<(f64, Mat<f64>)> {
    let (d, n) = z.shape();
    let mean: Vec<f64> = (0..d)
        .map(|r| (0..n).map(|i| z[(r, i)]).sum::<f64>() / n as f64)
        .collect();
    let centred = Mat::from_fn(d, n, |r, i| z[(r, i)] - mean[r]);
    let svd = thin_svd(centred.as_ref()).ok()?;
    let rounding = d.max(n) as f64 * f64::EPSILON * z.norm_l2();
    let rank = svd.s.iter().take_while(|&&s| s > rounding).count();
    let kept = m.min(rank);
    let x = Mat::from_fn(kept, n, |j, i| svd.s[j] * svd.v[(i, j)]);
    Some((square(&svd.s[kept..]), x))
}

/// The entry of largest magnitude is negative, and no positive one is as large up to rounding.
fn points_backwards(direction: &[f64]) -> bool {
    let high = direction.iter().copied().fold(0.0, f64::max);
    let low = direction.iter().copied().fold(0.0, f64::min);
    -low > high * (1.0 + 1e-9)
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (answer(inputs, ours)?, answer(inputs, theirs)?);
    let data = a.centred.squared_norm_l2();
    let (m, other) = (a.h.ncols(), b.h.ncols());
    let mut found = vec![
        (
            "error_h_difference",
            error_gap(error_h(&a), error_h(&b), data),
        ),
        ("dimension_difference", m.abs_diff(other) as f64),
    ];
    if m == other {
        let (s, t) = (ours.vector("sigma")?, theirs.vector("sigma")?);
        found.push(("sigma_difference", share(greatest(s, t), data.sqrt())));
        found.push((
            "coordinate_difference",
            coordinate_difference(&a, &b, s) / data.sqrt().max(f64::MIN_POSITIVE),
        ));
    }
    Ok(found)
}

/// The greatest difference of coordinates after each group of equal singular values is turned onto the other's. A group at the end of the kept
/// ones may continue among the dropped, so its turn need not exist; singular values must be apart there for the case to be well posed.
fn coordinate_difference(a: &Answer, b: &Answer, sigma: &[f64]) -> f64 {
    let first = sigma.first().copied().unwrap_or(0.0);
    let mut worst = 0.0f64;
    let mut start = 0;
    while start < sigma.len() {
        let mut end = start + 1;
        while end < sigma.len() && sigma[end - 1] - sigma[end] < EQUAL * first {
            end += 1;
        }
        let rows =
            |x: &Mat<f64>| DMatrix::from_fn(end - start, x.ncols(), |r, i| x[(start + r, i)]);
        let (p, q) = (rows(&a.x), rows(&b.x));
        let svd = (&p * q.transpose()).svd(true, true);
        if let (Some(u), Some(v)) = (svd.u, svd.v_t) {
            worst = worst.max((p - u * v * q).amax());
        }
        start = end;
    }
    worst
}

/// ||Z - mean||^2, for other judges.
pub fn centred_square(z: faer::MatRef<'_, f64>) -> f64 {
    let n = z.ncols() as f64;
    (0..z.nrows())
        .map(|r| {
            let row: Vec<f64> = (0..z.ncols()).map(|i| z[(r, i)]).collect();
            let mean = row.iter().sum::<f64>() / n;
            square(&row.iter().map(|x| x - mean).collect::<Vec<_>>())
        })
        .sum()
}
