//! Where a surface meets itself, decided exactly for the coordinates as they are.

use std::cmp::Ordering::{self, Equal, Greater, Less};
use std::ops::Range;

use rayon::prelude::*;

use super::measure::Bounds;
use super::predicates::{side_of_line, side_of_plane};
use super::tree::{DEPTH, Kind, Node, build};
use super::vector::{Point, point};

/// The corners at both ends of each edge of a triangle.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
/// Leaves that a thread takes at a time, at least.
const SHARE: usize = 16;

/// How a surface meets itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SelfIntersections {
    /// Unordered pairs of triangles without a common vertex that have a point in common; touching counts.
    pub pairs: usize,
    /// Triangles, ascending and 0-based, that meet one with which they have no vertex in common, or meet one with which they have exactly one vertex in
    /// common in more than that vertex.
    pub faces: Vec<u32>,
    /// Triangles without area, corners exactly in a line, ascending and 0-based. They are left out of the rest.
    pub without_area: Vec<u32>,
}

/// Finds where the surface of `faces` (0-based, in range as in a [`Connectivity`](super::Connectivity); panics otherwise, as a slice does) over finite
/// positions `x0 y0 z0 x1 ...` meets itself.
///
/// A common vertex is a common index; vertices in one place are two. Triangles of two common vertices never count. Exact for all finite coordinates.
/// Triangles run in parallel; the result does not depend on the number of threads. O(F log F + candidates), where candidates are pairs of triangles whose
/// boxes overlap.
pub fn self_intersections(positions: &[f64], faces: &[[u32; 3]]) -> SelfIntersections {
    let corners = |face: &[u32; 3]| face.map(|v| point(positions, v));
    let all = faces.iter().map(corners).enumerate();
    let (mut triangles, flat): (Vec<_>, Vec<_>) = all.partition(|(_, t)| has_area(t));
    let nodes = build(&mut triangles);
    let boxes = triangles
        .iter()
        .map(|(_, t)| t.iter().fold(Bounds::EMPTY, |all, &p| all.with(p)));
    let surface = Surface {
        faces,
        boxes: boxes.collect(),
        triangles,
        nodes,
    };
    let leaves: Vec<(&Node, Range<usize>)> = surface.leaves().collect();
    let leaves = leaves.into_par_iter().with_min_len(SHARE);
    let found: Vec<Meeting> = leaves
        .flat_map_iter(|(leaf, range)| surface.meetings(&leaf.bounds, range))
        .collect();
    let mut marked = vec![false; faces.len()];
    for face in found.iter().flat_map(|meeting| meeting.faces) {
        marked[face] = true;
    }
    SelfIntersections {
        pairs: found.iter().filter(|meeting| meeting.apart).count(),
        faces: (0u32..)
            .zip(&marked)
            .filter(|(_, marked)| **marked)
            .map(|(face, _)| face)
            .collect(),
        without_area: flat.iter().map(|(face, _)| *face as u32).collect(),
    }
}

/// The same of every frame of n x 3V positions, `dimension` being 3V. Frames run in parallel.
pub fn self_intersections_of_frames(
    positions: &[f64],
    dimension: usize,
    faces: &[[u32; 3]],
) -> Vec<SelfIntersections> {
    let frames = positions.par_chunks_exact(dimension.max(1));
    frames
        .map(|frame| self_intersections(frame, faces))
        .collect()
}

/// Two triangles that meet.
struct Meeting {
    faces: [usize; 2],
    /// Whether they have no common vertex.
    apart: bool,
}

/// Triangles of positive area in a tree of boxes.
struct Surface<'a> {
    faces: &'a [[u32; 3]],
    /// Numbered by face, in the order of the leaves.
    triangles: Vec<(usize, [Point; 3])>,
    /// Around each of them.
    boxes: Vec<Bounds>,
    nodes: Vec<Node>,
}

impl Surface<'_> {
    /// Every leaf with the range of its triangles.
    fn leaves(&self) -> impl Iterator<Item = (&Node, Range<usize>)> {
        self.nodes.iter().filter_map(|node| match node.kind {
            Kind::Leaf { from, to } => Some((node, from..to)),
            Kind::Inner { .. } => None,
        })
    }

    /// Meetings of the triangles of a leaf with each other and with those of later leaves.
    fn meetings(&self, around: &Bounds, leaf: Range<usize>) -> Vec<Meeting> {
        let mut found = Vec::new();
        let mut open = [0; DEPTH];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[open[count]];
            if node.to <= leaf.start || !overlap(&node.bounds, around) {
                continue;
            }
            match node.kind {
                Kind::Leaf { from, to } => {
                    for i in leaf.clone() {
                        let later = from.max(i + 1)..to;
                        let near = later.filter(|&j| overlap(&self.boxes[j], &self.boxes[i]));
                        found.extend(near.filter_map(|j| self.meeting(i, j)));
                    }
                }
                Kind::Inner { second } => {
                    (open[count], open[count + 1]) = (second, open[count] + 1);
                    count += 2;
                }
            }
        }
        found
    }

    fn meeting(&self, i: usize, j: usize) -> Option<Meeting> {
        let [(f, a), (g, b)] = [&self.triangles[i], &self.triangles[j]];
        let (common, [at_f, at_g]) = common_corners(&self.faces[*f], &self.faces[*g]);
        let meet = match common {
            0 => triangles_meet(a, b),
            1 => meet_beyond(a, at_f, b, at_g),
            _ => false,
        };
        meet.then_some(Meeting {
            faces: [*f, *g],
            apart: common == 0,
        })
    }
}

/// Boxes are closed.
fn overlap(a: &Bounds, b: &Bounds) -> bool {
    (0..3).all(|axis| a.min[axis] <= b.max[axis] && b.min[axis] <= a.max[axis])
}

/// How many vertices two faces have in common, and the places of the last of them in both.
fn common_corners(f: &[u32; 3], g: &[u32; 3]) -> (usize, [usize; 2]) {
    let pairs = (0..3).flat_map(|i| (0..3).map(move |j| [i, j]));
    let common = pairs.filter(|&[i, j]| f[i] == g[j]);
    common.fold((0, [0, 0]), |(count, _), places| (count + 1, places))
}

/// Whether the corners are not in a line: in one of the three planes of coordinates they are not.
fn has_area(triangle: &[Point; 3]) -> bool {
    shadow(triangle).is_some()
}

/// An axis along which the triangle's shadow has an area.
fn shadow(triangle: &[Point; 3]) -> Option<usize> {
    (0..3).find(|&axis| {
        let [a, b, c] = triangle.map(|p| along_axis(p, axis));
        side_of_line(a, b, c) != Equal
    })
}

fn along_axis(p: Point, axis: usize) -> [f64; 2] {
    [p[(axis + 1) % 3], p[(axis + 2) % 3]]
}

/// Whether two triangles of positive area have a point in common: an edge of one then meets the other.
fn triangles_meet(a: &[Point; 3], b: &[Point; 3]) -> bool {
    let sides_of_b = sides(a, *b);
    if all_beside(&sides_of_b) {
        return false;
    }
    let sides_of_a = sides(b, *a);
    !all_beside(&sides_of_a)
        && (an_edge_meets(b, &sides_of_b, a) || an_edge_meets(a, &sides_of_a, b))
}

/// On which side of the plane of `triangle` points are.
fn sides<const N: usize>(triangle: &[Point; 3], points: [Point; N]) -> [Ordering; N] {
    let [a, b, c] = *triangle;
    points.map(|p| side_of_plane(a, b, c, p))
}

fn all_beside(sides: &[Ordering]) -> bool {
    sides[0] != Equal && sides.iter().all(|side| *side == sides[0])
}

fn an_edge_meets(a: &[Point; 3], sides: &[Ordering; 3], b: &[Point; 3]) -> bool {
    EDGES
        .iter()
        .any(|&[i, j]| segment_meets([a[i], a[j]], [sides[i], sides[j]], b))
}

/// Whether two triangles, of which corner i of one is corner j of the other, meet in more than this corner: the edge across from it meets the other. One that
/// is all beside the other's plane does not.
fn meet_beyond(a: &[Point; 3], i: usize, b: &[Point; 3], j: usize) -> bool {
    let across = |t: &[Point; 3], corner: usize| [t[(corner + 1) % 3], t[(corner + 2) % 3]];
    let edge_a = across(a, i);
    let sides_a = sides(b, edge_a);
    if all_beside(&sides_a) {
        return false;
    }
    let edge_b = across(b, j);
    let sides_b = sides(a, edge_b);
    !all_beside(&sides_b)
        && (segment_meets(edge_a, sides_a, b) || segment_meets(edge_b, sides_b, a))
}

/// Whether a segment, its ends on these sides of the triangle's plane, has a point in common with the triangle.
fn segment_meets([p, q]: [Point; 2], sides: [Ordering; 2], triangle: &[Point; 3]) -> bool {
    match sides {
        [Equal, Equal] => meets_within_plane([p, q], triangle),
        [a, b] if a == b => false,
        // The line goes through the triangle where it does not pass edges on both sides.
        _ => {
            let past = |[i, j]: [usize; 2]| side_of_plane(p, q, triangle[i], triangle[j]);
            one_sided(EDGES.map(past))
        }
    }
}

fn one_sided(sides: [Ordering; 3]) -> bool {
    !(sides.contains(&Less) && sides.contains(&Greater))
}

/// The same where the segment is in the triangle's plane: both along an axis.
fn meets_within_plane(segment: [Point; 2], triangle: &[Point; 3]) -> bool {
    let Some(axis) = shadow(triangle) else {
        return false;
    };
    let [p, q] = segment.map(|p| along_axis(p, axis));
    let triangle = triangle.map(|p| along_axis(p, axis));
    let inside = one_sided(EDGES.map(|[i, j]| side_of_line(triangle[i], triangle[j], p)));
    inside
        || EDGES
            .iter()
            .any(|&[i, j]| segments_meet([p, q], [triangle[i], triangle[j]]))
}

/// Whether two segments of positive length in the plane have a point in common.
fn segments_meet([p, q]: [[f64; 2]; 2], [a, b]: [[f64; 2]; 2]) -> bool {
    let ends = [side_of_line(a, b, p), side_of_line(a, b, q)];
    let others = [side_of_line(p, q, a), side_of_line(p, q, b)];
    if ends == [Equal, Equal] {
        let spans = |x: usize| p[x].min(q[x]) <= a[x].max(b[x]) && a[x].min(b[x]) <= p[x].max(q[x]);
        return spans(0) && spans(1);
    }
    let parted = |sides: [Ordering; 2]| sides[0] != sides[1] || sides[0] == Equal;
    parted(ends) && parted(others)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::vector::{cross, sub};

    const SIMPLEX: [Point; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const SIDES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    const FIRST: [Point; 3] = [[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
    const PAIR: [[u32; 3]; 2] = [[0, 1, 2], [3, 4, 5]];
    const FAN: [[u32; 3]; 2] = [[0, 1, 2], [0, 3, 4]];

    /// Pairs and faces that meet.
    fn counts(points: &[Point], faces: &[[u32; 3]]) -> [usize; 2] {
        let found = self_intersections(points.as_flattened(), faces);
        assert!(found.without_area.is_empty());
        [found.pairs, found.faces.len()]
    }

    fn with(first: &[Point], more: &[Point]) -> Vec<Point> {
        [first, more].concat()
    }

    /// The first triangle, and a second that has no vertex of it.
    fn pair(second: [Point; 3]) -> [usize; 2] {
        counts(&with(&FIRST, &second), &PAIR)
    }

    /// The first triangle, and a second that has its corner 0.
    fn fan(more: [Point; 2]) -> [usize; 2] {
        counts(&with(&FIRST, &more), &FAN)
    }

    #[test]
    fn two_triangles() {
        let (above, beside) = ([1.0, 1.3, 1.0], [2.0, 1.0, 3.0]);
        let least = f64::from_bits(1);
        assert_eq!(pair([[1.0, 1.0, -1.0], above, beside]), [1, 2]);
        assert_eq!(
            pair([[1.0, 1.0, 0.0], above, beside]),
            [1, 2],
            "a corner on it"
        );
        assert_eq!(
            pair([[1.0, 1.0, least], above, beside]),
            [0, 0],
            "a hair above"
        );
        assert_eq!(
            pair([[3.0, 3.0, -1.0], [3.0, 3.3, 1.0], [3.2, 3.0, 1.0]]),
            [0, 0]
        );
        assert_eq!(
            pair([[0.0; 3], [-1.0, 0.0, 1.0], [-1.0, -1.0, 1.0]]),
            [1, 2],
            "corners in one place"
        );
        let high = |x: f64, y: f64| [x, y, 0.0];
        assert_eq!(
            pair([high(1.0, 1.0), high(5.0, 1.0), high(1.0, 5.0)]),
            [1, 2],
            "in one plane"
        );
        assert_eq!(
            pair([high(0.5, 0.5), high(1.0, 0.5), high(0.5, 1.0)]),
            [1, 2],
            "one within the other"
        );
        assert_eq!(
            pair([high(4.0, 4.0), high(4.0, 3.0), high(3.0, 4.0)]),
            [0, 0],
            "apart in one plane"
        );
        assert_eq!(
            pair([high(2.0, 2.0), high(4.0, 4.0), high(3.0, 5.0)]),
            [1, 2],
            "a corner on an edge"
        );
        assert_eq!(
            pair([high(5.0, 0.0), high(7.0, 0.0), high(6.0, -1.0)]),
            [0, 0],
            "edges in one line"
        );
    }

    #[test]
    fn a_common_vertex() {
        assert_eq!(fan([[1.0, 1.0, 1.0], [1.0, 2.0, 3.0]]), [0, 0]);
        assert_eq!(fan([[1.0, 1.0, 1.0], [1.0, 2.0, -3.0]]), [0, 2]);
        assert_eq!(
            fan([[2.0, 0.0, 0.0], [1.0, -1.0, 1.0]]),
            [0, 2],
            "part of an edge too"
        );
        assert_eq!(
            fan([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]),
            [0, 2],
            "in one plane"
        );
        assert_eq!(fan([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), [0, 0]);
        let folded = with(&FIRST, &[[1.0, 1.0, 0.0]]);
        assert_eq!(
            counts(&folded, &[[0, 1, 2], [1, 0, 3]]),
            [0, 0],
            "two common vertices"
        );
    }

    #[test]
    fn a_spike_and_a_simplex() {
        let both: Vec<[u32; 3]> = SIDES
            .iter()
            .copied()
            .chain(SIDES.map(|f| f.map(|v| v + 4)))
            .collect();
        let inside = [
            [-0.3, -0.2, -1.0],
            [0.7, -0.1, -1.0],
            [0.15, 0.8, -1.0],
            [0.2, 0.21, 0.22],
        ];
        assert_eq!(counts(&with(&SIMPLEX, &inside), &both), [3, 4]);
        let through = [
            [0.15, 0.16, -1.0],
            [0.27, 0.2, -1.0],
            [0.19, 0.28, -1.0],
            [0.2, 0.21, 9.0],
        ];
        assert_eq!(counts(&with(&SIMPLEX, &through), &both), [6, 5]);
        let within = SIMPLEX.map(|p| p.map(|x| x / 8.0 + 0.1));
        assert_eq!(counts(&with(&SIMPLEX, &within), &both), [0, 0]);
    }

    #[test]
    fn what_has_no_area_is_named_and_left_out() {
        let points = with(
            &FIRST,
            &[[1.0, 1.0, -1.0], [1.0, 1.0, 0.0], [1.0, 1.0, 1.0]],
        );
        let found = self_intersections(points.as_flattened(), &[[0, 1, 2], [3, 4, 5], [0, 0, 1]]);
        assert_eq!(found.without_area, [1, 2]);
        assert_eq!((found.pairs, found.faces.len()), (0, 0));
        assert_eq!(self_intersections(&[], &[]), SelfIntersections::default());
        let lost = [
            f64::NAN,
            f64::INFINITY,
            0.0,
            1.0,
            f64::NEG_INFINITY,
            2.0,
            0.0,
            1.0,
            f64::NAN,
        ];
        assert_eq!(self_intersections(&lost, &[[0, 1, 2]; 9]).pairs, 0);
    }

    type Whole = [i128; 3];

    /// How much finer whole numbers are than the grid that points lie on.
    const FINE: i128 = 1 << 20;

    fn whole(p: Point) -> Whole {
        p.map(|x| x as i128 * FINE)
    }

    /// Whether some direction parts two triangles strictly: the theorem of separating axes, in whole numbers.
    fn parted(a: &[Whole; 3], b: &[Whole; 3]) -> bool {
        let sub = |a: Whole, b: Whole| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: Whole, b: Whole| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let minor = |a: Whole, b: Whole, i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
        let cross = |a: Whole, b: Whole| [[1, 2], [2, 0], [0, 1]].map(|[i, j]| minor(a, b, i, j));
        let edges = |t: &[Whole; 3]| EDGES.map(|[i, j]| sub(t[j], t[i]));
        let (of_a, of_b) = (edges(a), edges(b));
        let normals = [of_a, of_b].map(|e| cross(e[0], e[1]));
        let mut axes = normals.to_vec();
        axes.extend(of_a.iter().flat_map(|&e| of_b.map(|f| cross(e, f))));
        axes.extend(of_a.map(|e| cross(normals[0], e)));
        axes.extend(of_b.map(|e| cross(normals[1], e)));
        let beyond = |a: &[Whole; 3], b: &[Whole; 3], axis: Whole| {
            let most = a.map(|p| dot(p, axis)).into_iter().max();
            b.iter().all(|&p| Some(dot(p, axis)) > most)
        };
        axes.into_iter()
            .any(|axis| beyond(a, b, axis) || beyond(b, a, axis))
    }

    fn whole_points(count: usize) -> impl Strategy<Value = Vec<Point>> {
        let coordinate = (-3i32..=3).prop_map(f64::from);
        prop::collection::vec(prop::array::uniform3(coordinate), count)
    }

    proptest! {
        /// On a coarse grid half of all pairs touch, share edges or lie in one plane.
        #[test]
        fn what_no_axis_parts_meets(points in whole_points(24)) {
            let faces: Vec<[u32; 3]> = (0..8).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
            let found = self_intersections(points.as_flattened(), &faces);
            let solid: Vec<[Whole; 3]> = (0u32..).zip(points.as_chunks::<3>().0)
                .filter(|(f, _)| !found.without_area.contains(f))
                .map(|(_, triangle)| triangle.map(whole))
                .collect();
            let meeting = |i: usize| (0..i).filter(|&j| !parted(&solid[i], &solid[j])).count();
            prop_assert_eq!(found.pairs, (0..solid.len()).map(meeting).sum::<usize>());
        }

        #[test]
        fn what_has_no_area_has_no_normal(points in whole_points(3)) {
            let found = self_intersections(points.as_flattened(), &[[0, 1, 2]]);
            let normal = cross(sub(points[1], points[0]), sub(points[2], points[0]));
            prop_assert_eq!(found.without_area.is_empty(), normal != [0.0; 3]);
        }

        /// Where two triangles meet beyond a common corner, they still do when the corner is cut off one of them, close by.
        #[test]
        fn a_corner_cut_off_does_not_matter(points in whole_points(5)) {
            let found = self_intersections(points.as_flattened(), &FAN);
            prop_assume!(found.without_area.is_empty());
            let [o, a, b, c, d] = points[..] else { unreachable!() };
            let cut = |p: Point| [0, 1, 2].map(|x| whole(o)[x] + (p[x] - o[x]) as i128);
            let second = [o, c, d].map(whole);
            let rest = [[cut(a), whole(a), whole(b)], [cut(a), whole(b), cut(b)]];
            let expected = rest.iter().any(|t| !parted(t, &second));
            prop_assert_eq!(found.faces.len(), if expected { 2 } else { 0 });
            prop_assert_eq!(found.pairs, 0);
        }

        #[test]
        fn numbering_scale_and_threads_do_not_matter(
            points in prop::collection::vec(prop::array::uniform3(-1.0f64..1.0), 90),
            power in -300i32..300,
        ) {
            let faces: Vec<[u32; 3]> = (0..89).map(|f| [f, (f * 7 + 1) % 90, (f * 31 + 2) % 90]).collect();
            let found = self_intersections(points.as_flattened(), &faces);
            let scaled: Vec<f64> = points.as_flattened().iter().map(|x| x * 2f64.powi(power)).collect();
            prop_assert_eq!(&self_intersections(&scaled, &faces), &found);
            let turned: Vec<[u32; 3]> = faces.iter().rev().map(|&[a, b, c]| [c, a, b]).collect();
            let again = self_intersections(points.as_flattened(), &turned);
            prop_assert_eq!((again.pairs, again.faces.len()), (found.pairs, found.faces.len()));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            prop_assert_eq!(pool.install(|| self_intersections(points.as_flattened(), &faces)), found);
        }
    }
}
