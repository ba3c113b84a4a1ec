//! The joint refinement, beyond section 3.

use faer::MatRef;

use super::super::{Call, StageError, call};
use super::{same_count, signal_arrays};
use crate::arrays::{Array, Bundle};
use crate::signal::f::Spline;
use crate::signal::h::shape_signal;
use crate::signal::psi::Representation;
use crate::signal::refine::rows::Rows;
use crate::signal::refine::{RefineOptions, Signals, minimise};

/// The most steps of a refinement that is judged, and the share below which steps gain nothing.
const STEPS: usize = 2000;
const EXACT: f64 = 1e-15;
/// What a refinement without a start says.
const NOTHING: &str = "there is nothing to refine: fewer than three sites, or functions that are dependent along the curve";

pub fn refine(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let rows = Rows {
        targets: inputs.columns("Y")?.transpose().to_owned(),
        parameters: inputs.vector("t")?.to_vec(),
        weights: inputs.vector("w")?.to_vec(),
    };
    let spline = Spline {
        control: inputs.points("control")?,
        knots: inputs.vector("u")?.to_vec(),
    };
    let sites = inputs.points("sites")?;
    let m = inputs.columns("H")?.ncols();
    same_count("t", rows.parameters.len(), rows.targets.nrows())?;
    same_count("w", rows.weights.len(), rows.targets.nrows())?;
    let options = RefineOptions {
        iterations: inputs.integer("iterations")?,
        tolerance: EXACT,
        hold_sites: true,
        ..RefineOptions::default()
    };
    call(
        move || {
            let found = minimise(&rows, &spline, &sites, m, &options);
            found.ok_or_else(|| StageError::Failed(NOTHING.into()))
        },
        |found| {
            let mut outputs = arrays(&found.signals);
            outputs.put("error", Array::vector(&[found.error]));
            outputs
        },
    )
}

fn arrays(s: &Signals) -> Bundle {
    signal_arrays(&s.offset, s.basis.as_ref(), &s.pose, &s.spline)
}

/// A fit in the coordinates of all principal components of the frames, refined already with its sites held, but not to the end: the error has
/// several minima, and the one that two engines find must be the same.
pub fn inputs(
    frames: MatRef<'_, f64>,
    psi: &Representation,
    m: usize,
) -> Result<Bundle, StageError> {
    let whole =
        shape_signal(frames, frames.ncols().saturating_sub(1)).map_err(StageError::from_error)?;
    let between = RefineOptions::default().between;
    let rows = Rows::of_frames(whole.coordinates.as_ref(), &psi.time.parameters, between);
    let options = RefineOptions {
        hold_sites: true,
        ..RefineOptions::default()
    };
    let (spline, sites) = (&psi.time.spline, &psi.pose.sites);
    let near = minimise(&rows, spline, sites, m, &options);
    let near = near
        .ok_or_else(|| StageError::Failed(NOTHING.into()))?
        .signals;
    let mut inputs = arrays(&near);
    inputs.put("u", Array::vector(&near.spline.knots));
    inputs.put("Y", Array::columns(rows.targets.transpose()));
    inputs.put("t", Array::vector(&rows.parameters));
    inputs.put("w", Array::vector(&rows.weights));
    inputs.put("iterations", Array::integer(STEPS));
    Ok(inputs)
}
