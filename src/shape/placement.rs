//! Where the components of a surface are, six numbers each: the rotation vector of the component from the reference, by default that of its lowest triangle
//! that is not degenerate, of the axes that [`posed`] gives; then the component's centre over the diagonal. A component of one vertex has no rotation: zeros.

use super::posed::{posed, rest_axes};
use super::reference::{Reference, Triangle};
use crate::linalg::rotation::{Matrix, apply, exp, log, nearest_branch, times_transposed};
use crate::mesh::vector::point;

/// Numbers of a component.
pub const NUMBERS: usize = 6;

/// Writes the 6C numbers of a frame.
pub fn encode(reference: &Reference, positions: &[f64], z: &mut [f64]) {
    encode_turned(reference, positions, rotations_of(reference, positions), z);
}

/// [`encode`] with other rotations of the components; none is zeros.
pub fn encode_turned(
    reference: &Reference,
    positions: &[f64],
    rotations: impl Iterator<Item = Option<Matrix>>,
    z: &mut [f64],
) {
    let mut centres = vec![0.0; 3 * reference.components.len()];
    reference.centres(positions, &mut centres);
    let parts = z.as_chunks_mut::<NUMBERS>().0.iter_mut();
    for ((z, rotation), centre) in parts.zip(rotations).zip(centres.as_chunks::<3>().0) {
        z[..3].copy_from_slice(&rotation.map_or([0.0; 3], |r| log(&r)));
        z[3..].copy_from_slice(centre);
    }
}

/// The rotation of every component from its numbers.
pub fn rotations(z: &[f64]) -> Vec<Matrix> {
    let parts = z.as_chunks::<NUMBERS>().0.iter();
    parts.map(|&[x, y, z, ..]| exp([x, y, z])).collect()
}

/// Moves every component of a frame to its centre.
pub fn place(reference: &Reference, z: &[f64], positions: &mut [f64]) {
    let parts = z.as_chunks::<NUMBERS>().0.iter();
    let centres: Vec<f64> = parts.flat_map(|&[.., x, y, z]| [x, y, z]).collect();
    reference.place(&centres, positions);
}

/// Turns every component of a frame so that its lowest triangle faces as its numbers say, and moves it to its centre.
pub fn turn_and_place(reference: &Reference, z: &[f64], positions: &mut [f64]) {
    let wanted = rotations(z);
    let turns: Vec<_> = rotations_of(reference, positions)
        .zip(&wanted)
        .map(|(found, wanted)| found.map(|found| times_transposed(wanted, &found)))
        .collect();
    let points = positions.as_chunks_mut::<3>().0.iter_mut();
    for (p, &label) in points.zip(&reference.labels) {
        if let Some(turn) = &turns[label as usize] {
            *p = apply(turn, *p);
        }
    }
    place(reference, z, positions);
}

/// Chooses the branches of the rotation vectors nearest to those of `previous`.
pub fn unwrap(previous: &[f64], z: &mut [f64]) {
    let before = previous.as_chunks::<NUMBERS>().0.iter();
    for (z, before) in z.as_chunks_mut::<NUMBERS>().0.iter_mut().zip(before) {
        let [x, y, w, ..] = *z;
        z[..3].copy_from_slice(&nearest_branch(
            [x, y, w],
            [before[0], before[1], before[2]],
        ));
    }
}

fn rotations_of(reference: &Reference, positions: &[f64]) -> impl Iterator<Item = Option<Matrix>> {
    (0..reference.components.len()).map(|component| {
        let (face, rest) = root(reference, component)?;
        let corners = reference.faces()[face].map(|v| point(positions, v));
        Some(times_transposed(
            &posed(rest, corners).axes,
            &rest_axes(rest),
        ))
    })
}

fn root(reference: &Reference, component: usize) -> Option<(usize, &Triangle)> {
    let face = reference.components[component].first_triangle? as usize;
    Some((face, reference.triangles[face].as_ref()?))
}
