//! Edge lengths and dihedral angles (Winkler et al. 2010, Froehlich & Botsch 2011): d = 2E + 6C where no edge has more than two triangles
//! and edges join all triangles of a component.
//!
//! An edge's numbers: its length over the mean edge length of the reference; then the dihedral angles of its pairs ([`super::hinges::pairs_of`]); then zeros up
//! to two. After all edges come the numbers of components and further parts, see [`super::placement`].
//!
//! Decoding starts from the surface that lengths and angles make by linear systems, as in `lric`, which for the vector of a frame is that frame; then
//! [`shell`](super::shell) descends to the nearest lengths and angles. Edges that only degenerate triangles have, and that join two components, have no say.
//! A frame in which a triangle's corners lie on a line is where dihedral angles jump: it comes back only as nearly as the descent ends.

use std::sync::Arc;

use super::edge_layout::EdgeLayout;
use super::placement::triangle_turn;
use super::pool::Pool;
use super::posed::{Stretch, UNSTRETCHED, area_of_sides, normal, stretch_of_sides};
use super::reference::{Reference, Triangle, check, check_len};
use super::shell::{Descent, Shell, Target};
use super::surface::Surface;
use super::{ShapeError, Space, SpaceKind};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;
use crate::mesh::vector::{Point, norm, point, sub};

/// The share of the area that given lengths make of a triangle below which decoding holds against it.
const LEAST_AREA: f64 = 0.1;
/// Numbers of an edge of one or two triangles.
const NUMBERS: usize = 2;

/// R^(2E + 6C).
#[derive(Debug)]
pub struct LengthsSpace {
    reference: Reference,
    surface: Surface,
    shell: Shell,
    /// Both ends of every edge, and where its length is.
    edges: Vec<([u32; 2], u32)>,
    layout: EdgeLayout,
    /// Where the lengths of the edges of the shell are.
    lengths: Vec<u32>,
    /// Where the lengths of a triangle's sides are, F x 3; none where a corner is repeated.
    sides: Vec<Option<[u32; 3]>>,
    /// The mean edge length of the reference.
    unit: f64,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    stretch: Vec<Stretch>,
    lengths: Vec<f64>,
    angles: Vec<f64>,
    areas: Vec<f64>,
    points: Vec<Point>,
    normals: Vec<Point>,
}

impl LengthsSpace {
    /// Over a reference frame of 3V positions. Costs as [`Surface::new`], and the analysis of the descent's equations.
    pub fn new(connectivity: Arc<Connectivity>, reference: &[f64]) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        let topology = Topology::new(reference.faces());
        let surface = Surface::new(&reference, &topology)?;
        let layout = EdgeLayout::new(&reference, &topology, |_| 1, NUMBERS);
        let edges = topology.edges().iter().copied();
        let edges: Vec<_> = edges.zip(layout.starts.iter().copied()).collect();
        let mut sides = vec![[None; 3]; reference.faces().len()];
        for (fan, &start) in topology.fans().zip(&layout.starts) {
            for half in fan {
                sides[half.triangle as usize][half.corner as usize] = Some(start);
            }
        }
        let inside = |(ends, _): &&([u32; 2], u32)| {
            let [a, b] = ends.map(|v| reference.labels[v as usize]);
            a == b
        };
        let held: Vec<_> = edges.iter().filter(inside).copied().collect();
        let ends: Vec<_> = held.iter().map(|&(ends, _)| ends).collect();
        let hinges: Vec<_> = surface.hinges().iter().map(|h| h.corners).collect();
        let faces = reference.faces().iter().zip(&reference.triangles);
        let faces: Vec<_> = faces
            .filter_map(|(&face, rest)| rest.as_ref().map(|_| face))
            .collect();
        Ok(Self {
            shell: Shell::new(reference.vertex_count(), &ends, &hinges, &faces)?,
            unit: mean_length(&reference.positions, &edges),
            surface,
            lengths: held.iter().map(|&(_, slot)| slot).collect(),
            edges,
            layout,
            sides: sides.into_iter().map(all).collect(),
            reference,
            work: Pool::default(),
        })
    }

    /// [`Space::decode`], and how the descent ended.
    pub fn descend(&self, z: &[f64], positions: &mut [f64]) -> Result<Descent, ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        let (edges, placed) = z.split_at(self.layout.numbers);
        self.work.lend(|work| {
            let number = |&slot: &u32| edges[slot as usize];
            work.stretch.clear();
            work.stretch.extend(self.stretches(edges));
            let angle = |hinge: usize| edges[self.layout.angles[hinge] as usize];
            self.surface
                .solve(&self.reference, &work.stretch, angle, placed, positions)?;
            work.lengths.clear();
            work.lengths.extend(self.lengths.iter().map(number));
            work.angles.clear();
            work.angles.extend(self.layout.angles.iter().map(number));
            work.areas.clear();
            work.areas.extend(self.solid_sides().map(|sides| {
                let lengths = sides.map(|slot| edges[slot as usize].max(0.0));
                LEAST_AREA * area_of_sides(lengths)
            }));
            // In mean edge lengths, as the given ones.
            let vertices = positions.as_chunks::<3>().0.iter();
            work.points.clear();
            work.points
                .extend(vertices.map(|p| p.map(|x| x / self.unit)));
            let target = Target {
                lengths: &work.lengths,
                angles: &work.angles,
                areas: &work.areas,
            };
            let found = self.shell.descend(&target, &mut work.points)?;
            if found.factorisations > 0 {
                let scaled = work.points.as_flattened().iter().map(|x| x * self.unit);
                positions.iter_mut().zip(scaled).for_each(|(x, y)| *x = y);
                self.surface
                    .placement()
                    .turn_and_place(&self.reference, placed, positions);
            }
            Ok(found)
        })
    }

    /// Where the lengths of the sides of triangles that are not degenerate are.
    fn solid_sides(&self) -> impl Iterator<Item = [u32; 3]> {
        let triangles = self.reference.triangles.iter().zip(&self.sides);
        triangles.filter_map(|(rest, &sides)| rest.as_ref().and(sides))
    }

    /// The stretch of every triangle with these sides; lengths below 0 count 0.
    fn stretches(&self, edges: &[f64]) -> impl Iterator<Item = Stretch> {
        let length = |slot: u32| self.unit * edges[slot as usize].max(0.0);
        let triangles = self.reference.triangles.iter().zip(&self.sides);
        triangles.map(move |(rest, sides)| match (rest, sides) {
            (Some(rest), Some(sides)) => stretch_of_sides(rest, sides.map(length)),
            _ => UNSTRETCHED,
        })
    }
}

impl Space for LengthsSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Lengths
    }

    fn dimension(&self) -> usize {
        self.layout.numbers + self.surface.placement().numbers()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (edges, placed) = z.split_at_mut(self.layout.numbers);
        edges.fill(0.0);
        for &(ends, slot) in &self.edges {
            edges[slot as usize] = length(positions, ends) / self.unit;
        }
        self.work.lend(|work| {
            let triangles = self.reference.faces().iter().zip(&self.reference.triangles);
            let normal = |(face, rest): (&[u32; 3], &Option<Triangle>)| match rest {
                Some(rest) => normal(rest, face.map(|v| point(positions, v))),
                None => [0.0; 3],
            };
            work.normals.clear();
            work.normals.extend(triangles.map(normal));
            for (&place, hinge) in self.layout.angles.iter().zip(self.surface.hinges()) {
                edges[place as usize] = hinge.angle(positions, &work.normals);
            }
        });
        let turn = |t| triangle_turn(&self.reference, positions, t);
        self.surface
            .placement()
            .encode(&self.reference, positions, turn, placed);
        Ok(())
    }

    /// The stationary frame that [`Self::descend`] reaches, or as near to one as it comes.
    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        self.descend(z, positions).map(|_| ())
    }

    fn decode_telling(
        &self,
        z: &[f64],
        positions: &mut [f64],
    ) -> Result<Option<Descent>, ShapeError> {
        self.descend(z, positions).map(Some)
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        if previous.len() == self.dimension() && z.len() == self.dimension() {
            self.layout.unwrap(previous, z);
            let end = self.layout.numbers;
            self.surface
                .placement()
                .unwrap(&previous[end..], &mut z[end..]);
        }
    }
}

fn length(positions: &[f64], ends: [u32; 2]) -> f64 {
    let [a, b] = ends.map(|v| point(positions, v));
    norm(sub(b, a))
}

/// 1 where it would be 0.
fn mean_length(positions: &[f64], edges: &[([u32; 2], u32)]) -> f64 {
    // Sums of sums, so that rounding does not grow with the number of edges.
    let some = |edges: &[([u32; 2], u32)]| -> f64 {
        edges.iter().map(|&(ends, _)| length(positions, ends)).sum()
    };
    let sum: f64 = edges.chunks(256).map(some).sum();
    match sum > 0.0 {
        true => sum / edges.len() as f64,
        false => 1.0,
    }
}

fn all([a, b, c]: [Option<u32>; 3]) -> Option<[u32; 3]> {
    Some([a?, b?, c?])
}
