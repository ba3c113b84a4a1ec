//! Section 4: knots inserted for an edit, and transfer.

use super::super::{Call, StageError, call};
use super::{Choice, frames_array};
use crate::arrays::{Array, Bundle};
use crate::sequence::Sequence;
use crate::shape::{SpaceKind, encode_examples, prepare_for};
use crate::signal::f::Spline;
use crate::signal::insert::insert_knots;
use crate::signal::transfer::{ExampleBasis, frames_of_coordinates};

pub fn more_knots(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let spline = Spline {
        control: inputs.points("control")?,
        knots: inputs.vector("u")?.to_vec(),
    };
    let insert = inputs.vector("insert")?.to_vec();
    let query = inputs.vector("query")?.to_vec();
    call(
        move || {
            let refined = insert_knots(&spline, &insert).map_err(StageError::from_error)?;
            let values = refined.evaluate_all(&query);
            Ok((refined, values))
        },
        |(refined, values)| {
            Bundle::from([
                ("u", Array::vector(&refined.knots)),
                ("control", Array::points(&refined.control)),
                ("values", Array::points(values)),
            ])
        },
    )
}

pub fn transfer(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames = inputs.matrix("Z")?;
    let source = inputs.matrix("Q")?;
    let target = inputs.matrix("R")?;
    let target_rows = target.nrows();
    call(
        move || {
            let basis = ExampleBasis::new(source.as_ref()).map_err(StageError::from_error)?;
            let x = basis.coordinates(frames.as_ref());
            let x = x.map_err(StageError::from_error)?;
            let moved = frames_of_coordinates(x.as_ref(), target.as_ref());
            Ok((x, moved.map_err(StageError::from_error)?))
        },
        move |(x, moved)| {
            Bundle::from([
                ("X", Array::columns(x.as_ref())),
                ("W", frames_array([x.ncols(), target_rows], moved)),
            ])
        },
    )
}

/// Frames of a sequence, m + 1 of them as examples, and those again in the gradient space, which stands for another mesh.
pub fn transfer_inputs(sequence: &Sequence, choice: &Choice) -> Result<Bundle, StageError> {
    let (n, d) = (sequence.frame_count(), sequence.dimension());
    let count = (choice.m + 1).clamp(2, n.max(2));
    let chosen: Vec<usize> = (0..count.min(n)).map(|j| j * n / count).collect();
    let examples = sequence.select(&chosen).map_err(StageError::from_error)?;
    let (mesh, poses) = (examples.connectivity(), examples.positions());
    let space = prepare_for(SpaceKind::Gradient, mesh, poses);
    let space = space.map_err(StageError::from_error)?;
    let target = encode_examples(&*space, poses).map_err(StageError::from_error)?;
    let rows = |data: &[f64]| frames_array([data.len() / d, d], data);
    Ok(Bundle::from([
        ("Z", rows(sequence.positions())),
        ("Q", rows(examples.positions())),
        ("R", Array::columns(target.as_ref())),
    ]))
}
