//! The undirected edges of a triangle mesh.

/// The distinct edges and how many faces meet at each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edges {
    /// Pairs of 0-based vertices, the smaller first, in ascending order.
    pub vertices: Vec<[u32; 2]>,
    /// For each edge, the number of faces that have it: 1 on the boundary, 2 inside a manifold, more where it is not one.
    pub face_counts: Vec<u32>,
}

impl Edges {
    /// Edges with exactly one incident face.
    pub fn boundary(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.with_faces(|count| count == 1)
    }

    /// Edges with more than two incident faces.
    pub fn non_manifold(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.with_faces(|count| count > 2)
    }

    fn with_faces(&self, wanted: impl Fn(u32) -> bool) -> impl Iterator<Item = [u32; 2]> {
        let pairs = self.vertices.iter().zip(&self.face_counts);
        pairs
            .filter(move |(_, count)| wanted(**count))
            .map(|(edge, _)| *edge)
    }
}

/// Finds the edges of `faces` by sorting: O(F log F), 24 F bytes.
///
/// A degenerate face counts once for each edge that it has: a corner repeated makes one edge, or none, instead of three.
/// Equal faces count each for itself.
pub fn unique_edges(faces: &[[u32; 3]]) -> Edges {
    let mut keys = Vec::with_capacity(faces.len() * 3);
    for &[a, b, c] in faces {
        match (a == b, b == c, c == a) {
            (false, false, false) => keys.extend([key(a, b), key(b, c), key(c, a)]),
            (true, true, _) => {}
            (true, ..) | (.., true) => keys.push(key(b, c)),
            (_, true, _) => keys.push(key(a, b)),
        }
    }
    keys.sort_unstable();
    let runs = keys.chunk_by(|a, b| a == b);
    let (vertices, face_counts) = runs.map(|run| (ends(run[0]), run.len() as u32)).unzip();
    Edges {
        vertices,
        face_counts,
    }
}

fn key(a: u32, b: u32) -> u64 {
    u64::from(a.min(b)) << 32 | u64::from(a.max(b))
}

fn ends(key: u64) -> [u32; 2] {
    [(key >> 32) as u32, key as u32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::{BTreeMap, BTreeSet};

    #[test]
    fn two_triangles() {
        let edges = unique_edges(&[[0, 1, 2], [2, 1, 3]]);
        assert_eq!(edges.vertices, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
        assert_eq!(edges.face_counts, [1, 1, 2, 1, 1]);
        assert_eq!(edges.boundary().count(), 4);
    }

    #[test]
    fn three_faces_at_one_edge() {
        let edges = unique_edges(&[[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
        assert_eq!(edges.non_manifold().collect::<Vec<_>>(), [[0, 1]]);
    }

    proptest! {
        /// Against the definition: the set of edges of each face, degenerate or not, counted face by face.
        #[test]
        fn against_the_definition(faces in prop::collection::vec(prop::array::uniform3(0u32..6), 0..20)) {
            let mut counts = BTreeMap::new();
            for f in &faces {
                let pairs = [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]];
                let own: BTreeSet<_> = pairs.iter().filter(|[a, b]| a != b).map(|&[a, b]| [a.min(b), a.max(b)]).collect();
                own.into_iter().for_each(|edge| *counts.entry(edge).or_insert(0) += 1);
            }
            let edges = unique_edges(&faces);
            let found: BTreeMap<_, _> = edges.vertices.iter().copied().zip(edges.face_counts.iter().copied()).collect();
            prop_assert!(edges.vertices.is_sorted());
            prop_assert_eq!(edges.vertices.len(), found.len());
            prop_assert_eq!(found, counts);
        }
    }
}
