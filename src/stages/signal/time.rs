//! Section 3.3: the time signal, and the reparametrisation of section 2.3.

use super::super::{Call, StageError, call};
use super::rule;
use crate::arrays::{Array, Bundle};
use crate::signal::f::Spline;
use crate::signal::knots::knots;
use crate::signal::parameters::centripetal;
use crate::signal::rho::Rho;

pub fn parameters(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    call(
        move || Ok(centripetal(&points)),
        |t| Bundle::from([("t", Array::vector(t))]),
    )
}

pub fn knot_vector(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let k = inputs.integer("k")?;
    let rule = rule(inputs)?;
    call(
        move || knots(&t, k, rule).map_err(StageError::from_error),
        |u| Bundle::from([("u", Array::vector(u))]),
    )
}

pub fn spline(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let u = inputs.vector("u")?.to_vec();
    let points = inputs.points("P")?;
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let fitted = Spline::fit_with_values(&t, &points, &u);
            let (spline, values) = fitted.map_err(StageError::from_error)?;
            let query_values = spline.evaluate_all(&query);
            Ok((spline, [values, query_values]))
        },
        |(spline, [values, query_values])| {
            Bundle::from([
                ("control", Array::points(&spline.control)),
                ("values", Array::points(values)),
                ("query_values", Array::points(query_values)),
            ])
        },
    )
}

pub fn rho(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let t = inputs.vector("t")?.to_vec();
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let rho = Rho::new(&t);
            let values: Vec<f64> = query.iter().map(|&q| rho.evaluate(q)).collect();
            Ok((rho, values))
        },
        |(rho, values)| {
            Bundle::from([
                ("values", Array::vector(values)),
                ("slopes", Array::vector(rho.slopes())),
            ])
        },
    )
}
