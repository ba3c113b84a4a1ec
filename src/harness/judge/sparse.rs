//! A symmetric system: what a solution leaves of its right-hand sides.

use super::{Measured, greatest, shaped, share};
use crate::arrays::{ArrayError, Bundle};

/// The greatest entry of A x - b over the greatest row sum of |A| |x| + |b|: the backward error.
pub fn own(inputs: &Bundle, outputs: &Bundle) -> Result<Vec<Measured>, ArrayError> {
    let (shape, b) = inputs.f64("b", 2)?;
    let x = shaped(outputs, "x", shape)?;
    let (rows, cols) = (inputs.indices("rows")?, inputs.indices("cols")?);
    let mut left: Vec<f64> = b.iter().map(|b| -b).collect();
    let mut size: Vec<f64> = b.iter().map(|b| b.abs()).collect();
    for ((&i, &j), value) in rows.iter().zip(&cols).zip(inputs.vector("values")?) {
        let places = if i == j {
            vec![(i, j)]
        } else {
            vec![(i, j), (j, i)]
        };
        for (i, j) in places {
            for a in 0..3 {
                left[3 * i + a] += value * x[3 * j + a];
                size[3 * i + a] += (value * x[3 * j + a]).abs();
            }
        }
    }
    let most = |values: &[f64]| values.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    Ok(vec![("backward_error", share(most(&left), most(&size)))])
}

pub fn against(
    inputs: &Bundle,
    ours: &Bundle,
    theirs: &Bundle,
) -> Result<Vec<Measured>, ArrayError> {
    let shape = inputs.f64("b", 2)?.0;
    let [a, b] = [shaped(ours, "x", shape)?, shaped(theirs, "x", shape)?];
    let size = a.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    Ok(vec![("solution_difference", share(greatest(a, b), size))])
}
