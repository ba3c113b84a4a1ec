//! Judgement: quantities recomputed from the arrays that an engine returned, and differences between two engines in canonical form.
//!
//! Nothing here calls an algorithm of this crate: formulas are written out again, plainly, so that a fault in an algorithm cannot hide.

mod chain;
mod distance;
mod edge_lengths;
mod encoding;
mod forms;
mod halfway;
mod patched;
mod pipeline;
mod pose;
mod quality;
mod refinement;
mod scaling;
mod shape;
mod sparse;
mod time;
mod transfer;

use crate::arrays::{ArrayError, Bundle};

/// A quantity and its value; 0 is perfect for every quantity that has a tolerance.
pub type Measured = (&'static str, f64);

/// What the quantities of one stage are.
struct Judge {
    /// Recomputed from the inputs and one engine's outputs.
    own: Own,
    /// Differences between our outputs and another engine's, sign, order, gauge and rigid motion removed.
    against: Against,
}

type Own = fn(&Bundle, &Bundle) -> Result<Vec<Measured>, ArrayError>;
type Against = fn(&Bundle, &Bundle, &Bundle) -> Result<Vec<Measured>, ArrayError>;

fn judge(stage: &str) -> Option<Judge> {
    let (own, against): (Own, Against) = match stage {
        "sequence.read" => (distance::read_own, distance::read_against),
        "sequence.distance" => (distance::own, distance::against),
        "mesh.quality" => (quality::own, quality::against),
        "shape.gradient_encode" => (encoding::gradient_own, encoding::gradient_against),
        "shape.lric_encode" => (forms::own, forms::against),
        "shape.lengths_encode" => (edge_lengths::own, edge_lengths::against),
        "shape.lengths_decode" => (edge_lengths::descended_own, encoding::decoded_against),
        "shape.patch_encode" => (patched::own, patched::against),
        "shape.gradient_decode" | "shape.lric_decode" | "shape.patch_decode" => {
            (encoding::decoded_own, encoding::decoded_against)
        }
        "shape.poisson_factor" | "shape.poisson_solve" => (sparse::own, sparse::against),
        "shape.halfway" => (halfway::own, halfway::against),
        "signal.h" => (shape::own, shape::against),
        "signal.mds" => (scaling::own, scaling::against),
        "signal.mds_fixed" => (scaling::fixed_own, scaling::fixed_against),
        "signal.layout" => (scaling::layout_own, scaling::layout_against),
        "signal.rbf" => (pose::rbf_own, pose::rbf_against),
        "signal.sites" => (pose::sites_own, pose::sites_against),
        "signal.parameters" => (time::parameters_own, time::parameters_against),
        "signal.knots" => (time::knots_own, time::knots_against),
        "signal.spline" => (time::spline_own, time::spline_against),
        "signal.rho" => (time::rho_own, time::rho_against),
        "signal.psi" => (chain::psi_own, chain::psi_against),
        "signal.insert_knots" => (time::more_knots_own, time::more_knots_against),
        "signal.transfer" => (transfer::own, transfer::against),
        "signal.refine" => (refinement::own, refinement::against),
        "signal" => (pipeline::own, pipeline::against),
        _ => return None,
    };
    Some(Judge { own, against })
}

/// Quantities of one engine's answer. An answer that lacks an array, or has it in another shape, is an error.
pub fn own(stage: &str, inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    judge(stage).map_or(Ok(Vec::new()), |judge| (judge.own)(inputs, outputs))
}

/// Differences of `theirs` from `ours`; both have been through [`own`].
pub fn against(
    stage: &str,
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    judge(stage).map_or(Ok(Vec::new()), |judge| {
        (judge.against)(inputs, ours, theirs)
    })
}

/// An error unless the f64 array has exactly this shape.
fn shaped<'a>(bundle: &'a Bundle, name: &str, shape: &[usize]) -> Result<&'a [f64], ArrayError> {
    let (found, data) = bundle.f64(name, shape.len())?;
    if found == shape {
        return Ok(data);
    }
    Err(ArrayError {
        name: name.into(),
        expected: format!("shape {shape:?}"),
        found: format!("shape {found:?}"),
    })
}

/// The greatest absolute difference of two lists of the same length.
fn greatest(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// value / scale, with 0 / 0 = 0.
fn share(value: f64, scale: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value / scale }
}

fn square(data: &[f64]) -> f64 {
    data.iter().map(|x| x * x).sum()
}

/// The relative difference of two sums of squares, or their difference as a share of a millionth of the data where both are below that.
fn error_gap(a: f64, b: f64, data: f64) -> f64 {
    share((a - b).abs(), a.max(b).max(1e-6 * data))
}

/// The diagonal of the box around points given as rows of `width` numbers.
fn diagonal(data: &[f64], width: usize) -> f64 {
    let extent = |axis: usize| {
        let values = || data.iter().skip(axis).step_by(width);
        let high = values().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = values().copied().fold(f64::INFINITY, f64::min);
        if high >= low { high - low } else { 0.0 }
    };
    (0..width).map(|a| extent(a).powi(2)).sum::<f64>().sqrt()
}
