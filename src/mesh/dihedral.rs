//! Dihedral angles: how much a surface is creased where two triangles meet.
//!
//! A hinge is four vertices [i, j, k, l]: triangle f runs along the edge from i to j and has k across from it, the other triangle has l. With the unit
//! normals n_f ~ (j - i) x (k - i) and n_g ~ (l - i) x (j - i), which is g's own normal where g runs from j to i and the opposite one where it runs the same
//! way as f, and t from i to j, the angle is atan2((n_f x n_g) . t, n_f . n_g), from -pi to pi. Flat is 0; convex edges of a surface that faces outward are
//! positive. Exchanging the triangles, or turning both round, changes nothing.
//!
//! Each triangle adds its own part to the angle's derivatives ([`Lean`]), f as (i, j, k) and the other as (j, i, l): moving k by the unit normal lessens the
//! angle by 1 over its height, whatever l does.

use super::topology::Pair;
use super::vector::{Point, along, cross, dot, norm, sub};

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

/// A 3x3 matrix, row by row.
pub type Block = [[f64; 3]; 3];

/// A triangle's part of the derivatives of the dihedral angle at its first side, by its corners; both triangles' parts add up to the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lean {
    /// By each corner.
    pub first: [Point; 3],
    /// `second[p][q]`: of the derivative by corner p, by corner q. Only the sum of the two triangles' parts is symmetric.
    pub second: [[Block; 3]; 3],
}

impl Lean {
    /// Of the triangle (i, j, k). None where it has no normal.
    ///
    /// With e = j - i, p = k - i, N = e x p and s = p . e / |e|^2, the derivative by k is a = -|e| N / |N|^2, that by j is -s a, that by i -(1 - s) a.
    #[inline]
    pub fn new([i, j, k]: [Point; 3]) -> Option<Self> {
        let (e, p) = (sub(j, i), sub(k, i));
        let normal = cross(e, p);
        let (ee, nn) = (dot(e, e), dot(normal, normal));
        let length = ee.sqrt();
        let a = normal.map(|x| -length / nn * x);
        let s = dot(p, e) / ee;
        if !(a.iter().all(|x| x.is_finite()) && s.is_finite()) {
            return None;
        }
        // da = a (e . de) / |e|^2 - |e| / |N|^2 (1 - 2 n n^T) dN, dN = e x dp - p x de.
        let mirror = |d: Point| {
            let mirrored = along(d, -2.0 * dot(d, normal) / nn, normal);
            mirrored.map(|x| -length / nn * x)
        };
        let (mut by_e, mut by_p) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for column in 0..3 {
            let mut axis = [0.0; 3];
            axis[column] = 1.0;
            let (de, dp) = (mirror(cross(axis, p)), mirror(cross(e, axis)));
            for row in 0..3 {
                by_e[row][column] = de[row] + a[row] * e[column] / ee;
                by_p[row][column] = dp[row];
            }
        }
        // ds = (p . de + e . dp) / |e|^2 - 2 s (e . de) / |e|^2.
        let s_by_e = along(p, -2.0 * s, e).map(|x| x / ee);
        let s_by_p = e.map(|x| x / ee);
        let of_j = |block: &Block, ds: Point| -> Block {
            std::array::from_fn(|r| std::array::from_fn(|c| -s * block[r][c] - a[r] * ds[c]))
        };
        let of_k = by_corners(by_e, by_p);
        let of_j = by_corners(of_j(&by_e, s_by_e), of_j(&by_p, s_by_p));
        let of_i = std::array::from_fn(|q| opposite(&of_j[q], &of_k[q]));
        Some(Self {
            first: [a.map(|x| -(1.0 - s) * x), a.map(|x| -s * x), a],
            second: [of_i, of_j, of_k],
        })
    }
}

/// Derivatives by e = j - i and p = k - i as derivatives by i, j and k.
fn by_corners(by_e: Block, by_p: Block) -> [Block; 3] {
    [opposite(&by_e, &by_p), by_e, by_p]
}

/// -(a + b).
fn opposite(a: &Block, b: &Block) -> Block {
    std::array::from_fn(|r| std::array::from_fn(|c| -(a[r][c] + b[r][c])))
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
    fn no_normal_means_no_angle_and_no_derivative() {
        let [i, j, k, l] = crease(1.0);
        for corners in [
            [i, i, k, l],
            [i, j, j, l],
            [i, j, k, [5.0, 0.0, 0.0]],
            [i; 4],
        ] {
            assert_eq!(dihedral_angle(corners), 0.0);
        }
        assert_eq!(Lean::new([i, i, k]), None);
        assert_eq!(Lean::new([i, j, [5.0, 0.0, 0.0]]), None);
        assert!(Lean::new([i, j, k]).is_some());
    }

    /// The first and second derivatives of a hinge's angle by its four corners.
    fn whole([i, j, k, l]: [Point; 4]) -> ([Point; 4], [[Block; 4]; 4]) {
        let (mut first, mut second) = ([[0.0; 3]; 4], [[[[0.0; 3]; 3]; 4]; 4]);
        for (triangle, places) in [([i, j, k], [0, 1, 2]), ([j, i, l], [1, 0, 3])] {
            let lean = Lean::new(triangle).unwrap();
            for p in 0..3 {
                for r in 0..3 {
                    first[places[p]][r] += lean.first[p][r];
                    for q in 0..3 {
                        for c in 0..3 {
                            second[places[p]][places[q]][r][c] += lean.second[p][q][r][c];
                        }
                    }
                }
            }
        }
        (first, second)
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

        /// Against central differences, of the angle and of the first derivatives.
        #[test]
        fn derivatives(corners in corners()) {
            prop_assume!(heights(corners) > 0.2);
            const STEP: f64 = 1e-5;
            let moved = |corner: usize, axis: usize, by: f64| {
                let mut moved = corners;
                moved[corner][axis] += by;
                moved
            };
            let first = |corners: [Point; 4]| whole(corners).0;
            let (found, second) = whole(corners);
            for corner in 0..4 {
                for axis in 0..3 {
                    let [after, before] = [STEP, -STEP].map(|by| moved(corner, axis, by));
                    let gap = dihedral_angle(after) - dihedral_angle(before);
                    let gap = gap - 2.0 * PI * (gap / (2.0 * PI)).round();
                    prop_assert!((gap / (2.0 * STEP) - found[corner][axis]).abs() < 1e-6);
                    let (after, before) = (first(after), first(before));
                    for other in 0..4 {
                        for r in 0..3 {
                            let expected = (after[other][r] - before[other][r]) / (2.0 * STEP);
                            let found = second[other][corner][r][axis];
                            prop_assert!((found - expected).abs() < 1e-4, "{found} {expected}");
                            let transposed = second[corner][other][axis][r];
                            prop_assert!((found - transposed).abs() < 1e-9 * (1.0 + found.abs()));
                        }
                    }
                }
            }
        }
    }
}
