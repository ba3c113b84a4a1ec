//! Dihedral angles: how much a surface is creased where two triangles meet.
//!
//! A hinge is four vertices [i, j, k, l]: triangle f runs along the edge from i to j and has k across from it, the other triangle has l. With the unit
//! normals n_f ~ (j - i) x (k - i) and n_g ~ (l - i) x (j - i), which is g's own normal where g runs from j to i and the opposite one where it runs the same
//! way as f, and t from i to j, the angle is atan2((n_f x n_g) . t, n_f . n_g), from -pi to pi. Flat is 0; convex edges of a surface that faces outward are
//! positive. Exchanging the triangles, or turning both round, changes nothing.

use super::topology::Pair;
use super::vector::{Point, cross, dot, norm, sub};

/// The hinge of a pair of triangles, as vertices 0-based.
pub fn hinge(pair: &Pair, faces: &[[u32; 3]]) -> [u32; 4] {
    let [i, j, k] = pair.first.corners(faces);
    let [_, _, l] = pair.second.corners(faces);
    [i, j, k, l]
}

/// The dihedral angle of a hinge with these corners, in radians; 0 where a triangle has no normal. Exact to rounding over the sine of the triangles' angles.
pub fn dihedral_angle([i, j, k, l]: [Point; 4]) -> f64 {
    let edge = sub(j, i);
    let (f, g) = (cross(edge, sub(k, i)), cross(sub(l, i), edge));
    // f x g = -(f . (l - i)) edge; 0 - x, so that flat is +0.
    let (sine, cosine) = (0.0 - norm(edge) * dot(f, sub(l, i)), dot(f, g));
    match sine == 0.0 && cosine == 0.0 {
        true => 0.0,
        false => sine.atan2(cosine),
    }
}

#[cfg(test)]
mod tests {
    use super::super::topology::Topology;
    use super::super::vector::point;
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Two triangles at the edge from the origin along x, the second turned by `angle` out of the plane of the first.
    fn crease(angle: f64) -> [Point; 4] {
        let (sin, cos) = angle.sin_cos();
        [
            [0.0; 3],
            [2.0, 0.0, 0.0],
            [0.5, 1.5, 0.0],
            [0.7, -3.0 * cos, -3.0 * sin],
        ]
    }

    #[test]
    fn a_known_angle_with_its_sign() {
        for angle in [-3.1, -1.0, -1e-9, 0.0, 1e-12, 0.5, FRAC_PI_2, 3.1] {
            let found = dihedral_angle(crease(angle));
            assert!((found - angle).abs() < 1e-15, "{angle}: {found}");
        }
        assert!((dihedral_angle(crease(PI)).abs() - PI).abs() < 1e-15);
        assert!(dihedral_angle(crease(0.0)).is_sign_positive());
    }

    #[test]
    fn edges_of_a_tetrahedron_are_convex_and_turn_concave_inside_out() {
        let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let outward = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let angles = |faces: &[[u32; 3]]| -> Vec<f64> {
            let topology = Topology::new(faces);
            let hinges = topology.pairs().map(|p| hinge(&p, faces));
            hinges
                .map(|h| dihedral_angle(h.map(|v| point(&positions, v))))
                .collect()
        };
        let steep = PI - (1.0 / 3f64.sqrt()).acos();
        let expected = [FRAC_PI_2, FRAC_PI_2, FRAC_PI_2, steep, steep, steep];
        let inward = outward.map(|[a, b, c]| [a, c, b]);
        for ((found, other), expected) in angles(&outward).iter().zip(angles(&inward)).zip(expected)
        {
            assert!((found - expected).abs() < 1e-15 && (other + expected).abs() < 1e-15);
        }
    }

    #[test]
    fn a_triangle_that_runs_the_same_way_counts_as_turned_round() {
        let faces = [[0, 1, 2], [1, 0, 3], [0, 1, 3]];
        let topology = Topology::new(&faces);
        let at_first: Vec<_> = topology
            .pairs()
            .filter(|p| p.edge == 0)
            .map(|p| hinge(&p, &faces))
            .collect();
        assert_eq!(at_first, [[0, 1, 2, 3]; 2]);
    }

    #[test]
    fn no_normal_means_no_angle_and_no_gradient() {
        let [i, j, k, l] = crease(1.0);
        for corners in [
            [i, i, k, l],
            [i, j, j, l],
            [i, j, k, [5.0, 0.0, 0.0]],
            [i; 4],
        ] {
            assert_eq!(dihedral_angle(corners), 0.0);
        }
    }

    fn corners() -> impl Strategy<Value = [Point; 4]> {
        let point = || prop::array::uniform3(-1.0..1.0f64);
        [point(), point(), point(), point()]
    }

    fn heights([i, j, k, l]: [Point; 4]) -> f64 {
        let edge = sub(j, i);
        let height = |p| norm(cross(edge, sub(p, i))) / norm(edge);
        height(k).min(height(l)).min(norm(edge))
    }

    proptest! {
        #[test]
        fn symmetries(corners in corners()) {
            prop_assume!(heights(corners) > 0.05);
            let [i, j, k, l] = corners;
            let angle = dihedral_angle(corners);
            let close = |other: f64| {
                let off = (angle - other).abs();
                off.min(2.0 * PI - off) < 1e-13
            };
            prop_assert!(close(dihedral_angle([j, i, l, k])), "the other triangle first");
            prop_assert!(close(-dihedral_angle([j, i, k, l])), "both turned round");
            prop_assert!(close(-dihedral_angle(corners.map(|[x, y, z]| [x, y, -z]))), "mirrored");
        }
    }
}
