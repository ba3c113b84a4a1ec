//! The distance from a point to a triangle, however degenerate.

use super::vector::{Point, along, cross, dot, sub};

/// Below this squared sine between two sides a foot point inside is not trusted alone: the sides are looked at too.
const SLIVER: f64 = 1e-6;

/// The squared distance from `p` to a triangle; three equal or collinear corners stand for a point or a segment.
///
/// Every candidate is a point of the triangle, so rounding never makes the distance too small by more than its own
/// relative 1e-15 of the coordinates' size.
pub(super) fn distance_squared(p: Point, triangle: &[Point; 3]) -> f64 {
    let &[a, b, c] = triangle;
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let normal = cross(ab, ac);
    let squared = dot(normal, normal);
    // Barycentric coordinates of the foot of the perpendicular (infinite or NaN, hence not inside, when degenerate).
    let u = dot(cross(ap, ac), normal) / squared;
    let v = dot(cross(ab, ap), normal) / squared;
    let mut nearest = f64::INFINITY;
    if u > 0.0 && v > 0.0 && u + v < 1.0 {
        let off = sub(p, along(along(a, u, ab), v, ac));
        nearest = dot(off, off);
        let side = dot(ab, ab).max(dot(ac, ac));
        if squared > SLIVER * side * side {
            return nearest;
        }
    }
    for (from, to) in [(a, b), (b, c), (c, a)] {
        nearest = nearest.min(to_segment(p, from, to));
    }
    nearest
}

fn to_segment(p: Point, a: Point, b: Point) -> f64 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let length = dot(ab, ab);
    let t = match length > 0.0 {
        true => (dot(ap, ab) / length).clamp(0.0, 1.0),
        false => 0.0,
    };
    let off = sub(p, along(a, t, ab));
    dot(off, off)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_region_in_closed_form() {
        let triangle = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]];
        for (p, expected) in [
            ([1.0, 1.0, 2.0], 4.0),
            ([1.0, 1.0, 0.0], 0.0),
            ([2.0, -1.0, 0.0], 1.0),
            ([-2.0, 1.0, 1.0], 5.0),
            ([4.0, 3.0, 0.0], 5.76),
            ([-1.0, -1.0, 1.0], 3.0),
            ([6.0, 0.0, 0.0], 4.0),
            ([0.0, 5.0, 1.0], 5.0),
        ] {
            let found = distance_squared(p, &triangle);
            assert!(
                (found - expected).abs() < 1e-14,
                "{p:?}: {found} {expected}"
            );
        }
    }

    #[test]
    fn degenerate_triangles_are_segments_and_points() {
        let (a, b, m) = ([0.0; 3], [3.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        for triangle in [
            [a, b, m],
            [m, a, b],
            [b, m, a],
            [a, b, b],
            [a, a, b],
            [b, a, b],
        ] {
            assert_eq!(
                distance_squared([2.0, 2.0, 0.0], &triangle),
                4.0,
                "{triangle:?}"
            );
            assert_eq!(
                distance_squared([5.0, 0.0, 0.0], &triangle),
                4.0,
                "{triangle:?}"
            );
        }
        assert_eq!(distance_squared([1.0, 2.0, 3.0], &[[1.0; 3]; 3]), 5.0);
    }

    #[test]
    fn inside_a_sliver() {
        for height in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
            let triangle = [[0.1, 0.2, 0.3], [1.1, 0.2, 0.3], [0.7, 0.2 + height, 0.3]];
            let found = distance_squared([0.6, 0.2 + height / 4.0, 0.3], &triangle).sqrt();
            assert!(found < 1e-8, "{height}: {found}");
            let found = distance_squared([0.6, 0.2, 1.3], &triangle).sqrt();
            assert!((found - 1.0).abs() < 1e-13, "{height}: {found}");
        }
    }
}
