//! Shape spaces: a frame as a vector of numbers other than its positions, and back (Cashman & Hormann 2012, section 5).
//!
//! Everything of a space is over one connectivity and one *reference* frame. `oracles/PROTOCOL.md` lays down the numbers of each, their order, units
//! and signs, and the rules for degenerate triangles, several components, boundaries and edges that are not manifold.
//!
//! | space | d | what its numbers are |
//! |---|---|---|
//! | [`vertex`] | 3V | positions |
//! | [`gradient`] | 9F + 3C | rotation vector and stretch of every triangle's deformation gradient, centres of components |
//! | [`lric`] | 3E + 6C | stretches of triangles, dihedral angles of edges, rotations and centres of components |
//! | [`lengths`] | 2E + 6C | lengths and dihedral angles of edges, rotations and centres of components |
//! | [`patch`] | 9F + 3A + 6C | gradients against the mean rotations of patches, those against adjacent ones, rotations and centres of components |

pub mod branches;
mod deformation;
pub mod edge_layout;
pub mod frames;
pub mod gradient;
pub mod halfway;
pub mod hinges;
pub mod lengths;
pub mod lric;
pub mod partition;
pub mod patch;
pub mod patches;
pub mod placement;
pub mod poisson;
mod pool;
pub mod posed;
pub mod reference;
pub mod shell;
pub mod surface;
#[cfg(test)]
mod tests;
pub mod vertex;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use faer::{Mat, MatRef};
use rayon::prelude::*;
use thiserror::Error;

use self::partition::PatchError;
use self::shell::Descent;
use crate::linalg::dense::columns_mut;
use crate::linalg::sparse::FactorError;
use crate::mesh::Connectivity;

/// Diagonals of the bounding box of a reference that is no point.
pub(crate) const DIAGONALS: [f64; 2] = [1e-50, 1e50];

/// Which space.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SpaceKind {
    /// Positions.
    Vertex,
    /// Deformation gradients (Sumner & Popovic 2004).
    Gradient,
    /// Linear rotation-invariant coordinates (Lipman et al. 2005).
    Lric,
    /// Edge lengths and dihedral angles (Winkler et al. 2010, Froehlich & Botsch 2011).
    Lengths,
    /// Patch-based rotation-invariant coordinates (Baran et al. 2009).
    Patch,
}

impl SpaceKind {
    /// Every space, in the order of the paper.
    pub const ALL: [Self; 5] = [
        Self::Vertex,
        Self::Gradient,
        Self::Lric,
        Self::Lengths,
        Self::Patch,
    ];

    /// Its name on the command line and in stages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vertex => "vertex",
            Self::Gradient => "gradient",
            Self::Lric => "lric",
            Self::Lengths => "lengths",
            Self::Patch => "patch",
        }
    }
}

impl fmt::Display for SpaceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no space has.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no shape space `{0}`; there are vertex, gradient, lric, lengths and patch")]
pub struct UnknownSpace(String);

impl FromStr for SpaceKind {
    type Err = UnknownSpace;

    fn from_str(name: &str) -> Result<Self, UnknownSpace> {
        let mut all = Self::ALL.into_iter();
        all.find(|kind| kind.name() == name)
            .ok_or_else(|| UnknownSpace(name.into()))
    }
}

/// Why a shape space, a vector in it or a frame could not be had.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ShapeError {
    /// A frame or vector of another size than the space's.
    #[error(
        "{what}: expected {expected} numbers, found {found}; is it of the connectivity and reference of this space?"
    )]
    WrongLength {
        what: &'static str,
        expected: usize,
        found: usize,
    },
    /// NaN or infinite.
    #[error("{what}: number {index} (0-based) is not finite")]
    NotFinite { what: &'static str, index: usize },
    /// Coordinates whose squares are no numbers.
    #[error(
        "{what}: the bounding box has a diagonal of {diagonal:e}, expected one from {:e} to {:e}, so that areas and their squares can be told; scale the frames",
        DIAGONALS[0], DIAGONALS[1]
    )]
    Magnitude { what: &'static str, diagonal: f64 },
    /// See [`FactorError`].
    #[error("the equations of the space cannot be solved: {0}")]
    Factor(#[from] FactorError),
    /// See [`PatchError`].
    #[error(transparent)]
    Patch(#[from] PatchError),
    /// What is wrong with one of several frames.
    #[error("frame {frame} (1-based): {source}")]
    Frame {
        frame: usize,
        source: Box<ShapeError>,
    },
}

/// A shape space over one connectivity and reference.
///
/// Positions are x0 y0 z0 x1 ... (3V numbers), vectors z have d numbers. Spaces keep the factors that depend on the reference alone; both directions run
/// on the calling thread, and frames are best taken in parallel, as [`encode_all`] does.
pub trait Space: Send + Sync {
    /// Which space.
    fn kind(&self) -> SpaceKind;

    /// d.
    fn dimension(&self) -> usize;

    /// 3V, the numbers of a frame.
    fn frame_len(&self) -> usize;

    /// The vector of a frame, with angles in their principal branches.
    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError>;

    /// The frame of a vector. Costs sparse solves with the factors kept; of a vector of no frame (a mean of two, say), whose angles do not agree with each other,
    /// also a factorisation in [`lric`] (3F unknowns) and [`patch`] (3 a patch), and in [`lengths`] one for each step of a descent.
    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError>;

    /// [`Self::decode`], and how it ended where it is a descent, as in [`lengths`].
    fn decode_telling(
        &self,
        z: &[f64],
        positions: &mut [f64],
    ) -> Result<Option<Descent>, ShapeError> {
        self.decode(z, positions).map(|()| None)
    }

    /// Chooses the branches of the angles in `z` nearest to those in `previous`, such as the frame before. Nothing where there are no angles.
    fn unwrap(&self, _previous: &[f64], _z: &mut [f64]) {}

    /// Chooses the branches of the angles in `z` so that they change least from place to place on the surface: for poses that no motion joins.
    fn unwrap_over_surface(&self, _z: &mut [f64]) {}
}

/// Prepares a space over a connectivity and a reference frame of 3V positions. Costs the sparse factorisation of V unknowns that the space decodes with (none in
/// [`vertex`]) and the analysis of those that vectors of no frame need.
///
/// `patches` is the patch of each triangle, see [`patches::choose`]; only the space of patches looks at it, the others may be given none.
pub fn prepare(
    kind: SpaceKind,
    connectivity: Arc<Connectivity>,
    reference: &[f64],
    patches: &[i64],
) -> Result<Box<dyn Space>, ShapeError> {
    Ok(match kind {
        SpaceKind::Vertex => Box::new(vertex::VertexSpace::new(connectivity.vertex_count())),
        SpaceKind::Gradient => Box::new(gradient::GradientSpace::new(connectivity, reference)?),
        SpaceKind::Lric => Box::new(lric::LricSpace::new(connectivity, reference)?),
        SpaceKind::Lengths => Box::new(lengths::LengthsSpace::new(connectivity, reference)?),
        SpaceKind::Patch => Box::new(patch::PatchSpace::new(connectivity, reference, patches)?),
    })
}

/// Prepares a space over the first of these frames (3V positions each), with patches found from all of them where the space has some.
pub fn prepare_for(
    kind: SpaceKind,
    connectivity: &Arc<Connectivity>,
    frames: &[f64],
) -> Result<Box<dyn Space>, ShapeError> {
    let len = 3 * connectivity.vertex_count();
    let reference = frames.get(..len).unwrap_or(frames);
    let patches = patches_for(kind, connectivity, reference, frames)?;
    prepare(kind, connectivity.clone(), reference, &patches)
}

/// The patches that [`prepare`] wants for this space, found from these frames; none for spaces that have none.
pub fn patches_for(
    kind: SpaceKind,
    connectivity: &Arc<Connectivity>,
    reference: &[f64],
    frames: &[f64],
) -> Result<Vec<i64>, ShapeError> {
    match kind {
        SpaceKind::Patch => patches::choose(connectivity.clone(), reference, frames),
        _ => Ok(Vec::new()),
    }
}

/// The vectors of n frames (n x 3V positions, frame after frame) as the columns of a d x n matrix. Frames run in parallel, then branches are
/// chosen; the result does not depend on the number of threads.
pub fn encode_all(space: &dyn Space, frames: &[f64]) -> Result<Mat<f64>, ShapeError> {
    let mut z = encode_each(space, frames)?;
    let mut columns = columns_mut(z.as_mut());
    for i in 1..columns.len() {
        let (before, after) = columns.split_at_mut(i);
        space.unwrap(before[i - 1], after[0]);
    }
    Ok(z)
}

/// The same for examples, of which the first shows a reference pose: branches are those nearest to it, or where a space has rotations at triangles those that
/// [`Space::unwrap_over_surface`] chooses.
pub fn encode_examples(space: &dyn Space, frames: &[f64]) -> Result<Mat<f64>, ShapeError> {
    let mut z = encode_each(space, frames)?;
    if let Some((first, others)) = columns_mut(z.as_mut()).split_first_mut() {
        others.par_iter_mut().for_each(|z| {
            space.unwrap(first, z);
            space.unwrap_over_surface(z);
        });
    }
    Ok(z)
}

/// Every frame's vector on its own, with angles in their principal branches.
fn encode_each(space: &dyn Space, frames: &[f64]) -> Result<Mat<f64>, ShapeError> {
    let len = space.frame_len().max(1);
    let n = frames.len() / len;
    reference::check_len("frames", frames, n * len)?;
    let mut z = Mat::zeros(space.dimension(), n);
    let mut columns = columns_mut(z.as_mut());
    let both = columns.par_iter_mut().zip(frames.par_chunks_exact(len));
    first_error(
        both.enumerate()
            .map(|(i, (z, frame))| space.encode(frame, z).map_err(|e| e.of_frame(i))),
    )?;
    Ok(z)
}

/// How decoded frames ended where decoding is a descent; all 0 where it is not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Convergence {
    /// How many frames were descended to.
    pub frames: usize,
    /// How many of them are no stationary frame, see [`Descent::is_stationary`].
    pub unsettled: usize,
    /// The greatest [`Descent::imbalance`].
    pub imbalance: f64,
}

impl Convergence {
    fn of(descents: impl Iterator<Item = Descent>) -> Self {
        descents.fold(Self::default(), |all, descent| Self {
            frames: all.frames + 1,
            unsettled: all.unsettled + usize::from(!descent.is_stationary()),
            imbalance: all.imbalance.max(descent.imbalance),
        })
    }
}

/// The frames (n x 3V positions) of the columns of a d x n matrix, in parallel.
pub fn decode_all(space: &dyn Space, z: MatRef<'_, f64>) -> Result<Vec<f64>, ShapeError> {
    Ok(decode_all_telling(space, z)?.0)
}

/// [`decode_all`], and how it converged.
pub fn decode_all_telling(
    space: &dyn Space,
    z: MatRef<'_, f64>,
) -> Result<(Vec<f64>, Convergence), ShapeError> {
    let len = space.frame_len();
    let mut frames = vec![0.0; len * z.ncols()];
    let outcomes = frames
        .par_chunks_exact_mut(len.max(1))
        .enumerate()
        .map(|(i, frame)| {
            let column = z.col(i);
            let decoded = match column.try_as_col_major() {
                Some(column) => space.decode_telling(column.as_slice(), frame),
                None => space.decode_telling(&column.iter().copied().collect::<Vec<_>>(), frame),
            };
            decoded.map_err(|e| e.of_frame(i))
        });
    let descents = first_error(outcomes)?.into_iter().flatten();
    Ok((frames, Convergence::of(descents)))
}

impl ShapeError {
    /// The same, of frame `index` (0-based).
    fn of_frame(self, index: usize) -> Self {
        Self::Frame {
            frame: index + 1,
            source: Box::new(self),
        }
    }
}

/// The error of the lowest index, so that it does not depend on which thread is the fastest.
fn first_error<T: Send>(
    outcomes: impl IndexedParallelIterator<Item = Result<T, ShapeError>>,
) -> Result<Vec<T>, ShapeError> {
    outcomes.collect::<Vec<_>>().into_iter().collect()
}
