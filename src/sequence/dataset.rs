//! Sequences by name: `@name` is embedded, a path is a file or folder, and any other name is a folder of real data.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::format::stream::FrameStream;
use super::format::{FormatError, frame_files, read, stream};
use super::synthetic::{SyntheticError, embedded, stream_embedded};
use super::{Sequence, SequenceError};

/// Why there is no such sequence.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// Real data that is not on this machine.
    #[error(
        "no data for `{name}`: looked for {}; name the folder that holds it with --data or MESHSEQ_DATA",
        .looked_in.join(", ")
    )]
    Absent {
        name: String,
        looked_in: Vec<String>,
    },
    /// See [`SyntheticError`].
    #[error(transparent)]
    Synthetic(#[from] SyntheticError),
    /// See [`FormatError`].
    #[error(transparent)]
    Format(#[from] FormatError),
    /// A reference pose of another mesh than the poses. See [`SequenceError`].
    #[error(transparent)]
    Sequence(#[from] SequenceError),
}

/// The folder of real data with a reference pose `NAME.obj` for poses `NAME`.
const REST: &str = "rest-poses";

/// Where real data may lie.
#[derive(Clone, Debug, Default)]
pub struct DataFolders(pub Vec<PathBuf>);

impl DataFolders {
    /// The folder given, or else the one that `MESHSEQ_DATA` names.
    pub fn new(given: Option<&Path>) -> Self {
        let named = std::env::var_os("MESHSEQ_DATA").map(PathBuf::from);
        Self(given.map(Path::to_owned).or(named).into_iter().collect())
    }

    /// The sequence of a case's dataset name.
    pub fn sequence(&self, name: &str) -> Result<Sequence, DatasetError> {
        if name.starts_with('@') {
            return Ok(embedded(name)?);
        }
        Ok(read(&self.folder(name)?)?)
    }

    /// The OBJ files of a dataset of real data.
    pub fn files(&self, name: &str) -> Result<Vec<PathBuf>, DatasetError> {
        Ok(frame_files(&self.folder(name)?)?)
    }

    /// The first poses of a dataset as examples, `count` of them or all: the reference pose of real ones, where there is one, comes first.
    pub fn examples(&self, name: &str, count: usize) -> Result<Sequence, DatasetError> {
        let poses = self.sequence(name)?;
        let file = format!("{name}.obj");
        let rest = match self.files(REST) {
            _ if name.starts_with('@') => Vec::new(),
            Err(DatasetError::Absent { .. }) => Vec::new(),
            found => found?,
        };
        let mut positions = match rest.iter().find(|path| path.ends_with(&file)) {
            Some(path) => read(path)?.positions().to_vec(),
            None => Vec::new(),
        };
        positions.extend(poses.positions());
        positions.truncate(count * poses.dimension());
        let frames = positions.len() / poses.dimension();
        let mesh = poses.connectivity().clone();
        Ok(Sequence::new(mesh, frames, positions)?)
    }

    fn folder(&self, name: &str) -> Result<PathBuf, DatasetError> {
        let places: Vec<PathBuf> = self.0.iter().map(|folder| folder.join(name)).collect();
        let found = places.iter().find(|place| place.exists()).cloned();
        found.ok_or_else(|| DatasetError::Absent {
            name: name.into(),
            looked_in: match places.is_empty() {
                true => vec!["nowhere (no data folder is named)".into()],
                false => places.iter().map(|p| p.display().to_string()).collect(),
            },
        })
    }
}

/// Opens what [`open`] reads, to be read some frames at a time.
pub fn open_stream(argument: &str) -> Result<FrameStream, DatasetError> {
    if argument.starts_with('@') {
        return Ok(stream_embedded(argument)?);
    }
    Ok(stream(Path::new(argument))?)
}

/// A sequence that a user names on the command line: `@name`, or a path.
pub fn open(argument: &str) -> Result<Sequence, DatasetError> {
    if argument.starts_with('@') {
        return Ok(embedded(argument)?);
    }
    Ok(read(Path::new(argument))?)
}
