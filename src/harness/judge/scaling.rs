//! Pose-space positions: the stress (6), its gradient, positions after the best rigid motion; dissimilarities of the ordered layout.

use nalgebra::{Matrix2, Vector2};

use super::{Measured, diagonal, greatest, shaped, share};
use crate::arrays::{ArrayError, Bundle};

/// A layout whose gradient is below this is at a stationary point, and positions may be compared.
const STATIONARY: f64 = 1e-9;

/// Dissimilarities as a function of two frames.
type Delta<'a> = &'a dyn Fn(usize, usize) -> f64;

fn shape_distance(x: faer::MatRef<'_, f64>, i: usize, j: usize) -> f64 {
    (0..x.nrows())
        .map(|a| (x[(a, i)] - x[(a, j)]).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// The stress, the sum of squared dissimilarities, and the greatest norm of half the stress's gradient at the points for which `free` holds.
fn stress(delta: Delta, p: &[[f64; 2]], free: impl Fn(usize) -> bool) -> [f64; 3] {
    let (mut stress, mut total) = (0.0, 0.0);
    let mut gradient = vec![[0.0; 2]; p.len()];
    for i in 0..p.len() {
        for j in 0..i {
            let delta = delta(i, j);
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
    let delta = |i, j| shape_distance(x, i, j);
    let [stress_found, total, gradient] = stress(&delta, &p, free);
    let start = inputs.points("start")?;
    Ok(Answer {
        gradient: share(gradient, n as f64 * diagonal(flat, 2)),
        start_stress: stress(&delta, &start, free)[0],
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

/// How near to a segment, as a share of a step, a frame must be to repeat it (PROTOCOL.md).
const REPEATED: f64 = 0.05;
/// Steps and gaps below this share of the greatest distance are none.
const HELD: f64 = 1e-9;

/// The dissimilarities of the ordered layout as PROTOCOL.md defines them, from the coordinates themselves and with all shortest paths by Floyd & Warshall
/// 1962, O(n^3).
fn ordered(x: faer::MatRef<'_, f64>, weight: f64) -> Vec<Vec<f64>> {
    let n = x.ncols();
    let square = |v: &Vec<Vec<f64>>| v.iter().flatten().map(|d| d * d).sum::<f64>();
    let poses: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| shape_distance(x, i, j)).collect())
        .collect();
    let negligible = HELD * poses.iter().flatten().copied().fold(0.0, f64::max);
    let steps: Vec<f64> = (1..n)
        .map(|i| {
            Some(poses[i - 1][i])
                .filter(|&s| s > negligible)
                .unwrap_or(0.0)
        })
        .collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let mut paths = vec![vec![f64::INFINITY; n]; n];
    let mut join = |a: usize, b: usize, length: f64| {
        paths[a][b] = paths[a][b].min(length);
        paths[b][a] = paths[a][b];
    };
    for (j, &s) in steps.iter().enumerate() {
        let length = (s * mean).sqrt();
        join(j, j + 1, length);
        for i in (0..n).filter(|&i| i != j && i != j + 1) {
            let own = [i.wrapping_sub(1), i].map(|k| steps.get(k).copied().unwrap_or(0.0));
            let bound = REPEATED * s.min(own[0].max(own[1]));
            let (away, share) = from_segment(x, i, j, s);
            if away <= bound.max(negligible) {
                join(i, j, share * length);
                join(i, j + 1, (1.0 - share) * length);
            }
        }
    }
    (0..n).for_each(|i| paths[i][i] = 0.0);
    for k in 0..n {
        for i in 0..n {
            for j in 0..n {
                paths[i][j] = paths[i][j].min(paths[i][k] + paths[k][j]);
            }
        }
    }
    let mix = |i: usize, j: usize| {
        ((1.0 - weight) * poses[i][j].powi(2) + weight * paths[i][j].powi(2)).sqrt()
    };
    let mixed: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| mix(i, j)).collect())
        .collect();
    let size = match square(&mixed) {
        0.0 => 1.0,
        sum => (square(&poses) / sum).sqrt(),
    };
    mixed
        .into_iter()
        .map(|row| row.into_iter().map(|d| size * d).collect())
        .collect()
}

/// Distance of frame i from the segment of frames j and j + 1, and the nearest point's share of it; the first end where it has no length.
fn from_segment(x: faer::MatRef<'_, f64>, i: usize, j: usize, length: f64) -> (f64, f64) {
    let along = |a: usize| x[(a, j + 1)] - x[(a, j)];
    let share = match length == 0.0 {
        true => 0.0,
        false => {
            let product: f64 = (0..x.nrows())
                .map(|a| (x[(a, i)] - x[(a, j)]) * along(a))
                .sum();
            (product / (length * length)).clamp(0.0, 1.0)
        }
    };
    let away = (0..x.nrows()).map(|a| (x[(a, i)] - x[(a, j)] - share * along(a)).powi(2));
    (away.sum::<f64>().sqrt(), share)
}

/// An answer to `signal.layout`, measured by dissimilarities that are found again.
fn laid_out(inputs: &Bundle, outputs: &Bundle) -> Result<(Answer, f64), ArrayError> {
    let x = inputs.columns("X")?;
    let n = x.ncols();
    let found = shaped(outputs, "delta", &[n, n])?;
    let flat = shaped(outputs, "P", &[n, 2])?;
    let p = outputs.points("P")?;
    let weight = inputs.vector("weight")?.first().copied().unwrap_or(0.0);
    let expected = ordered(x, weight);
    let size = expected.iter().flatten().copied().fold(0.0, f64::max);
    let gap = greatest(expected.concat().as_slice(), found);
    let [stress_found, total, gradient] = stress(&|i, j| expected[i][j], &p, |_| true);
    let answer = Answer {
        gradient: share(gradient, n as f64 * diagonal(flat, 2)),
        // Points that all coincide have the stress `total`, and worse is no layout.
        start_stress: total,
        stress: stress_found,
        total,
        p,
    };
    Ok((answer, share(gap, size)))
}

pub fn layout_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let (a, gap) = laid_out(inputs, outputs)?;
    Ok(vec![
        ("delta", gap),
        ("stress", a.stress),
        ("gradient", a.gradient),
        (
            "above_point",
            share((a.stress - a.start_stress).max(0.0), a.total),
        ),
    ])
}

pub fn layout_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let ((a, _), (b, _)) = (laid_out(inputs, ours)?, laid_out(inputs, theirs)?);
    let (delta, others) = (ours.f64("delta", 2)?.1, theirs.f64("delta", 2)?.1);
    let size = delta.iter().copied().fold(0.0, f64::max);
    let mut found = vec![
        ("delta_difference", share(greatest(delta, others), size)),
        ("stress_difference", stress_gap(&a, &b)),
    ];
    if a.gradient.max(b.gradient) <= STATIONARY {
        let size = diagonal(a.p.as_flattened(), 2);
        let difference = after_rigid_motion(&a.p, &b.p);
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
