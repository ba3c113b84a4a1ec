//! The space of deformation gradients (Sumner & Popovic 2004): d = 9F + 3C.
//!
//! A triangle's numbers: the rotation vector of R, then S_xx, S_yy, S_zz, sqrt2 S_yz, sqrt2 S_xz, sqrt2 S_xy, so that norms are Frobenius norms.
//! After all triangles: the centre of each component over the diagonal.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::branches::Neighbours;
use super::deformation::{Deformation, LANES, Lanes};
use super::hinges::hinges;
use super::poisson::{Gradient, Poisson};
use super::reference::{Reference, check, check_len};
use super::{ShapeError, Space, SpaceKind};
use crate::linalg::kernels::vectorised;
use crate::linalg::rotation::{apply, exp, log, nearest_branch};
use crate::mesh::Connectivity;
use crate::mesh::topology::Topology;

/// Numbers of a triangle.
pub(super) const NUMBERS: usize = 9;
/// What stands for a degenerate triangle: R = S = I.
pub(super) const STILL: [f64; NUMBERS] = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
/// Triangles whose branches one thread chooses before another could begin to help.
const ALONE: usize = 1 << 14;

/// R^(9F + 3C).
#[derive(Debug)]
pub struct GradientSpace {
    reference: Reference,
    deformation: Deformation,
    poisson: Poisson,
    /// Only poses that no motion joins need it.
    neighbours: OnceLock<Neighbours>,
}

impl GradientSpace {
    /// Over a reference frame of 3V positions. Costs a sparse factorisation.
    pub fn new(connectivity: Arc<Connectivity>, reference: &[f64]) -> Result<Self, ShapeError> {
        let reference = Reference::new(connectivity, reference)?;
        Ok(Self {
            deformation: Deformation::new(&reference),
            poisson: Poisson::new(&reference)?,
            neighbours: OnceLock::new(),
            reference,
        })
    }

    /// Triangles across edges, degenerate ones left out.
    fn neighbours(&self) -> &Neighbours {
        self.neighbours.get_or_init(|| {
            let topology = Topology::new(self.reference.faces());
            let pairs = hinges(&self.reference, &topology);
            let pairs: Vec<_> = pairs
                .map(|p| [p.first.triangle, p.second.triangle])
                .collect();
            Neighbours::new(self.reference.faces().len(), pairs.iter().copied())
        })
    }

    fn triangle_numbers(&self) -> usize {
        NUMBERS * self.reference.faces().len()
    }
}

impl Space for GradientSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Gradient
    }

    fn dimension(&self) -> usize {
        self.triangle_numbers() + 3 * self.reference.components.len()
    }

    fn frame_len(&self) -> usize {
        self.reference.frame_len()
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.frame_len())?;
        check_len("z", z, self.dimension())?;
        let (triangles, centres) = z.split_at_mut(self.triangle_numbers());
        encode_triangles(
            &self.deformation,
            self.reference.faces(),
            positions,
            triangles,
        );
        self.reference.centres(positions, centres);
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension())?;
        check_len("frame", positions, self.frame_len())?;
        let (triangles, centres) = z.split_at(self.triangle_numbers());
        let triangles = triangles.as_chunks::<NUMBERS>().0;
        self.poisson.solve(
            |range, out| decode_triangles(&self.deformation, range.start, &triangles[range], out),
            positions,
        );
        self.reference.place(centres, positions);
        check("decoded frame", positions, self.frame_len())
    }

    fn unwrap(&self, previous: &[f64], z: &mut [f64]) {
        let end = self.triangle_numbers();
        if previous.len() == self.dimension() && z.len() == self.dimension() {
            unwrap_triangles(&previous[..end], &mut z[..end]);
        }
    }

    fn unwrap_over_surface(&self, z: &mut [f64]) {
        let end = self.triangle_numbers().min(z.len());
        let numbers = z[..end].as_chunks_mut::<NUMBERS>().0.iter_mut();
        let mut vectors: Vec<_> = numbers.filter_map(|z| z.first_chunk_mut::<3>()).collect();
        if vectors.len() == self.reference.faces().len() {
            self.neighbours().unwrap(&mut vectors);
        }
    }
}

/// Chooses the branches of the rotation vectors of triangles, nine numbers each, nearest to those of `previous`.
pub(super) fn unwrap_triangles(previous: &[f64], z: &mut [f64]) {
    let before = previous.par_chunks(NUMBERS * ALONE);
    let both = z.par_chunks_mut(NUMBERS * ALONE).zip(before);
    both.for_each(|(z, before)| {
        let before = before.as_chunks::<NUMBERS>().0;
        for (z, before) in z.as_chunks_mut::<NUMBERS>().0.iter_mut().zip(before) {
            let (vector, to) = (&mut z[..3], &before[..3]);
            vector.copy_from_slice(&nearest_branch(
                [vector[0], vector[1], vector[2]],
                [to[0], to[1], to[2]],
            ));
        }
    });
}

vectorised! {
    /// The nine numbers of every triangle of a frame.
    fn encode_triangles(deformation: &Deformation, faces: &[[u32; 3]], positions: &[f64], z: &mut [f64]) {
        let z = z.as_chunks_mut::<NUMBERS>().0;
        for (block, (faces, z)) in faces.chunks(LANES).zip(z.chunks_mut(LANES)).enumerate() {
            let (rotation, stretch) = deformation.block(block, faces, positions);
            let mut vectors = Lanes::<3>::ZERO;
            for lane in 0..LANES {
                vectors.set(lane, log(&rotation.matrix(lane)));
            }
            for (lane, z) in z.iter_mut().enumerate() {
                let ([x, y, w], [xx, yy, zz, yz, xz, xy]) = (vectors.get(lane), stretch.get(lane));
                *z = [x, y, w, xx, yy, zz, SQRT_2 * yz, SQRT_2 * xz, SQRT_2 * xy];
            }
            for (face, z) in deformation.degenerate(block, faces.len()).zip(z) {
                if face {
                    *z = STILL;
                }
            }
        }
    }
}

vectorised! {
    /// The gradients of triangles from `first` on, a multiple of the lanes.
    pub(super) fn decode_triangles(deformation: &Deformation, first: usize, z: &[[f64; NUMBERS]], out: &mut [Gradient]) {
        for (block, (z, out)) in z.chunks(LANES).zip(out.chunks_mut(LANES)).enumerate() {
            let mut numbers = Lanes::<NUMBERS>::ZERO;
            for (lane, z) in z.iter().enumerate() {
                numbers.set(lane, *z);
            }
            let (u, v) = deformation.axes(first / LANES + block);
            let (mut along_u, mut along_v) = (Lanes::<3>::ZERO, Lanes::<3>::ZERO);
            for lane in 0..LANES {
                let [x, y, w, stretch @ ..] = numbers.get(lane);
                let rotation = exp([x, y, w]);
                along_u.set(lane, apply(&rotation, stretched(stretch, u.get(lane))));
                along_v.set(lane, apply(&rotation, stretched(stretch, v.get(lane))));
            }
            for (lane, out) in out.iter_mut().enumerate() {
                *out = [along_u.get(lane), along_v.get(lane)];
            }
        }
    }
}

/// S x, from the six numbers of S.
#[inline(always)]
pub(super) fn stretched([xx, yy, zz, yz, xz, xy]: [f64; 6], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let (yz, xz, xy) = (FRAC_1_SQRT_2 * yz, FRAC_1_SQRT_2 * xz, FRAC_1_SQRT_2 * xy);
    [
        xx * x + xy * y + xz * z,
        xy * x + yy * y + yz * z,
        xz * x + yz * y + zz * z,
    ]
}
