//! The algorithms as named stages: plain arrays in, plain arrays out. `oracles/PROTOCOL.md` gives every stage's arrays.

pub mod made;
pub mod mesh;
pub mod poisson;
pub mod sequence;
pub mod shape;
pub mod signal;

use std::path::PathBuf;

use faer::{Mat, MatRef};
use thiserror::Error;

use crate::arrays::{Array, ArrayError, Bundle};
use crate::sequence::Sequence;
use crate::shape::{SpaceKind, encode_all, prepare_for};

/// One step of an algorithm.
pub struct Stage {
    /// Such as `signal.mds`.
    pub name: &'static str,
    /// What it does and where the paper says so.
    pub about: &'static str,
    /// Reads the inputs; the call that comes back is the stage's own work.
    pub prepare: fn(&Bundle) -> Result<Box<dyn Call>, StageError>,
}

/// The work of a stage on inputs already in their natural layout. `run` may be timed; `outputs` is not.
pub trait Call {
    /// Does the work once and keeps its result.
    fn run(&mut self) -> Result<(), StageError>;
    /// The last result as arrays.
    fn outputs(&self) -> Bundle;
}

/// Why a stage gave nothing.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum StageError {
    /// The inputs lack an array or have another kind of it.
    #[error(transparent)]
    Arrays(#[from] ArrayError),
    /// The algorithm refused.
    #[error("{0}")]
    Failed(String),
}

impl StageError {
    pub(crate) fn from_error(error: impl std::error::Error) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Every stage, by system and in the order of the paper.
pub fn all() -> impl Iterator<Item = &'static Stage> {
    let systems = [
        sequence::STAGES,
        mesh::STAGES,
        shape::STAGES,
        poisson::STAGES,
        signal::STAGES,
    ];
    systems.into_iter().flatten()
}

/// The stage of this name.
pub fn find(name: &str) -> Option<&'static Stage> {
    all().find(|stage| stage.name == name)
}

/// A call made of a function that works and a function that turns its result into arrays.
struct Work<T, W, O> {
    work: W,
    arrays: O,
    result: Option<T>,
}

impl<T, W, O> Call for Work<T, W, O>
where
    W: FnMut() -> Result<T, StageError>,
    O: Fn(&T) -> Bundle,
{
    fn run(&mut self) -> Result<(), StageError> {
        self.result = Some((self.work)()?);
        Ok(())
    }

    fn outputs(&self) -> Bundle {
        self.result.as_ref().map(&self.arrays).unwrap_or_default()
    }
}

fn call<T: 'static>(
    work: impl FnMut() -> Result<T, StageError> + 'static,
    arrays: impl Fn(&T) -> Bundle + 'static,
) -> Result<Box<dyn Call>, StageError> {
    Ok(Box::new(Work {
        work,
        arrays,
        result: None,
    }))
}

/// The frames of a sequence in a space whose reference is the first of them.
fn in_space(sequence: &Sequence, kind: SpaceKind) -> Result<Mat<f64>, StageError> {
    let space = prepare_for(kind, sequence.connectivity(), sequence.positions());
    let space = space.map_err(StageError::from_error)?;
    encode_all(&*space, sequence.positions()).map_err(StageError::from_error)
}

/// Inputs of a stage made from a sequence and, for `sequence.read`, the OBJ files it was read from.
///
/// Stages of an algorithm are fed the Rust results of the stages before them, so that errors do not pile up.
pub fn inputs(
    stage: &str,
    sequence: &Sequence,
    files: &[PathBuf],
    choice: &signal::Choice,
) -> Result<Bundle, StageError> {
    let d = sequence.dimension();
    let frames = MatRef::from_column_major_slice(sequence.positions(), d, sequence.frame_count());
    match stage {
        "sequence.read" => {
            let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
            Ok(Bundle::from([("paths", Array::Text(names.join("\n")))]))
        }
        "sequence.distance" => {
            let fitted = signal::at_frames(frames, choice)?;
            let shape = vec![sequence.frame_count(), d / 3, 3];
            let array = |data: Vec<f64>| Array::F64 {
                shape: shape.clone(),
                data,
            };
            let faces = sequence.connectivity().faces();
            Ok(Bundle::from([
                ("A", array(fitted)),
                ("B", array(sequence.positions().to_vec())),
                ("F", Array::triangles(faces)),
            ]))
        }
        "mesh.quality" => Ok(mesh::inputs(sequence)),
        "signal.transfer" => signal::transfer_inputs(sequence, choice),
        _ if stage.starts_with("shape.poisson_") => poisson::inputs(sequence),
        _ if stage.starts_with("shape.") => shape::inputs(stage, sequence, choice),
        _ if choice.space == SpaceKind::Vertex => signal::inputs(stage, frames, choice),
        _ => signal::inputs(stage, in_space(sequence, choice.space)?.as_ref(), choice),
    }
}
