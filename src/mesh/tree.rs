//! A tree of boxes around triangles, each split at the median of its longer side.

use super::measure::Bounds;
use super::vector::Point;

/// Triangles in a leaf of the tree.
const LEAF: usize = 4;
/// Halving 2^64 triangles takes 64 steps, and a search keeps one open branch a step.
pub(super) const DEPTH: usize = 65;

/// A box around some triangles.
pub(super) struct Node {
    pub bounds: Bounds,
    /// After the last of them.
    pub to: usize,
    pub kind: Kind,
}

pub(super) enum Kind {
    /// The range of its triangles.
    Leaf { from: usize, to: usize },
    /// Where its second child is.
    Inner { second: usize },
}

/// Sorts numbered triangles into leaves and returns the nodes in depth-first order: the root (a leaf without triangles when there are none) comes
/// first, and the first child of an inner node follows it. O(F log F).
pub(super) fn build(triangles: &mut [(usize, [Point; 3])]) -> Vec<Node> {
    let mut nodes: Vec<Node> = Vec::with_capacity(triangles.len());
    let mut open: Vec<(_, Option<usize>)> = vec![(0..triangles.len(), None)];
    while let Some((range, parent)) = open.pop() {
        let at = nodes.len();
        if let Some(parent) = parent {
            nodes[parent].kind = Kind::Inner { second: at };
        }
        let (from, to) = (range.start, range.end);
        let part = &mut triangles[range];
        let corners = part.iter().flat_map(|(_, t)| t);
        nodes.push(Node {
            bounds: corners.fold(Bounds::EMPTY, |all, &p| all.with(p)),
            to,
            kind: Kind::Leaf { from, to },
        });
        if part.len() > LEAF {
            let half = part.len() / 2;
            split(part, half);
            open.push((from + half..to, Some(at)));
            open.push((from..from + half, None));
        }
    }
    nodes
}

/// Puts the `half` triangles with the smaller centroids along the widest axis first; ties go by index.
fn split(part: &mut [(usize, [Point; 3])], half: usize) {
    let centroid = |t: &[Point; 3], axis: usize| t[0][axis] + t[1][axis] + t[2][axis];
    let centroids = part
        .iter()
        .map(|(_, t)| [0, 1, 2].map(|axis| centroid(t, axis)));
    let around = centroids.fold(Bounds::EMPTY, Bounds::with);
    let width = |axis: &usize| around.max[*axis] - around.min[*axis];
    let widest = (0..3)
        .max_by(|a, b| width(a).total_cmp(&width(b)))
        .unwrap_or(0);
    part.select_nth_unstable_by(half, |(i, a), (j, b)| {
        let (a, b) = (centroid(a, widest), centroid(b, widest));
        a.total_cmp(&b).then(i.cmp(j))
    });
}
