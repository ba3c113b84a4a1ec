//! How the triangles of a mesh hang together: edges, the triangles at each, pairs of neighbours, components.
//!
//! Nothing is assumed of the mesh: boundaries, edges with many triangles, triangles that run along an edge the same way, repeated triangles and
//! triangles with a repeated corner all have their place.

/// The distinct edges of a list of triangles, and the triangles at each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    edges: Vec<[u32; 2]>,
    /// Where the half-edges of each edge begin, and their number at the end.
    starts: Vec<usize>,
    halves: Vec<HalfEdge>,
}

/// One side of a triangle: from its corner number `corner` to the next one around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HalfEdge {
    /// The triangle, 0-based.
    pub triangle: u32,
    /// Which corner it starts from: 0, 1 or 2.
    pub corner: u8,
    /// Whether it runs from the smaller vertex to the larger one.
    pub ascending: bool,
}

/// Two triangles at an edge. The pairs of an edge with triangles f0 < f1 < f2 ... are (f0, f1), (f0, f2) ...
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The edge, 0-based.
    pub edge: u32,
    /// f0's side.
    pub first: HalfEdge,
    /// The side of the other triangle.
    pub second: HalfEdge,
}

impl HalfEdge {
    /// The vertices at its start and its end, and the one across from it.
    pub fn corners(&self, faces: &[[u32; 3]]) -> [u32; 3] {
        let mut corners = faces[self.triangle as usize];
        corners.rotate_left(self.corner.into());
        corners
    }
}

impl Topology {
    /// Finds the edges of `faces` (0-based) by one sort: O(F log F), 72 F bytes at most.
    ///
    /// A triangle counts once at each edge that it has: a corner repeated makes one edge, or none, instead of three, and the first half-edge along it
    /// is the one kept. Equal triangles count each for itself.
    pub fn new(faces: &[[u32; 3]]) -> Self {
        let mut sides = Vec::with_capacity(faces.len() * 3);
        for (triangle, &[a, b, c]) in faces.iter().enumerate() {
            let triangle = triangle as u32;
            for (corner, (from, to)) in [(a, b), (b, c), (c, a)].into_iter().enumerate() {
                if from != to {
                    let ascending = from < to;
                    let edge = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                    sides.push((edge, triangle, corner as u8, ascending));
                }
            }
        }
        sides.sort_unstable();
        sides.dedup_by_key(|&mut (edge, triangle, ..)| (edge, triangle));
        let mut found = Self {
            edges: Vec::with_capacity(sides.len() / 2),
            starts: Vec::with_capacity(sides.len() / 2 + 1),
            halves: Vec::with_capacity(sides.len()),
        };
        for run in sides.chunk_by(|a, b| a.0 == b.0) {
            let edge = run[0].0;
            found.edges.push([(edge >> 32) as u32, edge as u32]);
            found.starts.push(found.halves.len());
            found.halves.extend(
                run.iter()
                    .map(|&(_, triangle, corner, ascending)| HalfEdge {
                        triangle,
                        corner,
                        ascending,
                    }),
            );
        }
        found.starts.push(found.halves.len());
        found
    }

    /// The edges: pairs of 0-based vertices, the smaller first, in ascending order.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The half-edges of edge `edge` (0-based, below E), one a triangle, in the order of their triangles: one on the boundary, two inside a manifold,
    /// more where it is not one.
    pub fn at(&self, edge: usize) -> &[HalfEdge] {
        &self.halves[self.starts[edge]..self.starts[edge + 1]]
    }

    /// The half-edges of every edge in turn.
    pub fn fans(&self) -> impl ExactSizeIterator<Item = &[HalfEdge]> {
        self.starts.windows(2).map(|w| &self.halves[w[0]..w[1]])
    }

    /// Edges with exactly one triangle.
    pub fn boundary(&self) -> impl Iterator<Item = [u32; 2]> {
        self.with_triangles(|count| count == 1)
    }

    /// Edges with more than two triangles.
    pub fn non_manifold(&self) -> impl Iterator<Item = [u32; 2]> {
        self.with_triangles(|count| count > 2)
    }

    /// Edges with two triangles that run along it the same way, so that one of them faces in and the other out.
    pub fn disagreeing(&self) -> impl Iterator<Item = [u32; 2]> {
        let fans = self.edges.iter().zip(self.fans());
        fans.filter(|(_, fan)| matches!(fan, [a, b] if a.ascending == b.ascending))
            .map(|(&edge, _)| edge)
    }

    fn with_triangles(&self, wanted: impl Fn(usize) -> bool) -> impl Iterator<Item = [u32; 2]> {
        let fans = self.edges.iter().zip(self.fans());
        fans.filter(move |(_, fan)| wanted(fan.len()))
            .map(|(&edge, _)| edge)
    }

    /// The pairs of triangles at all edges, edge by edge.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        self.fans().enumerate().flat_map(|(edge, fan)| {
            fan[1..].iter().map(move |&second| Pair {
                edge: edge as u32,
                first: fan[0],
                second,
            })
        })
    }
}

/// The component of every vertex of the mesh that these triangles make (two vertices of one triangle are connected), and how many there are.
///
/// Components are numbered from 0 by their smallest vertex; a vertex of no triangle is one of its own. Nearly linear.
pub fn components<'a>(
    vertex_count: usize,
    faces: impl IntoIterator<Item = &'a [u32; 3]>,
) -> (Vec<u32>, usize) {
    let mut parents: Vec<u32> = (0..vertex_count as u32).collect();
    for &[a, b, c] in faces {
        join(&mut parents, a, b);
        join(&mut parents, b, c);
    }
    label(parents)
}

/// [`components`] of a graph of `count` nodes under these links.
pub fn linked(count: usize, links: impl IntoIterator<Item = [u32; 2]>) -> (Vec<u32>, usize) {
    let mut parents: Vec<u32> = (0..count as u32).collect();
    for [a, b] in links {
        join(&mut parents, a, b);
    }
    label(parents)
}

fn label(mut parents: Vec<u32>) -> (Vec<u32>, usize) {
    let mut labels = vec![0; parents.len()];
    let mut count = 0;
    for v in 0..parents.len() as u32 {
        // A root is the smallest of its component, so it comes first and has its label already.
        let root = find(&mut parents, v);
        labels[v as usize] = match root == v {
            true => count,
            false => labels[root as usize],
        };
        count += u32::from(root == v);
    }
    (labels, count as usize)
}

fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

/// The root of `v`, halving the path on the way.
fn find(parents: &mut [u32], mut v: u32) -> u32 {
    while parents[v as usize] != v {
        let grandparent = parents[parents[v as usize] as usize];
        parents[v as usize] = grandparent;
        v = grandparent;
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    fn half(triangle: u32, corner: u8, ascending: bool) -> HalfEdge {
        HalfEdge {
            triangle,
            corner,
            ascending,
        }
    }

    #[test]
    fn two_triangles() {
        let faces = [[0, 1, 2], [2, 1, 3]];
        let topology = Topology::new(&faces);
        assert_eq!(topology.edges(), [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
        let counts: Vec<_> = topology.fans().map(<[_]>::len).collect();
        assert_eq!(counts, [1, 1, 2, 1, 1]);
        assert_eq!(topology.boundary().count(), 4);
        let pair = Pair {
            edge: 2,
            first: half(0, 1, true),
            second: half(1, 0, false),
        };
        assert_eq!(topology.pairs().collect::<Vec<_>>(), [pair]);
        assert_eq!(pair.first.corners(&faces), [1, 2, 0]);
        assert_eq!(pair.second.corners(&faces), [2, 1, 3]);
    }

    #[test]
    fn a_book_of_three_pages_pairs_the_first_with_the_others() {
        let topology = Topology::new(&[[0, 1, 2], [0, 1, 3], [4, 1, 0]]);
        assert_eq!(topology.non_manifold().collect::<Vec<_>>(), [[0, 1]]);
        let found: Vec<_> = topology
            .pairs()
            .map(|p| (p.edge, p.first, p.second))
            .collect();
        let first = half(0, 0, true);
        assert_eq!(
            found,
            [(0, first, half(1, 0, true)), (0, first, half(2, 1, false))]
        );
    }

    #[test]
    fn a_repeated_corner_leaves_one_edge_or_none() {
        let topology = Topology::new(&[[5, 5, 2], [1, 1, 1], [4, 3, 4]]);
        assert_eq!(topology.edges(), [[2, 5], [3, 4]]);
        assert_eq!(topology.at(0), [half(0, 1, false)]);
        assert_eq!(topology.at(1), [half(2, 0, false)]);
        assert_eq!(Topology::new(&[]).fans().len(), 0);
    }

    #[test]
    fn components_are_numbered_by_their_smallest_member() {
        let faces = [[0, 5, 1], [3, 4, 6], [2, 5, 1]];
        assert_eq!(components(7, &faces), (vec![0, 0, 0, 1, 1, 0, 1], 2));
        assert_eq!(components(3, &[]), (vec![0, 1, 2], 3));
        assert_eq!(linked(4, [[3, 1]]), (vec![0, 1, 2, 1], 3));
    }

    proptest! {
        /// Against the definition: the set of edges of each triangle, degenerate or not, gathered triangle by triangle.
        #[test]
        fn against_the_definition(faces in prop::collection::vec(prop::array::uniform3(0u32..6), 0..20)) {
            let mut triangles: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
            for (t, f) in faces.iter().enumerate() {
                let sides = [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]];
                let own: BTreeSet<_> = sides.iter().filter(|[a, b]| a != b).map(|&[a, b]| [a.min(b), a.max(b)]).collect();
                own.into_iter().for_each(|edge| triangles.entry(edge).or_default().push(t as u32));
            }
            let topology = Topology::new(&faces);
            prop_assert!(topology.edges().iter().eq(triangles.keys()));
            for (e, expected) in triangles.values().enumerate() {
                prop_assert!(topology.at(e).iter().map(|h| &h.triangle).eq(expected));
                for half in topology.at(e) {
                    let [from, to, _] = half.corners(&faces);
                    let [low, high] = topology.edges()[e];
                    prop_assert_eq!([from, to], if half.ascending { [low, high] } else { [high, low] });
                }
            }
            let expected: usize = triangles.values().map(|t| t.len() - 1).sum();
            prop_assert_eq!(topology.pairs().count(), expected);
            prop_assert!(topology.pairs().all(|p| p.first.triangle < p.second.triangle));
        }

        /// Labels agree exactly where a walk along triangles leads from one vertex to the other.
        #[test]
        fn components_against_repeated_merging(faces in prop::collection::vec(prop::array::uniform3(0u32..12), 0..8)) {
            let mut merged: Vec<u32> = (0..12).collect();
            for _ in 0..12 {
                for f in &faces {
                    let least = f.iter().map(|&v| merged[v as usize]).min().unwrap();
                    f.iter().for_each(|&v| merged[v as usize] = least);
                }
            }
            let (labels, count) = components(12, &faces);
            let firsts: BTreeSet<_> = merged.iter().copied().collect();
            prop_assert_eq!(count, firsts.len());
            for (v, least) in merged.iter().enumerate() {
                prop_assert_eq!(labels[v] as usize, firsts.iter().position(|f| f == least).unwrap());
            }
        }
    }
}
