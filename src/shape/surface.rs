//! A frame from the stretches of its triangles and the dihedral angles between them: rotations of triangles, then a Poisson equation (after Lipman et al.
//! 2005).

use super::ShapeError;
use super::frames::Frames;
use super::hinges::{Hinge, hinges};
use super::placement::Placement;
use super::poisson::Poisson;
use super::pool::Pool;
use super::posed::{Stretch, rest_axes};
use super::reference::{Reference, check};
use crate::linalg::rotation::{IDENTITY, Matrix, times};
use crate::mesh::topology::Topology;

/// What depends on the reference alone.
#[derive(Debug)]
pub struct Surface {
    hinges: Vec<Hinge>,
    frames: Frames,
    poisson: Poisson,
    placement: Placement,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    relative: Vec<Matrix>,
    axes: Vec<Matrix>,
}

impl Surface {
    /// Costs a sparse factorisation of V unknowns and the analysis of one of 3F.
    pub fn new(reference: &Reference, topology: &Topology) -> Result<Self, ShapeError> {
        let poisson = Poisson::new(reference)?;
        let hinges: Vec<_> = hinges(reference, topology)
            .filter_map(|pair| Hinge::new(reference, &pair))
            .collect();
        let pairs = hinges.iter().map(|h| h.triangles).collect();
        let frames = Frames::new(reference.faces().len(), pairs)?;
        let lowest = reference.components.iter().map(|c| c.first_triangle);
        let component_of = |t| {
            reference
                .is_sound(t)
                .then(|| reference.component_of(t as usize) as u32)
        };
        Ok(Self {
            placement: Placement::new(lowest.collect(), frames.roots(), component_of),
            frames,
            hinges,
            poisson,
            work: Pool::default(),
        })
    }

    /// The pairs of triangles that are not degenerate, in the order of their edges.
    pub fn hinges(&self) -> &[Hinge] {
        &self.hinges
    }

    /// Where components and further parts are; members are triangles.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// The frame in which triangles are stretched like this (any number for degenerate ones), hinges bent like this, and components and further parts placed
    /// at their numbers, as nearly as can be. Costs two sparse solves where hinges and stretches agree, as those of a frame do, and a sparse
    /// factorisation of 3F unknowns where they do not. Errors as [`Frames::solve`].
    pub fn solve(
        &self,
        reference: &Reference,
        stretch: &[Stretch],
        angle: impl Fn(usize) -> f64,
        placed: &[f64],
        positions: &mut [f64],
    ) -> Result<(), ShapeError> {
        self.work.lend(|work| {
            let turns = self.hinges.iter().enumerate().map(|(i, hinge)| {
                let [f, g] = hinge.triangles.map(|t| stretch[t as usize]);
                hinge.turn(f, g, angle(i))
            });
            work.relative.clear();
            work.relative.extend(turns);
            work.axes.clear();
            work.axes.resize(stretch.len(), IDENTITY);
            for (root, turn) in self.placement.turns(placed) {
                if let Some(rest) = &reference.triangles[root as usize] {
                    work.axes[root as usize] = times(&turn, &rest_axes(rest));
                }
            }
            self.frames.solve(&work.relative, &mut work.axes)?;
            let fill = |range: std::ops::Range<usize>, out: &mut [_]| {
                let both = work.axes[range.clone()].iter().zip(&stretch[range]);
                for (out, (axes, &[uu, vv, uv])) in out.iter_mut().zip(both) {
                    let image =
                        |x: f64, y: f64| std::array::from_fn(|i| x * axes[0][i] + y * axes[1][i]);
                    *out = [image(uu, uv), image(uv, vv)];
                }
            };
            self.poisson.solve(fill, positions);
            self.placement.place(reference, placed, positions);
            check("decoded frame", positions, reference.frame_len())
        })
    }
}
