//! A frame from the stretches of its triangles and the dihedral angles between them: rotations of triangles, then a Poisson equation (after Lipman et al.
//! 2005).

use super::ShapeError;
use super::frames::Frames;
use super::hinges::Hinge;
use super::placement;
use super::poisson::Poisson;
use super::pool::Pool;
use super::posed::{Stretch, rest_axes};
use super::reference::Reference;
use crate::linalg::rotation::{IDENTITY, Matrix, times};
use crate::mesh::topology::Topology;

/// What depends on the reference alone.
#[derive(Debug)]
pub struct Surface {
    hinges: Vec<Hinge>,
    frames: Frames,
    poisson: Poisson,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    relative: Vec<Matrix>,
    axes: Vec<Matrix>,
}

impl Surface {
    /// Costs two sparse factorisations, of V and of F unknowns.
    pub fn new(reference: &Reference, topology: &Topology) -> Result<Self, ShapeError> {
        let poisson = Poisson::new(reference)?;
        let hinges: Vec<_> = topology
            .pairs()
            .filter_map(|pair| Hinge::new(reference, &pair))
            .collect();
        let pairs = hinges.iter().map(|h| h.triangles).collect();
        Ok(Self {
            frames: Frames::new(reference.faces().len(), pairs)?,
            hinges,
            poisson,
            work: Pool::default(),
        })
    }

    /// The pairs of triangles that are not degenerate, in the order of their edges.
    pub fn hinges(&self) -> &[Hinge] {
        &self.hinges
    }

    /// The frame in which triangles are stretched like this (any number for degenerate ones), hinges bent like this, and components placed at their six
    /// numbers, as nearly as can be. Errors as [`Frames::solve`].
    ///
    /// Triangles that no chain of hinges joins to the lowest of their component (only a vertex does, or a degenerate triangle) have no rotation of their own in
    /// these numbers: the lowest of each such part turns from the reference as that of the component does.
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
            let rotations = placement::rotations(placed);
            work.axes.clear();
            work.axes.resize(stretch.len(), IDENTITY);
            for &root in self.frames.roots() {
                if let Some(rest) = &reference.triangles[root as usize] {
                    let component = reference.component_of(root as usize);
                    work.axes[root as usize] = times(&rotations[component], &rest_axes(rest));
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
            placement::place(reference, placed, positions);
            Ok(())
        })
    }
}
