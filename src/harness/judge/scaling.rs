//! Pose-space positions: the stress (6), its gradient, positions after the best rigid motion.

use nalgebra::{Matrix2, Vector2};

use super::{Measured, diagonal, greatest, shaped, share};
use crate::arrays::{ArrayError, Bundle};

/// A layout whose gradient is below this is at a stationary point, and positions may be compared.
const STATIONARY: f64 = 1e-9;

fn shape_distance(x: faer::MatRef<'_, f64>, i: usize, j: usize) -> f64 {
    (0..x.nrows())
        .map(|a| (x[(a, i)] - x[(a, j)]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// The stress, the sum of squared dissimilarities, and the greatest norm of half the stress's gradient at the points for which `free` holds.
fn stress(x: faer::MatRef<'_, f64>, p: &[[f64; 2]], free: impl Fn(usize) -> bool) -> [f64; 3] {
    let (mut stress, mut total) = (0.0, 0.0);
    let mut gradient = vec![[0.0; 2]; p.len()];
    for i in 0..p.len() {
        for j in 0..i {
            let delta = shape_distance(x, i, j);
            let e = [p[i][0] - p[j][0], p[i][1] - p[j][1]];
            let d = (e[0] * e[0] + e[1] * e[1]).sqrt();
            stress += (d - delta).powi(2);
            total += delta * delta;
            if d > 0.0 {
                for a in 0..2 {
                    let pull = (1.0 - delta / d) * e[a];
                    gradient[i][a] += pull;
                    gradient[j][a] -= pull;
                }
            }
        }
    }
    let norm = |i: usize| gradient[i][0].hypot(gradient[i][1]);
    let worst = (0..p.len())
        .filter(|&i| free(i))
        .map(norm)
        .fold(0.0, f64::max);
    [stress, total, worst]
}

/// Positions, stress, total and relative gradient of an answer.
struct Answer {
    p: Vec<[f64; 2]>,
    stress: f64,
    total: f64,
    gradient: f64,
    start_stress: f64,
}

fn answer(inputs: &Bundle, outputs: &Bundle, fixed: &[usize]) -> Result<Answer, ArrayError> {
    let x = inputs.columns("X")?;
    let n = x.ncols();
    let flat = shaped(outputs, "P", &[n, 2])?;
    let p = outputs.points("P")?;
    let free = |i: usize| !fixed.contains(&i);
    let [stress_found, total, gradient] = stress(x, &p, free);
    let start = inputs.points("start")?;
    Ok(Answer {
        gradient: share(gradient, n as f64 * diagonal(flat, 2)),
        start_stress: stress(x, &start, free)[0],
        stress: stress_found,
        total,
        p,
    })
}

fn quantities(a: &Answer) -> Vec<Measured> {
    vec![
        ("stress", a.stress),
        ("gradient", a.gradient),
        (
            "above_start",
            share((a.stress - a.start_stress).max(0.0), a.total),
        ),
    ]
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    Ok(quantities(&answer(inputs, outputs, &[])?))
}

pub fn fixed_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let fixed = inputs.indices("fixed")?;
    let a = answer(inputs, outputs, &fixed)?;
    let held = inputs.points("positions")?;
    let moved = fixed
        .iter()
        .zip(&held)
        .map(|(&i, q)| greatest(&a.p[i], q))
        .fold(0.0, f64::max);
    let mut found = quantities(&a);
    found.push(("pins_moved", moved));
    Ok(found)
}

fn stress_gap(a: &Answer, b: &Answer) -> f64 {
    share((a.stress - b.stress).abs(), a.stress.max(1e-6 * a.total))
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (answer(inputs, ours, &[])?, answer(inputs, theirs, &[])?);
    let mut found = vec![("stress_difference", stress_gap(&a, &b))];
    if a.gradient.max(b.gradient) <= STATIONARY {
        let size = diagonal(a.p.as_flattened(), 2);
        found.push((
            "position_difference",
            share(after_rigid_motion(&a.p, &b.p), size),
        ));
    }
    Ok(found)
}

pub fn fixed_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let fixed = inputs.indices("fixed")?;
    let (a, b) = (
        answer(inputs, ours, &fixed)?,
        answer(inputs, theirs, &fixed)?,
    );
    let mut found = vec![("stress_difference", stress_gap(&a, &b))];
    if a.gradient.max(b.gradient) <= STATIONARY {
        let difference = greatest(a.p.as_flattened(), b.p.as_flattened());
        let size = diagonal(a.p.as_flattened(), 2);
        found.push(("position_difference", share(difference, size)));
    }
    Ok(found)
}

/// The greatest distance left after the best rigid motion, reflections allowed, of q onto p.
pub fn after_rigid_motion(p: &[[f64; 2]], q: &[[f64; 2]]) -> f64 {
    let n = p.len() as f64;
    let mean = |p: &[[f64; 2]]| p.iter().map(|&p| Vector2::from(p)).sum::<Vector2<f64>>() / n;
    let (a, b) = (mean(p), mean(q));
    let covariance: Matrix2<f64> = p
        .iter()
        .zip(q)
        .map(|(&p, &q)| (Vector2::from(p) - a) * (Vector2::from(q) - b).transpose())
        .sum();
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return f64::INFINITY;
    };
    p.iter()
        .zip(q)
        .map(|(&p, &q)| (Vector2::from(p) - a - u * v * (Vector2::from(q) - b)).norm())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rigid_motions_do_not_count_and_scale_does() {
        let p: Vec<[f64; 2]> = (0..7)
            .map(|i| [(i as f64).sin(), (2.0 * i as f64).cos()])
            .collect();
        let q: Vec<[f64; 2]> = p.iter().map(|p| [3.0 - p[1], p[0] - 1.0]).collect();
        let mirrored: Vec<[f64; 2]> = p.iter().map(|p| [-p[0], p[1]]).collect();
        let larger: Vec<[f64; 2]> = p.iter().map(|p| [1.01 * p[0], 1.01 * p[1]]).collect();
        assert!(after_rigid_motion(&p, &q) < 1e-14);
        assert!(after_rigid_motion(&p, &mirrored) < 1e-14);
        assert!(after_rigid_motion(&p, &larger) > 1e-3);
    }
}
