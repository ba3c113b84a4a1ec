//! A triangle of the reference in some frame: how it is stretched in its plane, and where it faces.
//!
//! In the plane's coordinates along the reference's u and v, and likewise those of the frame's triangle, the triangle is mapped by F2 = R2 U with a rotation
//! R2 and U symmetric positive semi-definite: the *stretch*, which lengths alone decide.

use super::reference::Triangle;
use crate::linalg::rotation::{Matrix, plane_polar};
use crate::mesh::vector::{Point, along, cross, dot, norm, sub};

/// The sine below which a triangle's corners lie on a line.
pub const COLLINEAR: f64 = 1e-14;

/// The square of the sine above which a single cross product of a triangle's edges gives its normal to rounding.
const WIDE: f64 = 1e-2;
/// Products below this may have lost digits.
const PRECISE: f64 = f64::MIN_POSITIVE / f64::EPSILON;

/// A unit vector's part across a line that is no longer than this is rounding.
const NEARLY_ALONG: f64 = 1e-7;

/// U_11, U_22, U_12.
pub type Stretch = [f64; 3];

/// The stretch of what has kept its shape.
pub const UNSTRETCHED: Stretch = [1.0, 1.0, 0.0];

/// U x.
#[inline(always)]
pub fn stretched([xx, yy, xy]: Stretch, [x, y]: [f64; 2]) -> [f64; 2] {
    [xx * x + xy * y, xy * x + yy * y]
}

/// A triangle's stretch and its axes u, v and normal, turned by R2 from its first edge: the edge that is e in the reference's plane is [u v] U e.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posed {
    pub stretch: Stretch,
    pub axes: Matrix,
}

/// The axes of a triangle of the reference.
pub fn rest_axes(rest: &Triangle) -> Matrix {
    [rest.u, rest.v, rest.normal()]
}

/// Measures a triangle with these corners. One whose corners lie on a line ([`COLLINEAR`]) faces, of all ways across the longer of its first and last side,
/// the one nearest to the reference's.
pub fn posed(rest: &Triangle, [a, b, c]: [Point; 3]) -> Posed {
    let (e1, e2) = (sub(b, a), sub(c, a));
    let [first, second] = plane_axes(rest, e1, e2);
    let polar = plane_polar(plane_map(
        rest,
        dot(e1, first),
        dot(e2, first),
        dot(e2, second).max(0.0),
    ));
    let [cos, sin] = polar.turn;
    let axis = |x: f64, y: f64| std::array::from_fn(|i| x * first[i] + y * second[i]);
    Posed {
        stretch: polar.stretch,
        axes: [axis(cos, sin), axis(-sin, cos), cross(first, second)],
    }
}

/// The unit normal of a triangle with these corners, as [`posed`] has it.
pub fn normal(rest: &Triangle, [a, b, c]: [Point; 3]) -> Point {
    let (e1, e2) = (sub(b, a), sub(c, a));
    let across = cross(e1, e2);
    let square = dot(across, across);
    if square > (WIDE * dot(e1, e1) * dot(e2, e2)).max(PRECISE) {
        let length = square.sqrt();
        return across.map(|x| x / length);
    }
    let [first, second] = plane_axes(rest, e1, e2);
    cross(first, second)
}

/// Orthonormal axes of the plane of a triangle with these edges.
#[inline(always)]
fn plane_axes(rest: &Triangle, e1: Point, e2: Point) -> [Point; 2] {
    if let Some(first) = unit(e1) {
        let upright = across(e2, first);
        let height = norm(upright);
        if height > COLLINEAR * norm(e2) {
            return [first, upright.map(|x| x / height)];
        }
    }
    line_axes(rest, e1, e2)
}

/// The same of one whose corners lie on a line.
#[cold]
fn line_axes(rest: &Triangle, e1: Point, e2: Point) -> [Point; 2] {
    let longer = if norm(e2) > norm(e1) { e2 } else { e1 };
    let first = unit(longer).unwrap_or(rest.u);
    // The part of the reference's normal across the line; where it is along the line all ways across are as near.
    let facing = across(rest.normal(), first);
    let facing = match norm(facing) > NEARLY_ALONG {
        true => facing,
        false => across(rest.u, first),
    };
    [first, cross(unit(facing).unwrap_or(rest.v), first)]
}

/// By columns, the map of the plane that takes (length, 0) and (foot, height) of the reference to (length, 0) and (foot, height).
fn plane_map(rest: &Triangle, length: f64, foot: f64, height: f64) -> [[f64; 2]; 2] {
    let along = length / rest.length;
    [
        [along, 0.0],
        [
            (foot - along * rest.foot) / rest.height,
            height / rest.height,
        ],
    ]
}

/// The stretch of a triangle with these sides ab, bc and ca, none below 0. Sides that make no triangle make the flat one whose ab and ca are as given.
pub fn stretch_of_sides(rest: &Triangle, [ab, bc, ca]: [f64; 3]) -> Stretch {
    if ab == 0.0 {
        return plane_polar(plane_map(rest, 0.0, ca, 0.0)).stretch;
    }
    let foot = 0.5 * (ab + (ca - bc) / ab * (ca + bc));
    let height = 2.0 * area_of_sides([ab, bc, ca]) / ab;
    plane_polar(plane_map(rest, ab, foot.clamp(-ca, ca), height)).stretch
}

/// The area of a triangle with these sides, 0 where they make none: Heron's formula without cancellation (Kahan 2014).
pub fn area_of_sides(mut sides: [f64; 3]) -> f64 {
    sides.sort_unstable_by(|a, b| b.total_cmp(a));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    0.25 * product.max(0.0).sqrt()
}

fn across(x: Point, axis: Point) -> Point {
    let once = along(x, -dot(x, axis), axis);
    // Once more, because a thin triangle leaves little.
    along(once, -dot(once, axis), axis)
}

fn unit(x: Point) -> Option<Point> {
    let length = norm(x);
    (length > 0.0).then(|| x.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wide triangles take one way to their normal and thin ones another.
    #[test]
    fn normals_are_those_of_the_axes_however_thin_the_triangle() {
        let (a, b) = ([0.3, -0.2, 0.1], [1.1, 0.4, -0.3]);
        let corners = |height: f64| {
            let foot: Point = std::array::from_fn(|i| a[i] + 0.6 * (b[i] - a[i]));
            [a, b, along(foot, height, [0.6, -0.8, 0.0])]
        };
        let rest = Triangle::new(corners(0.5)).unwrap();
        for digits in 0..12 {
            let corners = corners(10f64.powi(-digits));
            let found = normal(&rest, corners);
            let expected = posed(&rest, corners).axes[2];
            assert!(norm(sub(found, expected)) < 1e-14, "height 1e-{digits}");
        }
    }
}
