//! psi and the whole reconstruction: error (2) from the frames themselves.

use super::scaling::after_rigid_motion;
use super::{Measured, diagonal, error_gap, greatest, pose, shape, shaped, share, time};
use crate::arrays::{ArrayError, Bundle};

/// psi(t) by the formulas, as the harness reads them.
fn psi(inputs: &Bundle, t: f64) -> Result<Vec<f64>, ArrayError> {
    let parameters = inputs.vector("t")?;
    let u = time::hermite(parameters, &time::slopes(parameters), t);
    let p = time::curve(inputs.vector("u")?, &inputs.points("control")?, u);
    let x = pose::evaluate(inputs.columns("g")?, &inputs.points("sites")?, p);
    let h = inputs.columns("H")?;
    let offset = inputs.vector("h0")?;
    Ok((0..h.nrows())
        .map(|r| offset[r] + (0..h.ncols()).map(|j| h[(r, j)] * x[j]).sum::<f64>())
        .collect())
}

fn frames<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<&'a [f64], ArrayError> {
    let (q, d) = (inputs.vector("tau")?.len(), inputs.vector("h0")?.len());
    shaped(outputs, "Z", &[q, d])
}

pub fn psi_own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let z = frames(inputs, outputs)?;
    let d = inputs.vector("h0")?.len();
    let mut worst = 0.0f64;
    for (frame, &t) in z.chunks(d).zip(inputs.vector("tau")?) {
        worst = worst.max(greatest(frame, &psi(inputs, t)?));
    }
    Ok(vec![(
        "formula",
        share(worst, diagonal(inputs.vector("h0")?, 3)),
    )])
}

pub fn psi_against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let difference = greatest(frames(inputs, ours)?, frames(inputs, theirs)?);
    Ok(vec![(
        "frame_difference",
        share(difference, diagonal(inputs.vector("h0")?, 3)),
    )])
}

struct Answer<'a> {
    errors: [f64; 4],
    z: &'a [f64],
    p: Vec<[f64; 2]>,
    /// (2), from the frames.
    error_psi: f64,
}

fn answer<'a>(inputs: &Bundle, outputs: &'a Bundle) -> Result<Answer<'a>, ArrayError> {
    let (shape, given) = inputs.f64("Z", 2)?;
    let z = shaped(outputs, "Z", shape)?;
    shaped(outputs, "P", &[shape[0], 2])?;
    let errors = shaped(outputs, "errors", &[4])?;
    Ok(Answer {
        error_psi: z.iter().zip(given).map(|(a, b)| (a - b).powi(2)).sum(),
        errors: [errors[0], errors[1], errors[2], errors[3]],
        p: outputs.points("P")?,
        z,
    })
}

pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let a = answer(inputs, outputs)?;
    let (shape, given) = inputs.f64("Z", 2)?;
    let (n, d) = (shape[0], shape[1]);
    let data = shape::centred_square(inputs.columns("Z")?);
    let rms = (a.error_psi / (n * d / 3) as f64).sqrt();
    Ok(vec![
        ("error_h", a.errors[0]),
        ("error_g", a.errors[1]),
        ("error_f", a.errors[2]),
        ("error_psi", a.error_psi),
        ("relative_rms", share(rms, diagonal(&given[..d], 3))),
        ("kg_percent", kg_percent(given, d, a.error_psi)),
        (
            "claimed_error_psi",
            error_gap(a.error_psi, a.errors[3], data),
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
    let d = inputs.columns("Z")?.nrows();
    let size = diagonal(&inputs.f64("Z", 2)?.1[..d], 3);
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
