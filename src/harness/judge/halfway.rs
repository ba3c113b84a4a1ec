//! Halfway between two poses: whether edges keep their lengths, as they do not where positions are averaged.

use super::{Measured, shaped, share};
use crate::arrays::{ArrayError, Bundle};

/// The sum of the lengths of the triangles' sides.
fn length(points: &[f64], faces: &[[u32; 3]]) -> f64 {
    let points = points.as_chunks::<3>().0;
    let side = |a: u32, b: u32| {
        let (a, b) = (points[a as usize], points[b as usize]);
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    };
    faces
        .iter()
        .map(|&[a, b, c]| side(a, b) + side(b, c) + side(c, a))
        .sum()
}

/// The engine's sum of sides, that of the mean of positions, and the mean of those of start and end.
fn lengths(inputs: &Bundle, outputs: &Bundle) -> Result<[f64; 3], ArrayError> {
    let (shape, start) = inputs.f64("start", 2)?;
    let end = shaped(inputs, "end", shape)?;
    let found = shaped(outputs, "frame", shape)?;
    let faces = inputs.triangles("F")?;
    let straight: Vec<f64> = start.iter().zip(end).map(|(a, b)| 0.5 * (a + b)).collect();
    let expected = 0.5 * (length(start, &faces) + length(end, &faces));
    Ok([length(found, &faces), length(&straight, &faces), expected])
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let [found, straight, expected] = lengths(inputs, outputs)?;
    let [error, straight] = [found, straight].map(|l| share((l - expected).abs(), expected));
    Ok(vec![
        ("length_error", error),
        ("length_error_of_means", straight),
        ("share_of_means", share(error, straight)),
    ])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let [[a, _, expected], [b, ..]] = [lengths(inputs, ours)?, lengths(inputs, theirs)?];
    Ok(vec![("length_difference", share((a - b).abs(), expected))])
}
