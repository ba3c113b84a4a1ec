//! Equation (1): the representation at any times; and the whole reconstruction of section 3.

use faer::Mat;

use super::super::{Call, StageError, call};
use super::{frames_array, options_of_the_paper, rule, same_count, signal_arrays};
use crate::arrays::{Array, Bundle};
use crate::signal::f::Spline;
use crate::signal::fit::fit;
use crate::signal::g::PoseSignal;
use crate::signal::psi::{Representation, TimeSignal};

/// The representation that the arrays of `signal.psi` describe.
pub fn representation(inputs: &Bundle) -> Result<Representation, StageError> {
    let knots = inputs.vector("u")?.to_vec();
    let control = inputs.points("control")?;
    let sites = inputs.points("sites")?;
    let coefficients = inputs.matrix("g")?;
    let basis = inputs.matrix("H")?;
    let offset = inputs.vector("h0")?.to_vec();
    same_count("u", knots.len(), control.len() + 2)?;
    same_count("g", coefficients.ncols(), sites.len() + 3)?;
    same_count("h0", offset.len(), basis.nrows())?;
    same_count("H", basis.ncols(), coefficients.nrows())?;
    Ok(Representation {
        time: TimeSignal::new(Spline { control, knots }, inputs.vector("t")?.to_vec()),
        pose: PoseSignal {
            sites,
            coefficients,
        },
        offset,
        basis,
    })
}

/// The arrays of `signal.psi` that describe a representation.
pub fn representation_arrays(r: &Representation) -> Bundle {
    let mut arrays = signal_arrays(&r.offset, r.basis.as_ref(), &r.pose, &r.time.spline);
    arrays.put("u", Array::vector(&r.time.spline.knots));
    arrays.put("t", Array::vector(&r.time.parameters));
    arrays
}

pub fn psi(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let representation = representation(inputs)?;
    let times = inputs.vector("tau")?.to_vec();
    let shape = [times.len(), representation.dimension()];
    call(
        move || Ok(representation.evaluate(&times)),
        move |frames| Bundle::from([("Z", frames_array(shape, frames))]),
    )
}

pub fn pipeline(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames: Mat<f64> = inputs.matrix("Z")?;
    let [k, l, m] = ["k", "l", "m"].map(|name| inputs.integer(name));
    let options = options_of_the_paper([k?, l?, m?], rule(inputs)?);
    let n = frames.ncols();
    call(
        move || fit(frames.as_ref(), &options).map_err(StageError::from_error),
        move |fit| {
            let e = fit.errors;
            let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
            let frames = fit.representation.evaluate(&times);
            let d = fit.representation.dimension();
            Bundle::from([
                ("errors", Array::vector(&[e.h, e.g, e.f, e.psi])),
                ("Z", frames_array([n, d], &frames)),
                ("P", Array::points(&fit.positions)),
                ("order", Array::indices(&fit.sites.order)),
            ])
        },
    )
}
