//! Patches of a surface, chosen by how it moves: parts that turn as one.
//!
//! What turns alike belongs together, and what is told apart must not be so far apart that rotation vectors lose count of turns. So triangles are joined
//! bottom up, as in hierarchical face clustering (Garland, Willmott & Heckbert 2001): of all regions that share an edge the two are joined that cost the least,
//!
//!   cost(a, b) = w_a w_b / (w_a + w_b) (max_i |M_a,i - M_b,i|_F^2 + const),
//!
//! Ward's (1963) criterion with w the areas in the reference and M_a,i the mean of A_f R_f over the region in frame i, R_f as in [`super::gradient`]; the greatest over some
//! frames stands where Ward has a sum, so that one frame of many can keep regions apart, and the constant joins what does not turn at all evenly. Regions that turn against
//! each other by more than 45 degrees in one of these frames stay apart, unless one has less than 1/500 of its component's area: slivers and noise make no patches. Along
//! a surface that bends evenly a patch then turns by at most 45 degrees to either side of its mean, and adjacent ones by at most 90 against each other, far from 180.
//! Means are rotation-free: moving any frame rigidly changes nothing but rounding.
//!
//! How Baran et al. (2009) divide the surface is theirs; the coordinates take any patches, these among them.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};
use std::sync::Arc;

use rayon::prelude::*;

use super::ShapeError;
use super::deformation::{Deformation, LANES};
use super::partition::{NO_PATCH, sound};
use super::reference::{Reference, check};
use crate::mesh::Connectivity;
use crate::mesh::topology::{Topology, linked};

/// At most so many frames are looked at, evenly spaced, the first and the last among them.
const SAMPLES: usize = 16;
/// |R - R'|_F^2 = 8 sin^2(angle / 2) at 45 degrees.
const APART: f32 = 1.171_572_9;
/// The constant in the cost, as of 4 degrees.
const EVENLY: f32 = 0.01;
/// The share of a component's area below which a region always joins another.
const SMALL: f64 = 1.0 / 500.0;
/// Numbers of a rotation.
const TURN: usize = 9;

/// The patch of each triangle: 0 .. P-1 by lowest triangle, -1 for those that are degenerate in the reference (V x 3). `frames` are n x 3V positions; none, or
/// frames that are all rigid, give one patch a component.
///
/// A patch is connected by edges, except where parts of a component touch at a vertex only: the patches that meet there are one, so that pairs of adjacent
/// patches join all those of a component, as the coordinates need. Deterministic. O(F log F) steps where regions are as round as those of real surfaces, each of
/// at most 16 rotations; about 1 kB a triangle.
pub fn choose(
    connectivity: Arc<Connectivity>,
    reference: &[f64],
    frames: &[f64],
) -> Result<Vec<i64>, ShapeError> {
    let reference = Reference::new(connectivity, reference)?;
    let len = reference.frame_len().max(1);
    check("frames", frames, frames.len() / len * len)?;
    let topology = Topology::new(reference.faces());
    let links = links(&reference, &topology);
    let mut regions = Regions::new(&reference, &samples(frames, len), &links);
    let mut joined = regions.join_all();
    joined.extend(bridges(&reference, &links));
    let (labels, _) = linked(reference.faces().len(), joined);
    Ok(number(&reference, &labels))
}

/// Evenly spaced frames.
fn samples(frames: &[f64], len: usize) -> Vec<&[f64]> {
    let frames: Vec<&[f64]> = frames.chunks_exact(len).collect();
    let (n, count) = (frames.len(), frames.len().min(SAMPLES));
    let pick = |i: usize| frames[i * (n - 1) / (count - 1).max(1)];
    (0..count).map(pick).collect()
}

/// Triangles that share an edge: at each, the lowest that is not degenerate with the others.
fn links(reference: &Reference, topology: &Topology) -> Vec<[u32; 2]> {
    let mut links = Vec::new();
    for fan in topology.fans() {
        let mut triangles = sound(reference, fan);
        if let Some(first) = triangles.next() {
            links.extend(triangles.map(|other| [first, other]));
        }
    }
    links
}

/// Triangles that share a vertex, two for every two parts that no links join.
fn bridges(reference: &Reference, links: &[[u32; 2]]) -> impl Iterator<Item = [u32; 2]> {
    let (parts, _) = linked(reference.faces().len(), links.iter().copied());
    let mut firsts: Vec<Option<u32>> = vec![None; reference.vertex_count()];
    let mut bridges = BTreeMap::new();
    for (f, face) in reference.faces().iter().enumerate() {
        if reference.triangles[f].is_none() {
            continue;
        }
        for &v in face {
            let first = *firsts[v as usize].get_or_insert(f as u32);
            let [p, q] = [parts[first as usize], parts[f]];
            if p != q {
                bridges
                    .entry([p.min(q), p.max(q)])
                    .or_insert([first, f as u32]);
            }
        }
    }
    bridges.into_values()
}

/// Labels without gaps, by lowest triangle.
fn number(reference: &Reference, labels: &[u32]) -> Vec<i64> {
    let mut numbers = vec![NO_PATCH; labels.len()];
    let mut next = 0..;
    let both = labels.iter().zip(&reference.triangles);
    both.map(|(&label, triangle)| {
        let number = &mut numbers[label as usize];
        if triangle.is_none() {
            return NO_PATCH;
        }
        if *number == NO_PATCH {
            *number = next.next().unwrap_or(NO_PATCH);
        }
        *number
    })
    .collect()
}

/// Regions of triangles, each under the number of one of them.
struct Regions {
    /// Numbers of a region's mean rotations.
    width: usize,
    means: Vec<f32>,
    /// Over the squared diagonal.
    areas: Vec<f64>,
    /// Of every triangle: what is small in its component.
    small: Vec<f64>,
    neighbours: Vec<BTreeSet<u32>>,
    /// How often a region has grown.
    stamps: Vec<u32>,
    queue: BinaryHeap<Reverse<Joint>>,
}

/// Two regions, a < b, in the order in which they are joined: the bits of the cost, which is not negative; a; b; the sum of their stamps.
type Joint = (u64, u32, u32, u32);

impl Regions {
    fn new(reference: &Reference, samples: &[&[f64]], links: &[[u32; 2]]) -> Self {
        let faces = reference.faces().len();
        let areas = reference.area_shares();
        let mut whole = vec![0.0; reference.components.len()];
        for (f, area) in areas.iter().enumerate().filter(|(_, area)| **area > 0.0) {
            whole[reference.component_of(f)] += area;
        }
        let small = |f: usize| SMALL * whole[reference.component_of(f)];
        let mut neighbours = vec![BTreeSet::new(); faces];
        for &[f, g] in links {
            neighbours[f as usize].insert(g);
            neighbours[g as usize].insert(f);
        }
        let mut regions = Self {
            width: TURN * samples.len(),
            means: rotations(reference, samples),
            small: (0..faces).map(small).collect(),
            areas,
            neighbours,
            stamps: vec![0; faces],
            queue: BinaryHeap::new(),
        };
        let joints: Vec<_> = links.iter().map(|&[f, g]| regions.joint(f, g)).collect();
        regions.queue = joints.into();
        regions
    }

    /// Joins while there is something to join; the pairs of triangles that stood for regions.
    fn join_all(&mut self) -> Vec<[u32; 2]> {
        let mut joined = Vec::new();
        while let Some(Reverse((_, a, b, stamps))) = self.queue.pop() {
            let is_now = self.neighbours[a as usize].contains(&b)
                && self.stamps[a as usize] + self.stamps[b as usize] == stamps;
            if is_now && self.may_join(a, b) {
                self.join(a, b);
                joined.push([a, b]);
            }
        }
        joined
    }

    fn may_join(&self, a: u32, b: u32) -> bool {
        let lesser = self.areas[a as usize].min(self.areas[b as usize]);
        lesser < self.small[a as usize] || self.gap(a, b) <= APART
    }

    /// b becomes part of a.
    fn join(&mut self, a: u32, b: u32) {
        self.average(a as usize, b as usize);
        let others = std::mem::take(&mut self.neighbours[b as usize]);
        for other in others {
            self.neighbours[other as usize].remove(&b);
            if other != a {
                self.neighbours[other as usize].insert(a);
                self.neighbours[a as usize].insert(other);
            }
        }
        self.stamps[a as usize] += 1;
        let joints = self.neighbours[a as usize]
            .iter()
            .map(|&c| self.joint(a, c));
        let joints: Vec<_> = joints.collect();
        self.queue.extend(joints);
    }

    fn average(&mut self, a: usize, b: usize) {
        let whole = self.areas[a] + self.areas[b];
        let share = (self.areas[b] / whole) as f32;
        let (low, high) = self.means.split_at_mut(b * self.width);
        let mean = &mut low[a * self.width..(a + 1) * self.width];
        for (mean, other) in mean.iter_mut().zip(&high[..self.width]) {
            *mean += share * (other - *mean);
        }
        self.areas[a] = whole;
    }

    fn joint(&self, a: u32, b: u32) -> Reverse<Joint> {
        let (a, b) = (a.min(b), a.max(b));
        let [v, w] = [a, b].map(|region| self.areas[region as usize]);
        let cost = v / (v + w) * w * f64::from(self.gap(a, b) + EVENLY);
        let stamps = self.stamps[a as usize] + self.stamps[b as usize];
        Reverse((cost.to_bits(), a, b, stamps))
    }

    /// max_i |M_a,i - M_b,i|_F^2.
    fn gap(&self, a: u32, b: u32) -> f32 {
        let mean = |region: u32| {
            let start = region as usize * self.width;
            self.means[start..start + self.width].as_chunks::<TURN>().0
        };
        let both = mean(a).iter().zip(mean(b));
        let squares =
            both.map(|(a, b)| (0..TURN).fold(0.0, |sum, k| sum + (a[k] - b[k]) * (a[k] - b[k])));
        squares.fold(0.0, f32::max)
    }
}

/// R of every triangle in every sample, F x samples x 9.
fn rotations(reference: &Reference, samples: &[&[f64]]) -> Vec<f32> {
    let width = TURN * samples.len();
    let deformation = Deformation::new(reference);
    let mut turns = vec![0.0f32; reference.faces().len() * width];
    let blocks = reference.faces().par_chunks(LANES).enumerate();
    blocks
        .zip(turns.par_chunks_mut((LANES * width).max(1)))
        .for_each(|((block, faces), turns)| {
            for (i, frame) in samples.iter().enumerate() {
                let (rotation, _) = deformation.block(block, faces, frame);
                for (lane, turns) in turns.chunks_exact_mut(width).enumerate() {
                    let turn = rotation.get(lane).map(|x| x as f32);
                    turns[TURN * i..TURN * (i + 1)].copy_from_slice(&turn);
                }
            }
        });
    turns
}
