//! The pairs of triangles across which a surface bends: dihedral angles, and the rotations from triangle to triangle that they and stretches make.

use super::posed::{Stretch, stretched};
use super::reference::{Reference, Triangle};
use crate::linalg::rotation::Matrix;
use crate::mesh::dihedral::{dihedral_angle, hinge};
use crate::mesh::topology::{HalfEdge, Pair};
use crate::mesh::vector::point;

/// A pair of triangles that are not degenerate in the reference.
#[derive(Clone, Copy, Debug)]
pub struct Hinge {
    /// f and g, 0-based.
    pub triangles: [u32; 2],
    /// See [`hinge`].
    pub corners: [u32; 4],
    /// The shared edge in the planes of f and of g, in the direction in which f runs along it.
    edge: [[f64; 2]; 2],
    /// 1 where g runs the other way, -1 where its normal has to be negated.
    side: f64,
}

impl Hinge {
    /// None where either triangle is degenerate in the reference.
    pub fn new(reference: &Reference, pair: &Pair) -> Option<Self> {
        let triangle = |half: &HalfEdge| reference.triangles[half.triangle as usize].as_ref();
        let f = side_in_plane(triangle(&pair.first)?, pair.first.corner);
        let g = side_in_plane(triangle(&pair.second)?, pair.second.corner);
        let side = if pair.first.ascending == pair.second.ascending {
            -1.0
        } else {
            1.0
        };
        Some(Self {
            triangles: [pair.first.triangle, pair.second.triangle],
            corners: hinge(pair, reference.faces()),
            edge: [f, g.map(|x| -side * x)],
            side,
        })
    }

    /// The dihedral angle in a frame.
    pub fn angle(&self, positions: &[f64]) -> f64 {
        dihedral_angle(self.corners.map(|v| point(positions, v)))
    }

    /// C_fg: the axes of g are those of f times it, where the stretches of f and g and the dihedral angle are these. With the edge's directions a in f and b
    /// in g, C_fg = [a, n x a, n] Rx(angle) [b, n' x b, n']^T, n the third axis and n' = side n. An edge of no length keeps its direction in the reference.
    #[inline(always)]
    pub fn turn(&self, f: Stretch, g: Stretch, angle: f64) -> Matrix {
        let [a, b] = [direction(f, self.edge[0]), direction(g, self.edge[1])];
        let (sin, cos) = angle.sin_cos();
        let across = [-cos * a[1], cos * a[0], sin].map(|x| self.side * x);
        let up = [sin * a[1], -sin * a[0], cos].map(|x| self.side * x);
        [
            [
                a[0] * b[0] - across[0] * b[1],
                a[1] * b[0] - across[1] * b[1],
                -across[2] * b[1],
            ],
            [
                a[0] * b[1] + across[0] * b[0],
                a[1] * b[1] + across[1] * b[0],
                across[2] * b[0],
            ],
            up,
        ]
    }
}

/// The side of a triangle from its corner number `corner` on, in its plane.
fn side_in_plane(t: &Triangle, corner: u8) -> [f64; 2] {
    match corner {
        0 => [t.length, 0.0],
        1 => [t.foot - t.length, t.height],
        _ => [-t.foot, -t.height],
    }
}

fn direction(stretch: Stretch, edge: [f64; 2]) -> [f64; 2] {
    unit(stretched(stretch, edge))
        .or_else(|| unit(edge))
        .unwrap_or([1.0, 0.0])
}

fn unit([x, y]: [f64; 2]) -> Option<[f64; 2]> {
    let length = (x * x + y * y).sqrt();
    (length > 0.0).then(|| [x / length, y / length])
}
