//! Where a surface is. Six numbers of each component: the rotation vector of its lowest member (triangle or patch) from the reference, then its centre over
//! the diagonal; a component of one vertex has no rotation: zeros. Then three of each *further part*, whose rotation nothing else tells because only
//! vertices or degenerate triangles join it to the part of that member: the rotation vector of its own lowest member against that of the component's.

use super::posed::{posed, rest_axes};
use super::reference::Reference;
use crate::linalg::rotation::{
    IDENTITY, Matrix, apply, exp, log, nearest_branch, times, times_transposed, transposed_times,
};
use crate::mesh::vector::point;

/// Numbers of a component.
const OF_COMPONENT: usize = 6;
/// Numbers of a further part.
const OF_PART: usize = 3;

/// Which members the rotations are of.
#[derive(Debug)]
pub struct Placement {
    /// The lowest member of each component; none for a vertex by itself.
    lowest: Vec<Option<u32>>,
    /// The lowest member of each further part, ascending, and its component.
    further: Vec<(u32, u32)>,
}

impl Placement {
    /// From the lowest member of each component and of each part (ascending), and the component of a member; of parts with none, such as degenerate triangles,
    /// there are no numbers.
    pub fn new(
        lowest: Vec<Option<u32>>,
        parts: &[u32],
        component_of: impl Fn(u32) -> Option<u32>,
    ) -> Self {
        let placed = parts.iter().filter_map(|&m| Some((m, component_of(m)?)));
        let further = placed.filter(|&(m, component)| lowest[component as usize] != Some(m));
        Self {
            further: further.collect(),
            lowest,
        }
    }

    /// 6C, and 3 for each further part.
    pub fn numbers(&self) -> usize {
        self.of_components() + OF_PART * self.further.len()
    }

    fn of_components(&self) -> usize {
        OF_COMPONENT * self.lowest.len()
    }

    /// Writes the numbers of a frame in which members are turned from the reference like this.
    pub fn encode(
        &self,
        reference: &Reference,
        positions: &[f64],
        turn: impl Fn(u32) -> Matrix,
        z: &mut [f64],
    ) {
        let (components, parts) = z.split_at_mut(self.of_components());
        let mut centres = vec![0.0; 3 * self.lowest.len()];
        reference.centres(positions, &mut centres);
        let components = components.as_chunks_mut::<OF_COMPONENT>().0.iter_mut();
        let placed = self.lowest.iter().zip(centres.as_chunks::<3>().0);
        for (z, (lowest, centre)) in components.zip(placed) {
            z[..3].copy_from_slice(&lowest.map_or([0.0; 3], |m| log(&turn(m))));
            z[3..].copy_from_slice(centre);
        }
        let parts = parts.as_chunks_mut::<OF_PART>().0.iter_mut();
        for (z, &(member, component)) in parts.zip(&self.further) {
            let lowest = self.lowest[component as usize].map_or(IDENTITY, &turn);
            *z = log(&transposed_times(&lowest, &turn(member)));
        }
    }

    /// The lowest members of all parts, and how they are turned from the reference.
    pub fn turns(&self, z: &[f64]) -> impl Iterator<Item = (u32, Matrix)> {
        let (components, parts) = z.split_at(self.of_components());
        let rotations = rotations(components);
        let parts = self.further.iter().zip(parts.as_chunks::<OF_PART>().0);
        let further = parts.map(|(&(member, component), &vector)| {
            (member, times(&rotations[component as usize], &exp(vector)))
        });
        let further: Vec<_> = further.collect();
        let lowest = self.lowest.iter().zip(rotations);
        let lowest = lowest.filter_map(|(member, turn)| member.map(|m| (m, turn)));
        lowest.chain(further)
    }

    /// Moves every component of a frame to its centre.
    pub fn place(&self, reference: &Reference, z: &[f64], positions: &mut [f64]) {
        let components = z[..self.of_components()].as_chunks::<OF_COMPONENT>().0;
        let centres = components.iter().flat_map(|&[.., x, y, z]| [x, y, z]);
        reference.place(&centres.collect::<Vec<f64>>(), positions);
    }

    /// Turns every component of a frame as a whole so that its lowest triangle faces as its numbers say, and moves it to its centre.
    pub fn turn_and_place(&self, reference: &Reference, z: &[f64], positions: &mut [f64]) {
        let wanted = rotations(&z[..self.of_components()]);
        let turn = |(lowest, wanted): (&Option<u32>, &Matrix)| {
            let found = triangle_turn(reference, positions, (*lowest)?);
            Some(times_transposed(wanted, &found))
        };
        let turns: Vec<Option<Matrix>> = self.lowest.iter().zip(&wanted).map(turn).collect();
        let points = positions.as_chunks_mut::<3>().0.iter_mut();
        for (p, &label) in points.zip(&reference.labels) {
            if let Some(turn) = &turns[label as usize] {
                *p = apply(turn, *p);
            }
        }
        self.place(reference, z, positions);
    }

    /// Chooses the branches of the rotation vectors nearest to those of `previous`.
    pub fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        let end = self.of_components();
        let starts = (0..end).step_by(OF_COMPONENT);
        for at in starts.chain((end..self.numbers()).step_by(OF_PART)) {
            let [vector, before] = [&z[at..], &previous[at..]].map(|z| [z[0], z[1], z[2]]);
            z[at..at + 3].copy_from_slice(&nearest_branch(vector, before));
        }
    }
}

fn rotations(components: &[f64]) -> Vec<Matrix> {
    let components = components.as_chunks::<OF_COMPONENT>().0.iter();
    components.map(|&[x, y, z, ..]| exp([x, y, z])).collect()
}

/// How a triangle of a frame is turned from the reference, of the axes that [`posed`] gives; not at all where it is degenerate there.
pub fn triangle_turn(reference: &Reference, positions: &[f64], triangle: u32) -> Matrix {
    let face = reference.faces()[triangle as usize];
    let corners = face.map(|v| point(positions, v));
    let turn = reference.triangles[triangle as usize]
        .as_ref()
        .map(|rest| times_transposed(&posed(rest, corners).axes, &rest_axes(rest)));
    turn.unwrap_or(IDENTITY)
}
