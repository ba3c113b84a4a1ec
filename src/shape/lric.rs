//! Rotation-invariant coordinates, the first and second fundamental form kept at triangles and edges (after Lipman et al. 2005): d = 3E + 6C where no edge
//! has more than two triangles and edges join all triangles of a component.
//!
//! A triangle's first form, its stretch U_11, U_22, sqrt2 U_12, is kept at its half-edges in this order. An edge's numbers: those of its half-edges, in the
//! order of their triangles; then the dihedral angles of its pairs ([`super::hinges::pairs_of`]); then zeros up to three. After all edges come the
//! numbers of components and further parts, see [`super::placement`].

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::sync::Arc;

use super::edge_layout::EdgeLayout;
use super::placement::triangle_turn;
use super::pool::Pool;
use super::posed::{Stretch, UNSTRETCHED, posed};
use super::reference::{Reference, check, check_len};
use super::surface::Surface;
use super::{ShapeError, Space, SpaceKind};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;
use crate::mesh::vector::{Point, point};

/// Numbers of an edge of one or two triangles.
const NUMBERS: usize = 3;
/// In place of a half-edge that is not there, as a corner is repeated.
const NOWHERE: u32 = u32::MAX;

/// R^(3E + 6C).
#[derive(Debug)]
pub struct LricSpace {
    reference: Reference,
    surface: Surface,
    edges: EdgeLayout,
    /// Where the numbers of a triangle's half-edges are, F x 3.
    halves: Vec<[u32; 3]>,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    stretch: Vec<Stretch>,
    normals: Vec<Point>,
}

impl LricSpace {
    /// Over a reference frame of 3V positions. Costs as [`Surface::new`].
    pub fn new(connectivity: Arc<Connectivity>, reference: &[f64]) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        let topology = Topology::new(reference.faces());
        let edges = EdgeLayout::new(&reference, &topology, |triangles| triangles, NUMBERS);
        let mut halves = vec![[NOWHERE; 3]; reference.faces().len()];
        for (fan, &start) in topology.fans().zip(&edges.starts) {
            for (place, half) in (start..).zip(fan) {
                halves[half.triangle as usize][half.corner as usize] = place;
            }
        }
        Ok(Self {
            surface: Surface::new(&reference, &topology)?,
            reference,
            edges,
            halves,
            work: Pool::default(),
        })
    }
}

impl Space for LricSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Lric
    }

    fn dimension(&self) -> usize {
        self.edges.numbers + self.surface.placement().numbers()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (edges, placed) = z.split_at_mut(self.edges.numbers);
        edges.fill(0.0);
        self.work.lend(|work| {
            work.normals.clear();
            let triangles = self.reference.faces().iter().zip(&self.reference.triangles);
            for ((face, rest), halves) in triangles.zip(&self.halves) {
                let corners = face.map(|v| point(positions, v));
                let (form, normal) = match rest {
                    Some(rest) => {
                        let posed = posed(rest, corners);
                        (posed.stretch, posed.axes[2])
                    }
                    None => (UNSTRETCHED, [0.0; 3]),
                };
                work.normals.push(normal);
                for (&place, number) in halves.iter().zip([form[0], form[1], SQRT_2 * form[2]]) {
                    if let Some(at) = edges.get_mut(place as usize) {
                        *at = number;
                    }
                }
            }
            for (&place, hinge) in self.edges.angles.iter().zip(self.surface.hinges()) {
                edges[place as usize] = hinge.angle(positions, &work.normals);
            }
        });
        let turn = |t| triangle_turn(&self.reference, positions, t);
        self.surface
            .placement()
            .encode(&self.reference, positions, turn, placed);
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        let (edges, placed) = z.split_at(self.edges.numbers);
        let number = |slot: u32, missing: f64| edges.get(slot as usize).copied().unwrap_or(missing);
        self.work.lend(|Work { stretch, .. }| {
            let forms = self.halves.iter().map(|&[uu, vv, uv]| {
                [
                    number(uu, 1.0),
                    number(vv, 1.0),
                    FRAC_1_SQRT_2 * number(uv, 0.0),
                ]
            });
            stretch.clear();
            stretch.extend(forms);
            let angle = |hinge: usize| edges[self.edges.angles[hinge] as usize];
            self.surface
                .solve(&self.reference, stretch, angle, placed, positions)
        })
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        if previous.len() == self.dimension() && z.len() == self.dimension() {
            self.edges.unwrap(previous, z);
            let end = self.edges.numbers;
            self.surface
                .placement()
                .unwrap(&previous[end..], &mut z[end..]);
        }
    }
}
