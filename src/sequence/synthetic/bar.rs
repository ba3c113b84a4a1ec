//! `@bar`: a box bar under a bend and a twist whose map and gradient are known in closed form.
//!
//! With L the length, beta the total bend and tau the total twist, a rest point X = (x, y, z) goes to B(T(X)), where
//!
//! ```text
//! T(x, y, z) = (x, y cos a - z sin a, y sin a + z cos a)             a = tau x / L       (twist about the axis)
//! B(x, y, z) = (sin(b)/kappa - y sin b, (1 - cos b)/kappa + y cos b, z)   b = kappa x, kappa = beta / L   (bend in the xy plane)
//! ```
//!
//! so that the axis y = z = 0 becomes an arc of the same length. The gradient is DB(T(X)) DT(X) with
//!
//! ```text
//!      | (1 - kappa y) cos b   -sin b   0 |        | 1                               0       0      |
//! DB = | (1 - kappa y) sin b    cos b   0 |   DT = | -(tau/L)(y sin a + z cos a)   cos a   -sin a   |
//!      |  0                     0       1 |        |  (tau/L)(y cos a - z sin a)   sin a    cos a   |
//! ```
//!
//! and the determinant 1 - kappa y', y' being the y of T(X); its mean over the bar is 1, so the map keeps the volume of the bar.

use std::collections::HashMap;

use nalgebra::{Matrix3, Vector3};

use super::{SyntheticError, assemble, grid, smoothstep};
use crate::sequence::Sequence;

/// Length of the bar at rest, along x and centred.
pub const LENGTH: f64 = 6.0;
/// Side of the square section of the bar at rest, along y and z and centred.
pub const THICKNESS: f64 = 0.8;

/// How finely the bar is cut and how many frames there are.
pub(super) struct Size {
    cells: [usize; 3],
    frames: usize,
}

pub(super) const FULL: Size = Size {
    cells: [60, 8, 8],
    frames: 60,
};
pub(super) const SMALL: Size = Size {
    cells: [20, 3, 3],
    frames: 30,
};

/// The bend and the twist of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deformation {
    /// Total bend beta from end to end, in radians.
    pub bend: f64,
    /// Total twist tau from end to end, in radians.
    pub twist: f64,
}

/// The deformation of frame `frame` (0-based) of `frames`: frame 0 is the bar at rest.
///
/// With u = frame / (frames - 1), bend = 150 degrees sin^2(pi u) and twist = 300 degrees (3 u^2 - 2 u^3). No point turns by a half turn or
/// more, so rotations against frame 0 have an unambiguous logarithm.
pub fn deformation(frame: usize, frames: usize) -> Deformation {
    let u = frame as f64 / frames.saturating_sub(1).max(1) as f64;
    Deformation {
        bend: 150_f64.to_radians() * (std::f64::consts::PI * u).sin().powi(2),
        twist: 300_f64.to_radians() * smoothstep(0.0, 1.0, u),
    }
}

impl Deformation {
    /// Where the rest point `rest` goes.
    pub fn position(&self, rest: Vector3<f64>) -> Vector3<f64> {
        let p = self.twisted(rest);
        let kappa = self.bend / LENGTH;
        let half = 0.5 * kappa * p.x;
        let (sin, cos) = (kappa * p.x).sin_cos();
        // sin(b)/kappa and (1 - cos b)/kappa, without dividing by a vanishing kappa
        let along = p.x * sinc(half) * half.cos();
        let across = p.x * sinc(half) * half.sin();
        Vector3::new(along - p.y * sin, across + p.y * cos, p.z)
    }

    /// The 3 x 3 gradient of the deformation at the rest point `rest`: column j is the derivative along rest axis j.
    pub fn gradient(&self, rest: Vector3<f64>) -> Matrix3<f64> {
        let p = self.twisted(rest);
        let rate = self.twist / LENGTH;
        let (sa, ca) = (rate * rest.x).sin_cos();
        let twist = Matrix3::new(1.0, 0.0, 0.0, -rate * p.z, ca, -sa, rate * p.y, sa, ca);
        let kappa = self.bend / LENGTH;
        let (sb, cb) = (kappa * p.x).sin_cos();
        let stretch = 1.0 - kappa * p.y;
        let bend = Matrix3::new(stretch * cb, -sb, 0.0, stretch * sb, cb, 0.0, 0.0, 0.0, 1.0);
        bend * twist
    }

    fn twisted(&self, rest: Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = (self.twist / LENGTH * rest.x).sin_cos();
        Vector3::new(
            rest.x,
            rest.y * cos - rest.z * sin,
            rest.y * sin + rest.z * cos,
        )
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x.sin() / x }
}

pub(super) fn build(size: &Size) -> Result<Sequence, SyntheticError> {
    let (rest, faces) = box_surface(size.cells);
    let frames: Vec<_> = (0..size.frames)
        .map(|i| {
            let map = deformation(i, size.frames);
            rest.iter().map(|&p| map.position(p)).collect()
        })
        .collect();
    assemble(faces, &frames)
}

/// The surface of the box cut into `cells`, outward, each vertex once.
fn box_surface(cells: [usize; 3]) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
    let mut surface = BoxSurface {
        cells,
        index: HashMap::new(),
        points: Vec::new(),
        faces: Vec::new(),
    };
    for (axis, last) in cells.into_iter().enumerate() {
        surface.add_side(axis, 0);
        surface.add_side(axis, last);
    }
    (surface.points, surface.faces)
}

struct BoxSurface {
    cells: [usize; 3],
    index: HashMap<[usize; 3], u32>,
    points: Vec<Vector3<f64>>,
    faces: Vec<[u32; 3]>,
}

impl BoxSurface {
    /// The side where lattice coordinate `axis` equals `level`, which is 0 or the last.
    fn add_side(&mut self, axis: usize, level: usize) {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        for i in 0..self.cells[b] {
            for j in 0..self.cells[c] {
                let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[di, dj]| {
                    let mut at = [0; 3];
                    (at[axis], at[b], at[c]) = (level, i + di, j + dj);
                    self.vertex(at)
                });
                if level == 0 {
                    quad.reverse();
                }
                self.faces.extend(grid::split(quad, (i + j) % 2 == 0));
            }
        }
    }

    fn vertex(&mut self, at: [usize; 3]) -> u32 {
        let next = self.points.len() as u32;
        let index = *self.index.entry(at).or_insert(next);
        if index == next {
            let unit = |axis: usize| at[axis] as f64 / self.cells[axis] as f64 - 0.5;
            let point = Vector3::new(LENGTH * unit(0), THICKNESS * unit(1), THICKNESS * unit(2));
            self.points.push(point);
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use super::super::{checks, embedded};
    use super::*;

    fn probes() -> Vec<Vector3<f64>> {
        let mut points = vec![Vector3::zeros()];
        for x in [-3.0, -1.1, 0.4, 3.0] {
            for y in [-0.4, 0.13] {
                points.extend([-0.27, 0.4].map(|z| Vector3::new(x, y, z)));
            }
        }
        points
    }

    #[test]
    fn frames_are_the_map_applied_to_the_first() {
        let sequence = embedded("@bar").unwrap();
        let rest = checks::points(sequence.frame(0));
        for i in [0, 17, 59] {
            let map = deformation(i, 60);
            for (r, p) in rest.iter().zip(checks::points(sequence.frame(i))) {
                assert!((map.position(*r) - p).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn the_gradient_is_the_derivative_of_the_map() {
        let h = 1e-5;
        for frame in 0..60 {
            let map = deformation(frame, 60);
            for p in probes() {
                let gradient = map.gradient(p);
                for axis in 0..3 {
                    let step = Vector3::ith(axis, h);
                    let slope = (map.position(p + step) - map.position(p - step)) / (2.0 * h);
                    assert!(
                        (gradient.column(axis) - slope).norm() < 1e-9,
                        "{frame} {p:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_bar_never_inverts_nor_turns_by_half_a_turn() {
        for frame in 0..60 {
            for p in probes() {
                let f = deformation(frame, 60).gradient(p);
                let svd = f.svd(true, true);
                let rotation = svd.u.unwrap() * svd.v_t.unwrap();
                assert!(f.determinant() > 0.7);
                assert!(rotation.trace() > -0.95, "{frame} {p:?} {rotation}");
            }
        }
    }

    #[test]
    fn it_is_a_closed_surface_that_keeps_its_volume() {
        for name in ["@bar", "@bar-small"] {
            let sequence = embedded(name).unwrap();
            checks::assert_sphere(&sequence);
            for i in 0..sequence.frame_count() {
                let volume = checks::volume(&sequence, i);
                assert!((volume / 3.84 - 1.0).abs() < 0.04, "{name} {i} {volume}");
            }
        }
    }

    #[test]
    fn it_bends_and_twists_as_stated() {
        assert_eq!(
            deformation(0, 60),
            Deformation {
                bend: 0.0,
                twist: 0.0
            }
        );
        let last = deformation(59, 60);
        assert!(last.bend.abs() < 1e-12);
        assert!((last.twist.to_degrees() - 300.0).abs() < 1e-12);
    }
}
