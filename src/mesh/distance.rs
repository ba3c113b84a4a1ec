//! The distance from points to a triangle surface.

use rayon::prelude::*;

use super::measure::Bounds;
use super::tree::{DEPTH, Kind, Node, build};
use super::triangle::distance_squared;
use super::vector::{Point, point};

/// A triangle surface prepared for distance queries: a tree of boxes, each split at the median of its longer side.
///
/// Degenerate triangles count as the segments or points that they are.
pub struct Surface {
    /// In the order of the leaves.
    triangles: Vec<[Point; 3]>,
    /// In depth-first order: the root comes first, and the first child of an inner node follows it.
    nodes: Vec<Node>,
}

impl Surface {
    /// Prepares the surface of `faces` (0-based, in range as in a [`Connectivity`](super::Connectivity); panics otherwise,
    /// as a slice does) over positions `x0 y0 z0 x1 ...`. O(F log F) time, about 100 bytes a face.
    pub fn new(positions: &[f64], faces: &[[u32; 3]]) -> Self {
        let corners = |face: &[u32; 3]| face.map(|v| point(positions, v));
        let mut triangles: Vec<(usize, [Point; 3])> =
            faces.iter().map(corners).enumerate().collect();
        let nodes = build(&mut triangles);
        Self {
            triangles: triangles.into_iter().map(|(_, t)| t).collect(),
            nodes,
        }
    }

    /// The Euclidean distance from `point` to the nearest point of the surface; infinite when there are no faces.
    ///
    /// Exact but for rounding: about 1e-15 of the size of the coordinates, up to 1e-8 of a triangle's size inside
    /// triangles thinner than 1e-3. Costs O(log F) near the surface.
    pub fn distance(&self, point: [f64; 3]) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut open = [(0, 0.0); DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (at, bound) = open[count];
            if bound >= nearest {
                continue;
            }
            match self.nodes[at].kind {
                Kind::Leaf { from, to } => {
                    for triangle in &self.triangles[from..to] {
                        nearest = nearest.min(distance_squared(point, triangle));
                    }
                }
                Kind::Inner { second } => {
                    let [a, b] =
                        [at + 1, second].map(|n| (n, to_box(point, &self.nodes[n].bounds)));
                    // The nearer one goes on top.
                    let pair = if a.1 <= b.1 { [b, a] } else { [a, b] };
                    open[count..count + 2].copy_from_slice(&pair);
                    count += 2;
                }
            }
        }
        nearest.sqrt()
    }
}

/// The largest and the mean distance from the vertices of `a` to the surface of `faces` over `b` (both `x0 y0 z0 x1 ...`).
///
/// The largest is the one-sided Hausdorff distance from the vertices; take the maximum with `a` and `b` exchanged for the
/// symmetric one. Both are 0 when `a` has no vertices, and infinite when there are no faces. Vertices run in parallel; the
/// result does not depend on the number of threads.
pub fn vertex_to_surface(a: &[f64], b: &[f64], faces: &[[u32; 3]]) -> (f64, f64) {
    let surface = Surface::new(b, faces);
    let points = a.as_chunks::<3>().0.par_iter().with_min_len(64);
    let distances: Vec<f64> = points.map(|&p| surface.distance(p)).collect();
    let largest = distances.iter().copied().fold(0.0, f64::max);
    let sum: f64 = distances.iter().sum();
    (largest, sum / distances.len().max(1) as f64)
}

/// The squared distance to a box, 0 inside.
fn to_box(p: Point, bounds: &Bounds) -> f64 {
    let off = |i: usize| (bounds.min[i] - p[i]).max(p[i] - bounds.max[i]).max(0.0);
    let [x, y, z] = [off(0), off(1), off(2)];
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(p: Point, positions: &[f64], faces: &[[u32; 3]]) -> f64 {
        let triangles = faces.iter().map(|f| f.map(|v| point(positions, v)));
        triangles
            .map(|t| distance_squared(p, &t))
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }

    /// Coordinates on a coarse grid make coincident vertices, degenerate triangles and ties common.
    fn coordinates(
        count: impl Into<prop::collection::SizeRange>,
    ) -> impl Strategy<Value = Vec<f64>> {
        let one = prop_oneof![-1.0..1.0, (-2i32..=2).prop_map(f64::from)];
        let points = prop::collection::vec(prop::array::uniform3(one), count);
        points.prop_map(|p| p.concat())
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_brute_force_finds(
            positions in coordinates(8),
            faces in prop::collection::vec(prop::array::uniform3(0u32..8), 0..60),
            queries in coordinates(10),
        ) {
            let surface = Surface::new(&positions, &faces);
            for &p in queries.as_chunks::<3>().0 {
                // Two triangles may be equally near but for rounding, and the tree leaves out one of them: a few units in
                // the last place of coordinates of at most 2.
                let (found, expected) = (surface.distance(p), brute_force(p, &positions, &faces));
                prop_assert!(found == expected || (found - expected).abs() < 1e-14, "{} {}", found, expected);
            }
        }

        #[test]
        fn points_of_the_surface_are_at_distance_zero(
            positions in coordinates(6),
            faces in prop::collection::vec(prop::array::uniform3(0u32..6), 1..20),
            u in 0.0..1.0, v in 0.0..1.0,
        ) {
            let surface = Surface::new(&positions, &faces);
            for face in &faces {
                let [a, b, c] = face.map(|i| point(&positions, i));
                let p = [0, 1, 2].map(|i| (1.0 - v) * ((1.0 - u) * a[i] + u * b[i]) + v * c[i]);
                prop_assert!(surface.distance(p) < 1e-7);
            }
        }
    }

    #[test]
    fn a_lifted_square() {
        let low = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 2.0, 0.0];
        let faces = [[0, 1, 2], [0, 2, 3]];
        let mut high = low;
        high[2] = 1.0;
        high[5] = 3.0;
        assert_eq!(vertex_to_surface(&high, &low, &faces), (3.0, 1.0));
        assert_eq!(vertex_to_surface(&low, &low, &faces), (0.0, 0.0));
    }

    #[test]
    fn many_equal_triangles_and_none() {
        let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let surface = Surface::new(&positions, &[[0, 1, 2]; 1000]);
        assert_eq!(surface.distance([0.25, 0.25, 2.0]), 2.0);
        assert_eq!(Surface::new(&[], &[]).distance([0.0; 3]), f64::INFINITY);
        assert_eq!(vertex_to_surface(&[], &positions, &[]), (0.0, 0.0));
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let wave = |i: usize| ((i * 7919 % 1009) as f64 / 1009.0).sin();
        let positions: Vec<f64> = (0..3000).map(wave).collect();
        let faces: Vec<[u32; 3]> = (0..990).map(|i| [i, i + 3, i + 10]).collect();
        let shifted: Vec<f64> = positions.iter().map(|x| x + 0.01).collect();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| vertex_to_surface(&shifted, &positions, &faces))
        };
        assert_eq!(run(1), run(3));
    }
}
