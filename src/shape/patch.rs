//! Patch-based rotation-invariant coordinates (Baran et al. 2009): d = 9F + 3A + 6C, A the number of adjacent patches.
//!
//! A patch turns by R_p, the rotation nearest to the sum over its triangles of A_f R_f (areas of the reference; R_f, S_f as in [`super::gradient`]). A triangle's nine
//! numbers: the rotation vector of R_p^T R_f, then S_f as in the gradient space. Then the rotation vector of R_p^T R_q for every adjacent pair p < q, in ascending order;
//! then six numbers of each component: the rotation vector of R_p of its lowest patch and its centre over the diagonal (zeros and the centre for a vertex by itself).
//! Decoding finds the R_p from the pairs ([`super::frames`]), then T_f = R_p exp(.) S_f and the positions as in the gradient space. Degenerate triangles: as there.

use std::f64::consts::SQRT_2;
use std::ops::Range;
use std::sync::Arc;

use super::deformation::{Deformation, LANES, Lanes};
use super::frames::Frames;
use super::gradient::{NUMBERS, STILL, decode_triangles, unwrap_triangles};
use super::partition::Partition;
use super::placement;
use super::poisson::{Gradient, Poisson};
use super::pool::Pool;
use super::reference::{Reference, check, check_len};
use super::{ShapeError, Space, SpaceKind};
use crate::linalg::kernels::vectorised;
use crate::linalg::rotation::{
    IDENTITY, Matrix, apply, exp, log, nearest_branch, nearest_rotation, transposed_times,
};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;

/// Numbers of an adjacent pair.
const PAIR: usize = 3;

/// R^(9F + 3A + 6C).
#[derive(Debug)]
pub struct PatchSpace {
    reference: Reference,
    deformation: Deformation,
    poisson: Poisson,
    partition: Partition,
    /// Areas in the reference, F; 0 for degenerate triangles.
    areas: Vec<f64>,
    /// The lowest patch of each component; none for a vertex by itself.
    lowest: Vec<Option<u32>>,
    frames: Frames,
    work: Pool<Work>,
}

#[derive(Debug, Default)]
struct Work {
    /// R_f, in blocks of lanes.
    turns: Vec<Lanes<9>>,
    /// R_p, and one more for degenerate triangles.
    patches: Vec<Matrix>,
    /// R_p^T R_q.
    relative: Vec<Matrix>,
}

impl PatchSpace {
    /// Over a reference frame of 3V positions and labels, one a triangle. Costs a sparse factorisation.
    pub fn new(
        connectivity: Arc<Connectivity>,
        reference: &[f64],
        labels: &[i64],
    ) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        let topology = Topology::new(reference.faces());
        let partition = Partition::new(&reference, &topology, labels)?;
        let mut lowest = vec![None; reference.components.len()];
        for (patch, &component) in partition.components.iter().enumerate() {
            lowest[component as usize].get_or_insert(patch as u32);
        }
        Ok(Self {
            deformation: Deformation::new(&reference),
            poisson: Poisson::new(&reference)?,
            areas: reference.area_shares(),
            frames: Frames::new(partition.patches(), partition.pairs.clone())?,
            lowest,
            partition,
            reference,
            work: Pool::default(),
        })
    }

    /// P.
    pub fn patches(&self) -> usize {
        self.partition.patches()
    }

    fn triangle_numbers(&self) -> usize {
        NUMBERS * self.reference.faces().len()
    }

    /// Where the numbers of pairs are.
    fn pair_numbers(&self) -> Range<usize> {
        let start = self.triangle_numbers();
        start..start + PAIR * self.partition.pairs.len()
    }

    /// R_p of every patch from the R_f.
    fn turn_patches(&self, work: &mut Work) {
        work.patches.clear();
        work.patches.resize(self.patches() + 1, [[0.0; 3]; 3]);
        let blocks = self
            .partition
            .labels
            .chunks(LANES)
            .zip(self.areas.chunks(LANES));
        for ((labels, areas), turns) in blocks.zip(&work.turns) {
            for (lane, (&label, area)) in labels.iter().zip(areas).enumerate() {
                let sum = work.patches[label as usize].as_flattened_mut();
                let turn = turns.get(lane);
                sum.iter_mut()
                    .zip(turn)
                    .for_each(|(sum, x)| *sum += area * x);
            }
        }
        let (patches, degenerate) = work.patches.split_at_mut(self.patches());
        patches
            .iter_mut()
            .for_each(|sum| *sum = nearest_rotation(sum));
        degenerate.fill(IDENTITY);
    }

    /// R_p of every patch from the pairs and the components. Patches that no chain of pairs joins to the lowest of their component have no rotation of their own in these
    /// numbers: the lowest of each such part turns as the component does.
    fn solve_patches(&self, z: &[f64], work: &mut Work) -> Result<(), ShapeError> {
        let components = placement::rotations(&z[self.pair_numbers().end..]);
        work.patches.clear();
        work.patches.resize(self.patches() + 1, IDENTITY);
        for &root in self.frames.roots() {
            let component = self.partition.components[root as usize];
            work.patches[root as usize] = components[component as usize];
        }
        let vectors = z[self.pair_numbers()].as_chunks::<PAIR>().0;
        work.relative.clear();
        work.relative.extend(vectors.iter().map(|&v| exp(v)));
        self.frames
            .solve(&work.relative, &mut work.patches[..self.patches()])
    }

    /// The gradients of these triangles.
    fn gradients(&self, patches: &[Matrix], range: Range<usize>, z: &[f64], out: &mut [Gradient]) {
        let triangles = z[..self.triangle_numbers()].as_chunks::<NUMBERS>().0;
        decode_triangles(
            &self.deformation,
            range.start,
            &triangles[range.clone()],
            out,
        );
        for (out, &label) in out.iter_mut().zip(&self.partition.labels[range]) {
            *out = out.map(|image| apply(&patches[label as usize], image));
        }
    }
}

impl Space for PatchSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Patch
    }

    fn dimension(&self) -> usize {
        self.pair_numbers().end + placement::NUMBERS * self.reference.components.len()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (triangles, rest) = z.split_at_mut(self.triangle_numbers());
        let (pairs, placed) = rest.split_at_mut(self.pair_numbers().len());
        self.work.lend(|work| {
            let faces = self.reference.faces();
            work.turns.resize(faces.len().div_ceil(LANES), Lanes::ZERO);
            measure_triangles(
                &self.deformation,
                faces,
                positions,
                &mut work.turns,
                triangles,
            );
            self.turn_patches(work);
            let labels = &self.partition.labels;
            relate_triangles(
                &self.deformation,
                labels,
                &work.patches,
                &work.turns,
                triangles,
            );
            let patch = |p: u32| &work.patches[p as usize];
            for (z, &[p, q]) in pairs
                .as_chunks_mut::<PAIR>()
                .0
                .iter_mut()
                .zip(&self.partition.pairs)
            {
                *z = log(&transposed_times(patch(p), patch(q)));
            }
            let turns = self.lowest.iter().map(|lowest| lowest.map(|p| *patch(p)));
            placement::encode_turned(&self.reference, positions, turns, placed);
        });
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        self.work.lend(|work| {
            self.solve_patches(z, work)?;
            let fill = |range: Range<usize>, out: &mut [Gradient]| {
                self.gradients(&work.patches, range, z, out)
            };
            self.poisson.solve(fill, positions);
            placement::place(&self.reference, &z[self.pair_numbers().end..], positions);
            Ok(())
        })
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        if previous.len() != self.dimension() || z.len() != self.dimension() {
            return;
        }
        let Range { start, end } = self.pair_numbers();
        unwrap_triangles(&previous[..start], &mut z[..start]);
        let before = previous[start..end].as_chunks::<PAIR>().0;
        for (z, &before) in z[start..end]
            .as_chunks_mut::<PAIR>()
            .0
            .iter_mut()
            .zip(before)
        {
            *z = nearest_branch(*z, before);
        }
        placement::unwrap(&previous[end..], &mut z[end..]);
    }
}

vectorised! {
    /// The rotations of all triangles, in blocks, and the stretches among their nine numbers.
    fn measure_triangles(deformation: &Deformation, faces: &[[u32; 3]], positions: &[f64], turns: &mut [Lanes<9>], z: &mut [f64]) {
        let blocks = faces.chunks(LANES).zip(z.as_chunks_mut::<NUMBERS>().0.chunks_mut(LANES));
        for (block, ((faces, z), turns)) in blocks.zip(turns).enumerate() {
            let (rotation, stretch) = deformation.block(block, faces, positions);
            *turns = rotation;
            for (lane, z) in z.iter_mut().enumerate() {
                let [xx, yy, zz, yz, xz, xy] = stretch.get(lane);
                z[3..].copy_from_slice(&[xx, yy, zz, SQRT_2 * yz, SQRT_2 * xz, SQRT_2 * xy]);
            }
        }
    }
}

vectorised! {
    /// The rotation vectors among the nine numbers of all triangles, and what stands for degenerate ones.
    fn relate_triangles(deformation: &Deformation, labels: &[u32], patches: &[Matrix], turns: &[Lanes<9>], z: &mut [f64]) {
        let blocks = labels.chunks(LANES).zip(z.as_chunks_mut::<NUMBERS>().0.chunks_mut(LANES));
        for (block, ((labels, z), turns)) in blocks.zip(turns).enumerate() {
            let mut patch = Lanes::<9>::ZERO;
            for (lane, &label) in labels.iter().enumerate() {
                let [[a, b, c], [d, e, f], [g, h, i]] = patches[label as usize];
                patch.set(lane, [a, b, c, d, e, f, g, h, i]);
            }
            let mut vectors = Lanes::<3>::ZERO;
            for lane in 0..LANES {
                vectors.set(lane, log(&transposed_times(&patch.matrix(lane), &turns.matrix(lane))));
            }
            for (lane, z) in z.iter_mut().enumerate() {
                z[..3].copy_from_slice(&vectors.get(lane));
            }
            for (face, z) in deformation.degenerate(block, labels.len()).zip(z) {
                if face {
                    *z = STILL;
                }
            }
        }
    }
}
