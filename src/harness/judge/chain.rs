//! psi by its formulas.

use super::{Measured, diagonal, greatest, pose, shaped, share, time};
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
