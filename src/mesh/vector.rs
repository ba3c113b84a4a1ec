//! Points and vectors in space, as plain arrays.

pub(crate) type Point = [f64; 3];

/// Vertex `v` of positions `x0 y0 z0 x1 ...`.
#[inline]
pub(crate) fn point(positions: &[f64], v: u32) -> Point {
    positions.as_chunks().0[v as usize]
}

#[inline]
pub(crate) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + t b.
#[inline]
pub(crate) fn along(a: Point, t: f64, b: Point) -> Point {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

#[inline]
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline]
pub(crate) fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}
