//! The deformation gradients of a frame's triangles, decomposed: T = R S, R a rotation, S symmetric positive semi-definite.
//!
//! T takes a triangle of the reference to the frame's, and the normal to the normal times the square root s of the ratio of areas. In the triangle's plane T
//! is a 3x2 matrix J = Q U, and Q follows without iterating: q1 ~ j1 + j2 x n, q2 = n x q1 (in the plane, Q ~ J + cof J). Then
//! R = [q1 q2 n] [u v n0]^T and S = [u v] U [u v]^T + s n0 n0^T. Triangles are worked on side by side in lanes.

use super::reference::{Reference, Triangle};
use crate::linalg::rotation::{IDENTITY, Matrix};
use crate::mesh::vector::{Point, along, cross, dot, norm, point, sub};

/// Triangles side by side.
pub(super) const LANES: usize = 8;
/// The square of the sine below which a frame's triangle has no normal.
const COLLINEAR: f64 = 1e-28;

/// K numbers of every lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes<const K: usize>([[f64; LANES]; K]);

impl<const K: usize> Lanes<K> {
    pub(super) const ZERO: Self = Self([[0.0; LANES]; K]);

    #[inline(always)]
    pub(super) fn get(&self, lane: usize) -> [f64; K] {
        std::array::from_fn(|k| self.0[k][lane])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, numbers: [f64; K]) {
        for k in 0..K {
            self.0[k][lane] = numbers[k];
        }
    }
}

impl Lanes<9> {
    #[inline(always)]
    pub(super) fn matrix(&self, lane: usize) -> Matrix {
        let [a, b, c, d, e, f, g, h, i] = self.get(lane);
        [[a, b, c], [d, e, f], [g, h, i]]
    }
}

/// What is needed of every triangle of the reference, in blocks of lanes.
#[derive(Debug)]
pub(super) struct Deformation {
    blocks: Vec<Block>,
    triangles: Vec<Option<Triangle>>,
}

#[derive(Clone, Copy, Debug)]
struct Block {
    u: Lanes<3>,
    v: Lanes<3>,
    /// 1 / length, foot / (length height), 1 / height.
    inverse: Lanes<3>,
}

impl Deformation {
    pub(super) fn new(reference: &Reference) -> Self {
        let blocks = reference.triangles.chunks(LANES).map(Block::new).collect();
        Self {
            blocks,
            triangles: reference.triangles.clone(),
        }
    }

    /// The axes u and v of a block of triangles.
    #[inline(always)]
    pub(super) fn axes(&self, block: usize) -> (&Lanes<3>, &Lanes<3>) {
        (&self.blocks[block].u, &self.blocks[block].v)
    }

    /// Which triangles of a block are degenerate in the reference.
    #[inline(always)]
    pub(super) fn degenerate(&self, block: usize, len: usize) -> impl Iterator<Item = bool> {
        self.triangles[block * LANES..block * LANES + len]
            .iter()
            .map(Option::is_none)
    }

    /// The rotations, column by column, and stretches (S_xx, S_yy, S_zz, S_yz, S_xz, S_xy) of a block of triangles. Those of degenerate triangles mean
    /// nothing.
    #[inline(always)]
    pub(super) fn block(
        &self,
        block: usize,
        faces: &[[u32; 3]],
        positions: &[f64],
    ) -> (Lanes<9>, Lanes<6>) {
        let (mut e1, mut e2) = (Lanes::<3>::ZERO, Lanes::<3>::ZERO);
        for (lane, face) in faces.iter().enumerate() {
            let [a, b, c] = face.map(|v| point(positions, v));
            e1.set(lane, sub(b, a));
            e2.set(lane, sub(c, a));
        }
        // By value: the compiler does not see that writing to the results leaves the original alone.
        let reference = self.blocks[block];
        let (mut rotation, mut stretch) = (Lanes::<9>::ZERO, Lanes::<6>::ZERO);
        let mut above = Lanes::<1>::ZERO;
        for lane in 0..LANES {
            let (u, v, inverse) = (
                reference.u.get(lane),
                reference.v.get(lane),
                reference.inverse.get(lane),
            );
            let (r, s, excess) = decompose(e1.get(lane), e2.get(lane), u, v, inverse);
            rotation.set(lane, r);
            stretch.set(lane, s);
            above.set(lane, [excess]);
        }
        for lane in 0..faces.len() {
            if collapsed(above.get(lane))
                && let Some(triangle) = &self.triangles[block * LANES + lane]
            {
                let (r, s) = collinear(e1.get(lane), e2.get(lane), triangle);
                rotation.set(lane, r);
                stretch.set(lane, s);
            }
        }
        (rotation, stretch)
    }
}

impl Block {
    fn new(triangles: &[Option<Triangle>]) -> Self {
        let mut block = Self {
            u: Lanes::ZERO,
            v: Lanes::ZERO,
            inverse: Lanes::ZERO,
        };
        for (lane, triangle) in triangles.iter().enumerate() {
            if let Some(t) = triangle {
                block.u.set(lane, t.u);
                block.v.set(lane, t.v);
                block.inverse.set(
                    lane,
                    [1.0 / t.length, t.foot / t.length / t.height, 1.0 / t.height],
                );
            }
        }
        block
    }
}

/// R, S and a number that is positive where the triangle has a normal; where it has none R and S mean nothing.
#[inline(always)]
fn decompose(
    e1: Point,
    e2: Point,
    u: Point,
    v: Point,
    [along_u, slant, along_v]: Point,
) -> ([f64; 9], [f64; 6], f64) {
    let (l1, l2) = (dot(e1, e1), dot(e2, e2));
    // Only what of e2 is across e1, so that the normal of a thin triangle too is orthogonal to both to rounding.
    let normal = cross(e1, along(e2, -dot(e1, e2) / l1, e1));
    let square = dot(normal, normal);
    let twice_area = square.sqrt();
    let per_area = 1.0 / twice_area;
    let n = normal.map(|x| x * per_area);
    let j1 = e1.map(|x| x * along_u);
    let j2: Point = std::array::from_fn(|i| e2[i] * along_v - e1[i] * slant);
    let q1 = along(j1, 1.0, cross(j2, n));
    let per_size = 1.0 / norm(q1);
    let q1 = q1.map(|x| x * per_size);
    let q2 = cross(n, q1);
    let u11 = dot(q1, j1);
    let u22 = dot(q2, j2);
    let u12 = 0.5 * (dot(q1, j2) + dot(q2, j1));
    let s = (twice_area * along_u * along_v).sqrt();
    let n0 = cross(u, v);
    let r = |i: usize, j: usize| q1[i] * u[j] + q2[i] * v[j] + n[i] * n0[j];
    let stretch = |i: usize, j: usize| {
        let (p, q) = (u11 * u[j] + u12 * v[j], u12 * u[j] + u22 * v[j]);
        u[i] * p + v[i] * q + s * n0[i] * n0[j]
    };
    (
        [
            r(0, 0),
            r(1, 0),
            r(2, 0),
            r(0, 1),
            r(1, 1),
            r(2, 1),
            r(0, 2),
            r(1, 2),
            r(2, 2),
        ],
        [
            stretch(0, 0),
            stretch(1, 1),
            stretch(2, 2),
            stretch(1, 2),
            stretch(0, 2),
            stretch(0, 1),
        ],
        square - COLLINEAR * (l1 * l2),
    )
}

fn collapsed([above]: [f64; 1]) -> bool {
    above <= 0.0 || above.is_nan()
}

/// R and S of a triangle that is a segment or a point in the frame: T = size a b^T with unit vectors a and b. S = size b b^T; of the rotations that take b
/// to a, R is that of least angle (half a turn about the reference's normal where a = -b, none where the triangle is a point).
#[cold]
fn collinear(e1: Point, e2: Point, triangle: &Triangle) -> ([f64; 9], [f64; 6]) {
    let j1 = e1.map(|x| x / triangle.length);
    let j2: Point = std::array::from_fn(|i| (e2[i] - j1[i] * triangle.foot) / triangle.height);
    let longer = if norm(j1) >= norm(j2) { j1 } else { j2 };
    let length = norm(longer);
    if length == 0.0 {
        return (flatten(IDENTITY), [0.0; 6]);
    }
    let a = longer.map(|x| x / length);
    let (p, q) = (dot(a, j1), dot(a, j2));
    let size = (p * p + q * q).sqrt();
    let b: Point = std::array::from_fn(|i| (p * triangle.u[i] + q * triangle.v[i]) / size);
    let stretch = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)].map(|(i, j)| size * b[i] * b[j]);
    (flatten(least_turn(b, a, triangle.normal())), stretch)
}

/// The rotation of least angle that takes unit vector `from` to `to`; about `axis`, orthogonal to both, where they are opposite.
fn least_turn(from: Point, to: Point, axis: Point) -> Matrix {
    let half: Point = std::array::from_fn(|i| from[i] + to[i]);
    let length = norm(half);
    // Two reflections make the rotation: in the plane across `from`, then across the half way vector.
    let middle = match length > 1e-8 {
        true => half.map(|x| x / length),
        false => cross(axis, from),
    };
    let reflect = |x: Point, m: Point| along(x, -2.0 * dot(x, m), m);
    IDENTITY.map(|x| reflect(reflect(x, from), middle))
}

fn flatten(m: Matrix) -> [f64; 9] {
    std::array::from_fn(|k| m[k / 3][k % 3])
}
