//! The pairs of triangles across which a surface bends: dihedral angles, and the rotations from triangle to triangle that they and stretches make.

use super::posed::{COLLINEAR, Stretch, stretched};
use super::reference::{Reference, Triangle};
use crate::linalg::rotation::Matrix;
use crate::mesh::dihedral::hinge;
use crate::mesh::topology::{HalfEdge, Pair, Topology};
use crate::mesh::vector::{Point, cross, dot, norm, point, sub};

/// The pairs of an edge: its lowest triangle that is not degenerate (the lowest of all where all are) with each of the others, in their order.
pub fn pairs_of<'a>(
    reference: &Reference,
    edge: usize,
    fan: &'a [HalfEdge],
) -> impl Iterator<Item = Pair> + use<'a> {
    let sound = |half: &HalfEdge| reference.is_sound(half.triangle);
    let hub = fan.iter().position(sound).unwrap_or(0);
    let others = fan.iter().enumerate().filter(move |&(i, _)| i != hub);
    others.map(move |(_, &second)| Pair {
        edge: edge as u32,
        first: fan[hub],
        second,
    })
}

/// Whether neither triangle is degenerate in the reference.
pub fn is_hinge(reference: &Reference, pair: &Pair) -> bool {
    [pair.first, pair.second]
        .iter()
        .all(|half| reference.is_sound(half.triangle))
}

/// The pairs of triangles at all edges, edge by edge, that are not degenerate in the reference.
pub fn hinges<'a>(
    reference: &'a Reference,
    topology: &'a Topology,
) -> impl Iterator<Item = Pair> + 'a {
    let fans = topology.fans().enumerate();
    fans.flat_map(|(edge, fan)| pairs_of(reference, edge, fan))
        .filter(|pair| is_hinge(reference, pair))
}

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

    /// The dihedral angle in a frame whose triangles have these unit normals, in radians; 0 where the edge has no length. With one normal a triangle the
    /// angles at its three sides belong together, however thin it is.
    pub fn angle(&self, positions: &[f64], normals: &[Point]) -> f64 {
        let [i, j, ..] = self.corners;
        let edge = sub(point(positions, j), point(positions, i));
        let length = norm(edge);
        if length == 0.0 {
            return 0.0;
        }
        let [f, g] = self.triangles.map(|t| normals[t as usize]);
        let g = g.map(|x| self.side * x);
        // 0 added, so that flat is +0.
        let sine = dot(cross(f, g), edge) / length + 0.0;
        sine.atan2(dot(f, g))
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
    let rounding = COLLINEAR * (stretch[0].abs() + stretch[1].abs());
    let length = |[x, y]: [f64; 2]| (x * x + y * y).sqrt();
    let mapped = stretched(stretch, edge);
    let (long, rest) = (length(mapped), length(edge));
    let [x, y] = mapped;
    match long > rounding * rest {
        true => [x / long, y / long],
        // A reference's edge has a length.
        false => edge.map(|x| x / rest),
    }
}
