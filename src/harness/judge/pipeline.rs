//! The whole reconstruction: error (2) from the frames themselves, and (3), (4), (7) again from what they depend on.

use super::scaling::after_rigid_motion;
use super::{Measured, diagonal, error_gap, greatest, pose, shape, shaped, share, time};
use crate::arrays::{ArrayError, Bundle};

struct Answer<'a> {
    errors: [f64; 4],
    z: &'a [f64],
    p: Vec<[f64; 2]>,
    /// Sites, frames of the sequence.
    order: Vec<usize>,
    /// (2), from the frames.
    error_psi: f64,
}

fn answer<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<Answer<'a>, ArrayError> {
    let (shape, given) = inputs.f64("Z", 2)?;
    let z = shaped(outputs, "Z", shape)?;
    shaped(outputs, "P", &[shape[0], 2])?;
    let errors = shaped(outputs, "errors", &[4])?;
    let order = pose::distinct_frames(outputs, shape[0])?;
    Ok(Answer {
        error_psi: z.iter().zip(given).map(|(a, b)| (a - b).powi(2)).sum(),
        errors: [errors[0], errors[1], errors[2], errors[3]],
        p: outputs.points("P")?,
        order,
        z,
    })
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let a = answer(inputs, outputs)?;
    let (shape, given) = inputs.f64("Z", 2)?;
    let (n, d) = (shape[0], shape[1]);
    let data = shape::centred_square(inputs.columns("Z")?);
    let [claimed_h, claimed_g, claimed_f] = claims(inputs, &a)?;
    let mut found = vec![
        ("error_h", a.errors[0]),
        ("error_g", a.errors[1]),
        ("error_f", a.errors[2]),
        ("error_psi", a.error_psi),
        ("claimed_error_h", claimed_h),
        ("claimed_error_g", claimed_g),
        ("claimed_error_f", claimed_f),
        (
            "claimed_error_psi",
            error_gap(a.error_psi, a.errors[3], data),
        ),
    ];
    if of_vertices(inputs)? {
        let rms = (a.error_psi / (n * d / 3) as f64).sqrt();
        found.push(("relative_rms", share(rms, diagonal(&given[..d], 3))));
        found.push(("kg_percent", kg_percent(given, d, a.error_psi)));
    }
    Ok(found)
}

/// Whether the numbers of a frame are positions; in other spaces distances of vertices cannot be told from them.
fn of_vertices(inputs: &Bundle) -> Result<bool, ArrayError> {
    Ok(inputs.text("space")? == "vertex")
}

/// What a difference of numbers is held against: the diagonal, or in other spaces the root mean square distance of the frames from their mean.
fn size(inputs: &Bundle) -> Result<f64, ArrayError> {
    let (shape, given) = inputs.f64("Z", 2)?;
    Ok(match of_vertices(inputs)? {
        true => diagonal(&given[..shape[1]], 3),
        false => (shape::centred_square(inputs.columns("Z")?) / shape[0] as f64).sqrt(),
    })
}

/// What (3), (4) and (7) as claimed are away from the least there can be for this m, these sites, and this k and knot rule at these positions.
fn claims(inputs: &Bundle, a: &Answer) -> Result<[f64; 3], ArrayError> {
    let given = inputs.columns("Z")?;
    let symmetric = inputs.text("rule")? == "symmetric";
    let Some((error_h, x)) = shape::truncated(given, inputs.integer("m")?) else {
        return Ok([f64::INFINITY; 3]);
    };
    let data = shape::centred_square(given);
    let error_g = pose::residual(&a.p, &x, &a.order).map(|left| left.squared_norm_l2());
    let error_f = time::least_error_f(&a.p, inputs.integer("k")?, symmetric);
    let gap = |claimed: f64, found: Option<f64>, data: f64| {
        found.map_or(f64::INFINITY, |found| error_gap(claimed, found, data))
    };
    Ok([
        error_gap(a.errors[0], error_h, data),
        gap(a.errors[1], error_g, x.squared_norm_l2()),
        gap(
            a.errors[2],
            error_f,
            a.p.len() as f64 * diagonal(a.p.as_flattened(), 2).powi(2),
        ),
    ])
}

/// Karni & Gotsman 2004: 100 ||A - A'|| / ||A - E(A)||, E(A) the mean vertex of each frame.
fn kg_percent(given: &[f64], d: usize, error: f64) -> f64 {
    let vertices = d as f64 / 3.0;
    let mut spread = 0.0;
    for frame in given.chunks(d) {
        for axis in 0..3 {
            let values = || frame.iter().skip(axis).step_by(3);
            let mean = values().sum::<f64>() / vertices;
            spread += values().map(|x| (x - mean).powi(2)).sum::<f64>();
        }
    }
    100.0 * share(error.sqrt(), spread.sqrt())
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let (a, b) = (answer(inputs, ours)?, answer(inputs, theirs)?);
    let data = shape::centred_square(inputs.columns("Z")?);
    let size = size(inputs)?;
    let plane = diagonal(a.p.as_flattened(), 2);
    Ok(vec![
        (
            "error_h_difference",
            error_gap(a.errors[0], b.errors[0], data),
        ),
        (
            "error_g_difference",
            error_gap(a.errors[1], b.errors[1], data),
        ),
        (
            "error_f_difference",
            error_gap(a.errors[2], b.errors[2], data),
        ),
        (
            "error_psi_difference",
            error_gap(a.error_psi, b.error_psi, data),
        ),
        ("frame_difference", share(greatest(a.z, b.z), size)),
        (
            "position_difference",
            share(after_rigid_motion(&a.p, &b.p), plane),
        ),
    ])
}
