//! Halfway between two poses that no motion joins.

use super::{ShapeError, Space};

/// The frame whose vector is the mean of those of two frames (3V positions each), with the angles of the second in the branches nearest to those
/// of the first and, in the spaces that have them at triangles, chosen over the surface.
///
/// In a space whose numbers are lengths, angles or rotations a limb bends half as far and keeps its length; the mean of positions cuts across.
pub fn halfway(space: &dyn Space, start: &[f64], end: &[f64]) -> Result<Vec<f64>, ShapeError> {
    let [mut z, mut other] = [start, end].map(|_| vec![0.0; space.dimension()]);
    for (frame, z) in [(start, &mut z), (end, &mut other)] {
        space.encode(frame, z)?;
    }
    space.unwrap_over_surface(&mut z);
    space.unwrap(&z, &mut other);
    space.unwrap_over_surface(&mut other);
    for (z, other) in z.iter_mut().zip(other) {
        *z = 0.5 * (*z + other);
    }
    let mut frame = vec![0.0; space.frame_len()];
    space.decode(&z, &mut frame)?;
    Ok(frame)
}
