//! Section 3.1: the shape signal.

use super::super::{Call, StageError, call};
use crate::arrays::{Array, Bundle};
use crate::signal::h::shape_signal;

pub fn h(inputs: &Bundle) -> Result<Box<dyn Call>, StageError> {
    let frames = inputs.matrix("Z")?;
    let m = inputs.integer("m")?;
    call(
        move || shape_signal(frames.as_ref(), m).map_err(StageError::from_error),
        |shape| {
            let m = shape.basis.ncols();
            Bundle::from([
                ("h0", Array::vector(&shape.offset)),
                ("H", Array::columns(shape.basis.as_ref())),
                ("X", Array::columns(shape.coordinates.as_ref())),
                ("sigma", Array::vector(&shape.singular_values[..m])),
            ])
        },
    )
}
