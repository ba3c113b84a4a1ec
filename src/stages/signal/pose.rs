//! Section 3.2: positions in the plane, and the pose signal over them.

use super::super::{Call, StageError, call};
use super::same_count;
use crate::arrays::{Array, Bundle};
use crate::signal::dissimilarities::Dissimilarities;
use crate::signal::g::PoseSignal;
use crate::signal::layout::{Distances, Layout};
use crate::signal::mds::scale;
use crate::signal::pins::{Pin, validate_pins};
use crate::signal::sites::site_order;

/// Forming the dissimilarities is part of the work.
pub fn mds(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    scaling(inputs, Vec::new())
}

pub fn mds_fixed(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let positions = inputs.points("positions")?;
    let fixed = inputs.indices("fixed")?.into_iter();
    let pins: Vec<Pin> = fixed
        .zip(positions)
        .map(|(frame, position)| Pin { frame, position })
        .collect();
    scaling(inputs, pins)
}

fn scaling(inputs: &Bundle, pins: Vec<Pin>) -> Result<Box<dyn Call>, StageError> {
    let x = inputs.matrix("X")?;
    let start = inputs.points("start")?;
    same_count("start", start.len(), x.ncols())?;
    validate_pins(&pins, x.ncols()).map_err(StageError::from_error)?;
    call(
        move || Ok(scale(&Dissimilarities::new(x.as_ref()), &start, &pins)),
        |positions| Bundle::from([("P", Array::points(positions))]),
    )
}

/// Forming the dissimilarities is part of the work.
pub fn layout(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let x = inputs.matrix("X")?;
    let weight = match inputs.vector("weight")? {
        [weight] => *weight,
        other => {
            return Err(StageError::Failed(format!(
                "`weight` has {} numbers, expected 1",
                other.len()
            )));
        }
    };
    let ordered = Layout::Ordered {
        weight: Some(weight),
    };
    ordered.check().map_err(StageError::from_error)?;
    call(
        move || {
            let distances = Distances::new(x.as_ref());
            let positions = distances.positions(x.as_ref(), weight, &[]);
            let (positions, _) = positions.map_err(StageError::from_error)?;
            Ok((distances.mixed(weight), positions))
        },
        |(delta, positions)| {
            Bundle::from([
                ("delta", Array::columns(delta.matrix())),
                ("P", Array::points(positions)),
            ])
        },
    )
}

pub fn rbf(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    let x = inputs.matrix("X")?;
    let sites = inputs.indices("sites")?;
    let query = inputs.points("query")?;
    same_count("P", points.len(), x.ncols())?;
    let n = points.len();
    let asked = [&points[..], &query].concat();
    call(
        move || {
            let pose = PoseSignal::fit(&points, x.as_ref(), &sites);
            let pose = pose.map_err(StageError::from_error)?;
            let values = pose.evaluate(&asked);
            Ok((pose, values))
        },
        move |(pose, values)| {
            let (values, query_values) = values.split_at_col(n);
            Bundle::from([
                ("g", Array::columns(pose.coefficients.as_ref())),
                ("values", Array::columns(values)),
                ("query_values", Array::columns(query_values)),
            ])
        },
    )
}

pub fn sites(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let points = inputs.points("P")?;
    let x = inputs.matrix("X")?;
    let count = inputs.integer("count")?;
    same_count("P", points.len(), x.ncols())?;
    call(
        move || {
            let all = vec![true; points.len()];
            site_order(&points, x.as_ref(), count, &all, &[]).map_err(StageError::from_error)
        },
        |found| {
            Bundle::from([
                ("order", Array::indices(&found.order)),
                ("errors", Array::vector(&found.errors)),
            ])
        },
    )
}
