//! Sequences that come out of the applications: a case may ask what has been made of its dataset.

use thiserror::Error;

use super::signal::Choice;
use crate::sequence::dataset::{DataFolders, DatasetError};
use crate::sequence::{Sequence, SequenceError};
use crate::shape::{ShapeError, prepare_for};
use crate::signal::in_space::{SpaceFitError, fit_in_space, sample_in_space};
use crate::signal::transfer::{TransferError, transfer_motion};

/// What is made of a dataset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Made {
    /// Nothing: it is taken as it is.
    #[default]
    Nothing,
    /// Fitted with the case's k, l and m in its space, and sampled at its frames and half-way between them (section 4.2).
    Resampled,
    /// Moved to another mesh by m + 1 examples in the case's space (section 4.3): datasets of poses of its own mesh and the same of the other.
    Transferred { examples: [String; 2] },
}

/// Why there is no such sequence.
#[derive(Debug, Error)]
pub enum MadeError {
    /// See [`DatasetError`].
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// See [`SequenceError`].
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// See [`ShapeError`].
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// See [`SpaceFitError`].
    #[error(transparent)]
    Fit(#[from] SpaceFitError),
    /// See [`TransferError`].
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// A motion of another mesh than its examples.
    #[error(
        "the dataset and the examples `{examples}` are of two meshes; expected the same faces in the same order"
    )]
    OtherMesh { examples: String },
}

/// The sequence that a case with this choice asks for.
pub fn make(
    made: &Made,
    given: Sequence,
    choice: &Choice,
    data: &DataFolders,
) -> Result<Sequence, MadeError> {
    match made {
        Made::Nothing => Ok(given),
        Made::Resampled => resampled(&given, choice),
        Made::Transferred { examples } => transferred(&given, examples, choice, data),
    }
}

fn resampled(given: &Sequence, choice: &Choice) -> Result<Sequence, MadeError> {
    let space = prepare_for(choice.space, given.connectivity(), given.positions())?;
    let found = fit_in_space(&*space, given.positions(), &choice.options())?;
    let times: Vec<f64> = (2..=2 * given.frame_count())
        .map(|i| i as f64 / 2.0)
        .collect();
    let frames = sample_in_space(&*space, &found.fit.representation, &times)?;
    let mesh = given.connectivity().clone();
    Ok(Sequence::new(mesh, times.len(), frames)?)
}

fn transferred(
    given: &Sequence,
    examples: &[String; 2],
    choice: &Choice,
    data: &DataFolders,
) -> Result<Sequence, MadeError> {
    let poses = |name: &String| data.examples(name, choice.m + 1);
    let (source, target) = (poses(&examples[0])?, poses(&examples[1])?);
    if given.connectivity() != source.connectivity() {
        return Err(MadeError::OtherMesh {
            examples: examples[0].clone(),
        });
    }
    let prepared =
        |poses: &Sequence| prepare_for(choice.space, poses.connectivity(), poses.positions());
    let (from, to) = (prepared(&source)?, prepared(&target)?);
    let moved = transfer_motion(
        given.positions(),
        [&*from, &*to],
        [source.positions(), target.positions()],
        (choice.k, choice.l),
        choice.knots,
    )?;
    let n = given.frame_count();
    let times: Vec<f64> = (1..=n).map(|i| i as f64).collect();
    let frames = sample_in_space(&*to, &moved, &times)?;
    Ok(Sequence::new(target.connectivity().clone(), n, frames)?)
}
