//! Frames read back and measured, and distances to surfaces.

use nalgebra::Vector3;

use super::{Measured, greatest, shaped, share};
use crate::arrays::{Array, ArrayError, Bundle};

/// Frames in which distances are recomputed triangle by triangle, where that is cheap enough.
const BRUTE_FORCE: usize = 3_000_000;

fn counts(outputs: &Bundle, frames: usize) -> Result<Vec<i64>, ArrayError> {
    match outputs.get("counts")? {
        Array::I64 { shape, data } if shape == &[frames, 3] => Ok(data.clone()),
        _ => Err(ArrayError {
            name: "counts".into(),
            expected: format!("an i64 array of shape ({frames}, 3)"),
            found: "another".into(),
        }),
    }
}

fn frame_count(inputs: &Bundle) -> Result<usize, ArrayError> {
    Ok(inputs.text("paths")?.lines().count())
}

pub fn read_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let n = frame_count(inputs)?;
    let counts = counts(outputs, n)?;
    let measures = shaped(outputs, "measures", &[n, 8])?;
    let impossible = measures
        .chunks(8)
        .filter(|m| m[0] < 0.0 || m[2] > m[5] || m[3] > m[6] || m[4] > m[7]);
    Ok(vec![
        (
            "vertices",
            counts.iter().step_by(3).map(|&c| c as f64).sum(),
        ),
        ("impossible", impossible.count() as f64),
    ])
}

pub fn read_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let n = frame_count(inputs)?;
    let (a, b) = (counts(ours, n)?, counts(theirs, n)?);
    let wrong = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    let (a, b) = (ours.f64("measures", 2)?.1, theirs.f64("measures", 2)?.1);
    let mut worst = [0.0f64; 3];
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        let size = (0..3)
            .map(|x| (a[5 + x] - a[2 + x]).powi(2))
            .sum::<f64>()
            .sqrt();
        worst[0] = worst[0].max(share((a[0] - b[0]).abs(), size * size));
        worst[1] = worst[1].max(share((a[1] - b[1]).abs(), size.powi(3)));
        worst[2] = worst[2].max(share(greatest(&a[2..], &b[2..]), size));
    }
    Ok(vec![
        ("count_differences", wrong as f64),
        ("area_difference", worst[0]),
        ("volume_difference", worst[1]),
        ("bounds_difference", worst[2]),
    ])
}

struct Answer<'a> {
    hausdorff: &'a [f64],
    mean: &'a [f64],
    size: f64,
}

fn answer<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<Answer<'a>, ArrayError> {
    let (shape, a) = inputs.f64("A", 3)?;
    Ok(Answer {
        hausdorff: shaped(outputs, "hausdorff", &shape[..1])?,
        mean: shaped(outputs, "mean", &shape[..1])?,
        size: super::diagonal(&a[..3 * shape[1]], 3),
    })
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let found = answer(inputs, outputs)?;
    let (shape, a) = inputs.f64("A", 3)?;
    let b = inputs.f64("B", 3)?.1;
    let faces = inputs.triangles("F")?;
    let d = 3 * shape[1];
    let mut worst = 0.0f64;
    if shape[1] * faces.len() <= BRUTE_FORCE {
        for i in [0, shape[0] - 1] {
            let (greatest, mean) =
                brute_force(&a[i * d..(i + 1) * d], &b[i * d..(i + 1) * d], &faces);
            worst = worst
                .max((greatest - found.hausdorff[i]).abs())
                .max((mean - found.mean[i]).abs());
        }
    }
    let order = found.mean.iter().zip(found.hausdorff).map(|(m, h)| m - h);
    Ok(vec![
        ("brute_force", share(worst, found.size)),
        (
            "mean_above_greatest",
            share(order.fold(0.0, f64::max), found.size),
        ),
    ])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (answer(inputs, ours)?, answer(inputs, theirs)?);
    Ok(vec![
        (
            "hausdorff_difference",
            share(greatest(a.hausdorff, b.hausdorff), a.size),
        ),
        ("mean_difference", share(greatest(a.mean, b.mean), a.size)),
    ])
}

fn brute_force(a: &[f64], b: &[f64], faces: &[[u32; 3]]) -> (f64, f64) {
    let point =
        |data: &[f64], i: usize| Vector3::new(data[3 * i], data[3 * i + 1], data[3 * i + 2]);
    let n = a.len() / 3;
    let (mut greatest, mut sum) = (0.0f64, 0.0);
    for i in 0..n {
        let p = point(a, i);
        let nearest = faces
            .iter()
            .map(|f| to_triangle(p, f.map(|v| point(b, v as usize))))
            .fold(f64::INFINITY, f64::min);
        greatest = greatest.max(nearest);
        sum += nearest;
    }
    (greatest, sum / n as f64)
}

/// The least distance to the three sides, or to the plane where the foot lies inside.
fn to_triangle(p: Vector3<f64>, [a, b, c]: [Vector3<f64>; 3]) -> f64 {
    let side = |a: Vector3<f64>, b: Vector3<f64>| {
        let along = b - a;
        let s = share((p - a).dot(&along), along.norm_squared()).clamp(0.0, 1.0);
        (p - a - along * s).norm()
    };
    let sides = side(a, b).min(side(b, c)).min(side(c, a));
    let normal = (b - a).cross(&(c - a));
    let inside = |a: Vector3<f64>, b: Vector3<f64>| (b - a).cross(&(p - a)).dot(&normal) >= 0.0;
    if normal.norm() > 0.0 && inside(a, b) && inside(b, c) && inside(c, a) {
        return (p - a).dot(&normal.normalize()).abs().min(sides);
    }
    sides
}
