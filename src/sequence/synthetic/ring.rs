//! `@loop`: a rubber ring round which a bulge and a wave run, so that the last frame leads into the first.
//!
//! The motion has a period of exactly `FRAMES` frames: a frame after the last would be the first again, with the speed that it had. The
//! bulge goes round once and the wave half way, to where the next crest was, so no frame is another one turned round. Closed and of genus 1.
//!
//! With u round the ring, v round the tube and w = 2 pi at / `FRAMES`:
//!
//! ```text
//! r = 0.26 (1 + 0.5 exp(2.2 (cos(u - w) - 1)))           radius of the tube: the bulge
//! a = v + 0.5 sin(u - w)                                 its skin slips back and forth as the bulge passes
//! (x, y, z) = ((1 + r cos a) cos u, 0.2 sin(2 u - w) + r sin a, -(1 + r cos a) sin u)
//! ```

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid};
use crate::sequence::Sequence;

/// Number of frames of `@loop` and of `@loop-small`: one period.
pub const FRAMES: usize = 32;

/// Number of quads round the ring and round the tube.
pub(super) struct Size {
    columns: usize,
    rows: usize,
}

pub(super) const FULL: Size = Size {
    columns: 96,
    rows: 28,
};
pub(super) const SMALL: Size = Size {
    columns: 36,
    rows: 11,
};

/// The point (u, v) of the ring, in radians, `at` frames into the motion (0-based, any real number).
pub fn position(at: f64, u: f64, v: f64) -> Vector3<f64> {
    let w = TAU * at / FRAMES as f64;
    let tube = 0.26 * (1.0 + 0.5 * (2.2 * ((u - w).cos() - 1.0)).exp());
    let (sin_a, cos_a) = (v + 0.5 * (u - w).sin()).sin_cos();
    let out = 1.0 + tube * cos_a;
    Vector3::new(
        out * u.cos(),
        0.2 * (2.0 * u - w).sin() + tube * sin_a,
        -out * u.sin(),
    )
}

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let frames: Vec<_> = (0..FRAMES).map(|i| points(i as f64, size)).collect();
    assemble(faces(size), &frames)
}

/// Vertex (column, row) has the index `column rows + row`.
fn points(at: f64, size: &Size) -> Vec<Vector3<f64>> {
    let place = |index: usize| {
        let (column, row) = (index / size.rows, index % size.rows);
        let u = TAU * column as f64 / size.columns as f64;
        position(at, u, TAU * row as f64 / size.rows as f64)
    };
    (0..size.columns * size.rows).map(place).collect()
}

/// The triangles of the grid, outward, its columns and rows closed.
fn faces(size: &Size) -> Vec<[u32; 3]> {
    let closed = |v: u32| {
        let (column, row) = (v as usize / (size.rows + 1), v as usize % (size.rows + 1));
        (column % size.columns * size.rows + row % size.rows) as u32
    };
    let flat = grid::faces(size.columns, size.rows).into_iter();
    flat.map(|face| face.map(closed)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    const SIZES: [(&str, Size); 2] = [("@loop", FULL), ("@loop-small", SMALL)];

    #[test]
    fn it_is_a_closed_ring_that_faces_outward() {
        for (name, _) in SIZES {
            let ring = embedded(name).unwrap();
            let shape = checks::manifold(&ring);
            assert_eq!((shape.characteristic, shape.boundary), (0, 0), "{name}");
            assert!(shape.orientable, "{name}");
            for i in 0..FRAMES {
                assert!(checks::volume(&ring, i) > 1.0, "{name} {i}");
                assert!(checks::thinnest(&ring, i) > 0.3, "{name} {i}");
            }
        }
    }

    #[test]
    fn the_frame_after_the_last_is_the_first() {
        for (name, size) in SIZES {
            let ring = embedded(name).unwrap();
            let after = points(FRAMES as f64, &size);
            for (p, q) in checks::points(ring.frame(0)).iter().zip(&after) {
                assert!((p - q).norm() < 1e-14, "{name}");
            }
        }
    }

    /// Neither a step nor a change of step stands out where the end meets the beginning.
    #[test]
    fn the_seam_cannot_be_told_from_other_frames() {
        let ring = embedded("@loop").unwrap();
        let frame = |i: usize| checks::points(ring.frame(i % FRAMES));
        let largest = |i: usize, change: fn([Vector3<f64>; 3]) -> Vector3<f64>| {
            let (a, b, c) = (frame(i), frame(i + 1), frame(i + 2));
            let vertices = 0..a.len();
            let sizes = vertices.map(|v| change([a[v], b[v], c[v]]).norm());
            sizes.fold(0.0, f64::max)
        };
        let step: fn([Vector3<f64>; 3]) -> Vector3<f64> = |[a, b, _]| b - a;
        let bend: fn([Vector3<f64>; 3]) -> Vector3<f64> = |[a, b, c]| a - 2.0 * b + c;
        for change in [step, bend] {
            let inside = (0..FRAMES - 2).map(|i| largest(i, change));
            let greatest = inside.fold(0.0, f64::max);
            for seam in [FRAMES - 2, FRAMES - 1] {
                assert!(largest(seam, change) < 1.02 * greatest);
            }
        }
    }

    #[test]
    fn no_frame_is_another_one() {
        let ring = embedded("@loop").unwrap();
        for i in 0..FRAMES {
            for j in 0..i {
                assert!(checks::distance(&ring, i, j) > 1.0, "{i} {j}");
            }
        }
    }
}
