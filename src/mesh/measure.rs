//! What is measured on a triangle mesh: area, volume, bounds, counts.
//!
//! Positions are `x0 y0 z0 x1 ...` (3V numbers), faces 0-based. Faces must be in range, as those of a
//! [`Connectivity`](super::Connectivity) are; a face out of range panics, as indexing a slice does.

use rayon::prelude::*;

use super::topology::{Topology, components};
use super::vector::{Point, cross, dot, norm, point, sub};

/// The measures of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// See [`area`].
    pub area: f64,
    /// See [`volume`].
    pub volume: f64,
    /// See [`bounds`].
    pub bounds: Bounds,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The smallest coordinates.
    pub min: [f64; 3],
    /// The largest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// The box that holds nothing; its `min` is +infinity and its `max` is -infinity.
    pub const EMPTY: Self = Self {
        min: [f64::INFINITY; 3],
        max: [f64::NEG_INFINITY; 3],
    };

    /// The length of the diagonal; 0 for a box that holds nothing.
    pub fn diagonal(&self) -> f64 {
        match self.min[0] <= self.max[0] {
            true => norm(sub(self.max, self.min)),
            false => 0.0,
        }
    }

    /// The smallest box around this one and a point.
    pub fn with(self, p: [f64; 3]) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].min(p[i])),
            max: std::array::from_fn(|i| self.max[i].max(p[i])),
        }
    }
}

/// How a mesh hangs together, whatever its positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// All vertices V.
    pub vertices: usize,
    /// Those that no face names.
    pub unreferenced: usize,
    /// Distinct undirected edges E.
    pub edges: usize,
    /// All faces F.
    pub faces: usize,
    /// Edges with exactly one incident face.
    pub boundary_edges: usize,
    /// Edges with more than two.
    pub non_manifold_edges: usize,
    /// Edges with two whose orientations disagree.
    pub disagreeing_edges: usize,
    /// Connected components; each unreferenced vertex is one.
    pub components: usize,
}

impl Counts {
    /// V - E + F, over all vertices. 2 for each closed sphere, 0 for each torus, 1 for each disk or unreferenced vertex.
    pub fn euler(&self) -> i64 {
        self.vertices as i64 - self.edges as i64 + self.faces as i64
    }
}

/// The area of all faces, the sum of |(b - a) x (c - a)| / 2, in squared units of the positions.
pub fn area(positions: &[f64], faces: &[[u32; 3]]) -> f64 {
    let twice = |face: &[u32; 3]| {
        let [a, b, c] = corners(positions, face);
        norm(cross(sub(b, a), sub(c, a)))
    };
    faces.iter().map(twice).sum::<f64>() / 2.0
}

/// The signed volume, the sum of det[a b c] / 6, in cubed units: positive when closed and seen counter-clockwise from
/// outside. On an open mesh it is the volume of the cone over it with its tip in the origin.
///
/// Summed about a corner of the mesh, and then about the origin by what its boundary leaves of the sum of area vectors: far from the origin, which may be
/// a thousand diagonals away, nothing cancels.
pub fn volume(positions: &[f64], faces: &[[u32; 3]]) -> f64 {
    let Some(&[first, ..]) = faces.first() else {
        return 0.0;
    };
    let tip = point(positions, first);
    let (mut six_fold, mut twice_area) = (0.0, [0.0; 3]);
    for face in faces {
        let [a, b, c] = corners(positions, face).map(|p| sub(p, tip));
        six_fold += dot(a, cross(b, c));
        let vector = cross(sub(b, a), sub(c, a));
        (0..3).for_each(|i| twice_area[i] += vector[i]);
    }
    (six_fold + dot(tip, twice_area)) / 6.0
}

/// The smallest box around all vertices, referenced or not.
pub fn bounds(positions: &[f64]) -> Bounds {
    let points = positions.as_chunks::<3>().0.iter();
    points.fold(Bounds::EMPTY, |all, &p| all.with(p))
}

/// All measures of one frame.
pub fn measure(positions: &[f64], faces: &[[u32; 3]]) -> Measures {
    Measures {
        area: area(positions, faces),
        volume: volume(positions, faces),
        bounds: bounds(positions),
    }
}

/// The measures of every frame of n x 3V positions, `dimension` being 3V. Frames run in parallel; the result does not
/// depend on the number of threads.
pub fn measure_frames(positions: &[f64], dimension: usize, faces: &[[u32; 3]]) -> Vec<Measures> {
    let frames = positions.par_chunks_exact(dimension.max(1));
    frames.map(|frame| measure(frame, faces)).collect()
}

/// Counts what there is of a mesh of `vertex_count` vertices. O(V + F log F).
pub fn counts(vertex_count: usize, faces: &[[u32; 3]]) -> Counts {
    let topology = Topology::new(faces);
    let mut referenced = vec![false; vertex_count];
    for &v in faces.as_flattened() {
        referenced[v as usize] = true;
    }
    Counts {
        vertices: vertex_count,
        unreferenced: referenced.iter().filter(|r| !**r).count(),
        edges: topology.edges().len(),
        faces: faces.len(),
        boundary_edges: topology.boundary().count(),
        non_manifold_edges: topology.non_manifold().count(),
        disagreeing_edges: topology.disagreeing().count(),
        components: components(vertex_count, faces).1,
    }
}

fn corners(positions: &[f64], face: &[u32; 3]) -> [Point; 3] {
    face.map(|v| point(positions, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: [[u32; 3]; 12] = [
        [0, 2, 1],
        [0, 3, 2],
        [4, 5, 6],
        [4, 6, 7],
        [0, 1, 5],
        [0, 5, 4],
        [1, 2, 6],
        [1, 6, 5],
        [2, 3, 7],
        [2, 7, 6],
        [3, 0, 4],
        [3, 4, 7],
    ];

    /// The box from `low` to `high`.
    fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<f64> {
        let corners = [
            [0, 0, 0],
            [1, 0, 0],
            [1, 1, 0],
            [0, 1, 0],
            [0, 0, 1],
            [1, 0, 1],
            [1, 1, 1],
            [0, 1, 1],
        ];
        corners
            .iter()
            .flat_map(|c| [0, 1, 2].map(|i| [low[i], high[i]][c[i]]))
            .collect()
    }

    #[test]
    fn a_box_in_closed_form() {
        let positions = cuboid([1.0, 2.0, 3.0], [3.0, 5.0, 7.0]);
        let m = measure(&positions, &CUBE);
        assert!((m.area - 52.0).abs() < 1e-12);
        assert!((m.volume - 24.0).abs() < 1e-12);
        assert_eq!(
            m.bounds,
            Bounds {
                min: [1.0, 2.0, 3.0],
                max: [3.0, 5.0, 7.0]
            }
        );
        assert_eq!(m.bounds.diagonal(), 29f64.sqrt());
    }

    #[test]
    fn far_from_the_origin_a_closed_volume_is_the_same_and_an_open_one_a_cone() {
        let far = |x: f64| cuboid([x, -x, x], [x + 2.0, 3.0 - x, x + 4.0]);
        assert!((volume(&far(1e6), &CUBE) - 24.0).abs() < 1e-6);
        // A face of the box at x = 5 has the area 12: the cone over it is 5 . 12 / 3.
        let side = [CUBE[6], CUBE[7]];
        assert!((volume(&cuboid([3.0, 0.0, 0.0], [5.0, 3.0, 4.0]), &side) - 20.0).abs() < 1e-12);
        assert_eq!(volume(&far(1.0), &[]), 0.0);
    }

    #[test]
    fn turned_inside_out_the_volume_is_negative() {
        let positions = cuboid([0.0; 3], [1.0; 3]);
        let inside_out = CUBE.map(|[a, b, c]| [a, c, b]);
        assert!((volume(&positions, &inside_out) + 1.0).abs() < 1e-15);
    }

    #[test]
    fn counts_of_a_sphere_with_a_stray_vertex_and_of_two_pieces() {
        let cube = counts(9, &CUBE);
        assert_eq!(
            (cube.edges, cube.boundary_edges, cube.unreferenced),
            (18, 0, 1)
        );
        assert_eq!((cube.components, cube.euler()), (2, 3));
        let pieces = counts(7, &[[0, 5, 1], [3, 4, 6], [2, 5, 1]]);
        assert_eq!(
            (pieces.components, pieces.boundary_edges, pieces.euler()),
            (2, 7, 2)
        );
    }

    #[test]
    fn nothing_has_no_measure() {
        let m = measure(&[], &[]);
        assert_eq!((m.area, m.volume, m.bounds.diagonal()), (0.0, 0.0, 0.0));
        assert_eq!(counts(0, &[]).euler(), 0);
        assert!(measure_frames(&[], 0, &[]).is_empty());
    }

    #[test]
    fn frames_are_measured_one_by_one() {
        let mut positions = cuboid([0.0; 3], [1.0; 3]);
        positions.extend(cuboid([0.0; 3], [2.0; 3]));
        let frames = measure_frames(&positions, 24, &CUBE);
        assert_eq!(frames.len(), 2);
        assert!((frames[1].volume - 8.0).abs() < 1e-14 && (frames[0].volume - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_face_turned_over_disagrees_at_its_three_edges() {
        let mut faces = CUBE;
        assert_eq!(counts(8, &faces).disagreeing_edges, 0);
        faces[4].reverse();
        assert_eq!(counts(8, &faces).disagreeing_edges, 3);
    }
}
