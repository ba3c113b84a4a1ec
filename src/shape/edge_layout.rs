//! Where the numbers of edges are in a vector: some of the edge itself, then the dihedral angles of its pairs, then zeros up to a least count.

use std::f64::consts::TAU;

use super::hinges::{is_hinge, pairs_of};
use super::reference::Reference;
use crate::mesh::topology::Topology;

/// Of all edges of a mesh, in their order.
#[derive(Debug)]
pub struct EdgeLayout {
    /// Where the numbers of each edge begin.
    pub starts: Vec<u32>,
    /// Where the dihedral angle of each hinge is; those of other pairs are 0.
    pub angles: Vec<u32>,
    /// How many numbers the edges have together.
    pub numbers: usize,
}

impl EdgeLayout {
    /// With so many numbers, given how many triangles an edge has, before its angles, and at least `least` in all. O(E).
    pub fn new(
        reference: &Reference,
        topology: &Topology,
        before: impl Fn(usize) -> usize,
        least: usize,
    ) -> Self {
        let (mut starts, mut angles, mut next) = (Vec::new(), Vec::new(), 0);
        for (edge, fan) in topology.fans().enumerate() {
            starts.push(next);
            let first = next + before(fan.len()) as u32;
            let pairs = (first..).zip(pairs_of(reference, edge, fan));
            angles.extend(
                pairs
                    .filter(|(_, pair)| is_hinge(reference, pair))
                    .map(|(place, _)| place),
            );
            next += (before(fan.len()) + fan.len() - 1).max(least) as u32;
        }
        Self {
            starts,
            angles,
            numbers: next as usize,
        }
    }

    /// Chooses the branches of the angles nearest to those of `previous`.
    pub fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        for place in self.angles.iter().map(|&p| p as usize) {
            z[place] += TAU * ((previous[place] - z[place]) / TAU).round();
        }
    }
}
