//! Rotation-invariant coordinates, the first and second fundamental form kept at triangles and edges (after Lipman et al. 2005): d = 3E + 6C where no edge
//! has more than two triangles.
//!
//! A triangle's first form, its stretch U_11, U_22, sqrt2 U_12, is kept at its half-edges in this order. An edge's numbers: those of its half-edges, in the
//! order of their triangles; then the dihedral angles of its pairs; then zeros up to three. After all edges come the six numbers of each component, see
//! [`placement`].

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};
use std::sync::Arc;

use super::placement;
use super::pool::Pool;
use super::posed::{Stretch, UNSTRETCHED, posed};
use super::reference::{Reference, check, check_len};
use super::surface::Surface;
use super::{ShapeError, Space, SpaceKind};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;
use crate::mesh::vector::point;

/// Numbers of an edge of one or two triangles.
const NUMBERS: usize = 3;
/// In place of a half-edge that is not there, as a corner is repeated.
const NOWHERE: u32 = u32::MAX;

/// R^(3E + 6C).
#[derive(Debug)]
pub struct LricSpace {
    reference: Reference,
    surface: Surface,
    /// Where the numbers of a triangle's half-edges are, F x 3.
    halves: Vec<[u32; 3]>,
    /// Where the dihedral angle of each of the surface's hinges is.
    angles: Vec<u32>,
    /// How many numbers the edges have together.
    edge_numbers: usize,
    work: Pool<Vec<Stretch>>,
}

impl LricSpace {
    /// Over a reference frame of 3V positions. Costs two sparse factorisations.
    pub fn new(connectivity: Arc<Connectivity>, reference: &[f64]) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        let topology = Topology::new(reference.faces());
        let surface = Surface::new(&reference, &topology)?;
        let mut halves = vec![[NOWHERE; 3]; reference.faces().len()];
        let (mut angles, mut next) = (Vec::new(), 0);
        let solid = |triangle: u32| reference.triangles[triangle as usize].is_some();
        for fan in topology.fans() {
            for (slot, half) in (next..).zip(fan) {
                halves[half.triangle as usize][half.corner as usize] = slot;
            }
            let after = next + fan.len() as u32;
            let pairs = (after..).zip(&fan[1..]);
            let hinges = pairs.filter(|(_, half)| solid(fan[0].triangle) && solid(half.triangle));
            angles.extend(hinges.map(|(slot, _)| slot));
            next += NUMBERS.max(2 * fan.len() - 1) as u32;
        }
        Ok(Self {
            reference,
            surface,
            halves,
            angles,
            edge_numbers: next as usize,
            work: Pool::default(),
        })
    }
}

impl Space for LricSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Lric
    }

    fn dimension(&self) -> usize {
        self.edge_numbers + placement::NUMBERS * self.reference.components.len()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (edges, placed) = z.split_at_mut(self.edge_numbers);
        edges.fill(0.0);
        let triangles = self.reference.faces().iter().zip(&self.reference.triangles);
        for ((face, rest), halves) in triangles.zip(&self.halves) {
            let corners = face.map(|v| point(positions, v));
            let form = rest
                .as_ref()
                .map_or(UNSTRETCHED, |rest| posed(rest, corners).stretch);
            for (&slot, number) in halves.iter().zip([form[0], form[1], SQRT_2 * form[2]]) {
                if let Some(place) = edges.get_mut(slot as usize) {
                    *place = number;
                }
            }
        }
        for (&slot, hinge) in self.angles.iter().zip(self.surface.hinges()) {
            edges[slot as usize] = hinge.angle(positions);
        }
        placement::encode(&self.reference, positions, placed);
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        let (edges, placed) = z.split_at(self.edge_numbers);
        let number = |slot: u32, missing: f64| edges.get(slot as usize).copied().unwrap_or(missing);
        self.work.lend(|stretch| {
            let forms = self.halves.iter().map(|&[uu, vv, uv]| {
                [
                    number(uu, 1.0),
                    number(vv, 1.0),
                    FRAC_1_SQRT_2 * number(uv, 0.0),
                ]
            });
            stretch.clear();
            stretch.extend(forms);
            let angle = |hinge: usize| edges[self.angles[hinge] as usize];
            self.surface
                .solve(&self.reference, stretch, angle, placed, positions)
        })
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        if previous.len() == self.dimension() && z.len() == self.dimension() {
            unwrap_angles(&self.angles, previous, z);
            placement::unwrap(&previous[self.edge_numbers..], &mut z[self.edge_numbers..]);
        }
    }
}

/// Chooses the branches of the angles at these places nearest to those of `previous`.
pub(super) fn unwrap_angles(places: &[u32], previous: &[f64], z: &mut [f64]) {
    for place in places.iter().map(|&p| p as usize) {
        z[place] += TAU * ((previous[place] - z[place]) / TAU).round();
    }
}
