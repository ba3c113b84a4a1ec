//! A surface divided into patches: labels of triangles, checked, and which patches are adjacent.
//!
//! Every triangle that is not degenerate is of one patch, 0 .. P-1, and every patch inside one component; degenerate triangles are labelled -1. Patches are
//! adjacent where they share an edge: at an edge of several triangles all the patches there are, each with each other.

use thiserror::Error;

use super::reference::Reference;
use crate::mesh::topology::{HalfEdge, Topology};

/// The label of degenerate triangles.
pub const NO_PATCH: i64 = -1;
/// More adjacent pairs come of no surface, only of a crowd of patches at one edge.
const MOST_PAIRS: usize = 1 << 24;

/// Patches of a reference frame's triangles.
#[derive(Clone, Debug)]
pub struct Partition {
    /// The patch of each triangle, F; P for degenerate ones, so that it is an index of P + 1 things.
    pub labels: Vec<u32>,
    /// The component of each patch, P.
    pub components: Vec<u32>,
    /// The adjacent patches p < q, ascending.
    pub pairs: Vec<[u32; 2]>,
}

/// Why labels are no patches.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum PatchError {
    #[error(
        "{found} patch labels for {expected} triangles; expected one label a triangle (`shape::patches::choose` makes them)"
    )]
    WrongCount { expected: usize, found: usize },
    #[error(
        "triangle {triangle} (0-based) has the patch label {found}; expected 0 to F - 1, or -1 if and only if it is degenerate in the reference"
    )]
    BadLabel { triangle: usize, found: i64 },
    #[error(
        "no triangle has the patch label {patch}, and some have a greater one; expected labels without a gap"
    )]
    Empty { patch: usize },
    #[error(
        "patch {patch} has triangles {first} and {second} (0-based) in two components; expected every patch inside one"
    )]
    Divided {
        patch: usize,
        first: usize,
        second: usize,
    },
    #[error(
        "more than {MOST_PAIRS} pairs of patches share an edge; expected fewer patches where many triangles meet at one edge"
    )]
    Crowded,
}

impl Partition {
    /// Checks labels, one a triangle. O(F log F).
    pub fn new(
        reference: &Reference,
        topology: &Topology,
        labels: &[i64],
    ) -> Result<Self, PatchError> {
        let firsts = first_triangles(reference, labels)?;
        let patches = firsts.len() as u32;
        let components: Vec<u32> = firsts
            .iter()
            .map(|&f| reference.component_of(f) as u32)
            .collect();
        for (triangle, &label) in labels.iter().enumerate().filter(|(_, l)| **l != NO_PATCH) {
            let patch = label as usize;
            if reference.component_of(triangle) as u32 != components[patch] {
                return Err(PatchError::Divided {
                    patch,
                    first: firsts[patch],
                    second: triangle,
                });
            }
        }
        let number = |&label: &i64| u32::try_from(label).unwrap_or(patches);
        let labels: Vec<u32> = labels.iter().map(number).collect();
        let pairs = adjacent(topology, &labels, patches)?;
        Ok(Self {
            labels,
            components,
            pairs,
        })
    }

    /// P.
    pub fn patches(&self) -> usize {
        self.components.len()
    }
}

/// The triangles of an edge that are not degenerate in the reference, ascending.
pub fn sound<'a>(reference: &'a Reference, fan: &'a [HalfEdge]) -> impl Iterator<Item = u32> {
    let triangles = fan.iter().map(|half| half.triangle);
    triangles.filter(|&triangle| reference.triangles[triangle as usize].is_some())
}

/// The lowest triangle of every patch.
fn first_triangles(reference: &Reference, labels: &[i64]) -> Result<Vec<usize>, PatchError> {
    let expected = reference.faces().len();
    if labels.len() != expected {
        let found = labels.len();
        return Err(PatchError::WrongCount { expected, found });
    }
    let mut firsts: Vec<Option<usize>> = Vec::new();
    for (triangle, &found) in labels.iter().enumerate() {
        let degenerate = reference.triangles[triangle].is_none();
        match usize::try_from(found) {
            Ok(patch) if !degenerate && patch < expected => {
                firsts.resize(firsts.len().max(patch + 1), None);
                firsts[patch].get_or_insert(triangle);
            }
            Err(_) if degenerate && found == NO_PATCH => {}
            _ => return Err(PatchError::BadLabel { triangle, found }),
        }
    }
    let number = |(patch, first): (usize, Option<usize>)| first.ok_or(PatchError::Empty { patch });
    firsts.into_iter().enumerate().map(number).collect()
}

/// The patches that share an edge. Labels of degenerate triangles are `patches`.
fn adjacent(
    topology: &Topology,
    labels: &[u32],
    patches: u32,
) -> Result<Vec<[u32; 2]>, PatchError> {
    let mut pairs = Vec::new();
    let mut here = Vec::new();
    for fan in topology.fans() {
        here.clear();
        let labels = fan.iter().map(|half| labels[half.triangle as usize]);
        here.extend(labels.filter(|&label| label < patches));
        here.sort_unstable();
        here.dedup();
        for (i, &q) in here.iter().enumerate() {
            pairs.extend(here[..i].iter().map(|&p| [p, q]));
            if pairs.len() > MOST_PAIRS {
                return Err(PatchError::Crowded);
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    Ok(pairs)
}
