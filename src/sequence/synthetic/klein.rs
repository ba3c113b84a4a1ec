//! `@klein`: a Klein bottle in space whose section turns while it breathes: closed, without an inside, and with one side only.
//!
//! A figure of eight is carried round a ring and makes half a turn on the way, so that it comes back mirrored and the surface closes with
//! its sides exchanged. With u in [0, 2 pi) round the ring and v in [0, 2 pi) along the eight,
//!
//! ```text
//! a = u / 2 + turn                               the angle of the eight at u
//! r = radius + sin v cos a - sin(2v) sin a       the distance from the axis y
//! (x, y, z) = (r cos u, sin v sin a + sin(2v) cos a, r sin u)
//! ```
//!
//! and (u + 2 pi, v) is the same point as (u, -v), whatever `turn` and `radius` are. The surface passes through itself along the ring, as
//! every Klein bottle in space has to; places along v are taken between multiples of 2 pi / rows, so that no two vertices coincide there.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::{SyntheticError, assemble, grid};
use crate::sequence::Sequence;

/// Number of frames of `@klein` and of `@klein-small`.
pub const FRAMES: usize = 36;

/// Number of quads round the ring and along the eight (even: then both passes through the ring lie between vertices).
pub(super) struct Size {
    columns: usize,
    rows: usize,
}

pub(super) const FULL: Size = Size {
    columns: 96,
    rows: 36,
};
pub(super) const SMALL: Size = Size {
    columns: 28,
    rows: 14,
};

/// The shape of the bottle in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Distance of the centre of the eight from the axis.
    pub radius: f64,
    /// Angle of the eight at u = 0, in radians.
    pub turn: f64,
    /// How much wider the ring is along x than it would be if it were round; as much narrower along z.
    pub oval: f64,
}

/// The bottle in frame `frame` (0-based): over all frames the eight makes 3/4 of a turn while the ring breathes and grows oval.
pub fn shape(frame: usize) -> Shape {
    let u = frame as f64 / (FRAMES - 1) as f64;
    Shape {
        radius: 2.2 + 0.35 * (TAU * u).sin(),
        turn: 1.5 * PI * u,
        oval: 0.15 * (PI * u).sin() * (PI * u).sin(),
    }
}

impl Shape {
    /// The point of the surface at (u, v), in radians.
    pub fn position(&self, u: f64, v: f64) -> Vector3<f64> {
        let (sin_a, cos_a) = (0.5 * u + self.turn).sin_cos();
        let (wide, narrow) = (v.sin(), (2.0 * v).sin());
        let r = self.radius + wide * cos_a - narrow * sin_a;
        Vector3::new(
            (1.0 + self.oval) * r * u.cos(),
            wide * sin_a + narrow * cos_a,
            (1.0 - self.oval) * r * u.sin(),
        )
    }
}

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let frames: Vec<_> = (0..FRAMES).map(|i| points(&shape(i), size)).collect();
    assemble(faces(size), &frames)
}

/// Vertex (column, row) has the index `column rows + row`.
fn points(shape: &Shape, size: &Size) -> Vec<Vector3<f64>> {
    let place = |index: usize| {
        let (column, row) = (index / size.rows, index % size.rows);
        let u = TAU * column as f64 / size.columns as f64;
        let v = TAU * (row as f64 + 0.5) / size.rows as f64;
        shape.position(u, v)
    };
    (0..size.columns * size.rows).map(place).collect()
}

/// The triangles of the grid, its rows closed, and its last column sewn to the first upside down.
fn faces(size: &Size) -> Vec<[u32; 3]> {
    let sewn = |v: u32| {
        let (column, row) = (v as usize / (size.rows + 1), v as usize % (size.rows + 1));
        let row = row % size.rows;
        let own = if column < size.columns {
            column * size.rows + row
        } else {
            size.rows - 1 - row
        };
        own as u32
    };
    let flat = grid::faces(size.columns, size.rows).into_iter();
    flat.map(|face| face.map(sewn)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    const NAMES: [&str; 2] = ["@klein", "@klein-small"];

    #[test]
    fn it_is_closed_and_has_one_side() {
        for name in NAMES {
            let klein = embedded(name).unwrap();
            let shape = checks::manifold(&klein);
            assert_eq!((shape.characteristic, shape.boundary), (0, 0), "{name}");
            assert!(!shape.orientable, "{name}");
        }
    }

    #[test]
    fn once_round_the_ring_the_eight_is_mirrored() {
        for frame in 0..FRAMES {
            let shape = shape(frame);
            for v in [0.1, 1.3, 2.9, 4.0, 6.0] {
                for u in [0.0, 0.4, 3.0] {
                    let apart = shape.position(u + TAU, v) - shape.position(u, -v);
                    assert!(apart.norm() < 1e-13, "frame {frame}: {apart}");
                }
            }
        }
    }

    #[test]
    fn no_two_vertices_coincide_and_no_triangle_is_thin() {
        for name in NAMES {
            let klein = embedded(name).unwrap();
            for i in 0..FRAMES {
                let points = checks::points(klein.frame(i));
                for (a, p) in points.iter().enumerate() {
                    let nearest = points[..a].iter().map(|q| (p - q).norm());
                    assert!(nearest.fold(f64::INFINITY, f64::min) > 0.01, "{name} {i}");
                }
                assert!(checks::thinnest(&klein, i) > 0.2, "{name} {i}");
            }
        }
    }
}
