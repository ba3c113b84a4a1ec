//! Sequences read some frames at a time, so that memory holds only those.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::FormatError;
use crate::mesh::Connectivity;
use crate::sequence::{Sequence, SequenceError, first_not_finite};

/// Where frames come from.
pub trait Source {
    /// n x 3V positions of `count` frames from the 0-based frame `first` on. Frames are asked for in ascending order, each at most once, and all exist.
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError>;
}

/// n frames over one connectivity that are read one after another.
///
/// From OBJ files, `.npz`, `.pc2` and embedded motions in closed form memory holds what has been asked for, and nothing of the frames before.
pub struct FrameStream {
    path: PathBuf,
    connectivity: Arc<Connectivity>,
    /// The 0-based frames of the source, in ascending order.
    frames: Vec<usize>,
    at: usize,
    source: Box<dyn Source>,
}

impl FrameStream {
    /// All `frames` of a source; `path` is what errors name. At least one frame and one vertex.
    pub fn new(
        path: &Path,
        connectivity: Arc<Connectivity>,
        frames: usize,
        source: Box<dyn Source>,
    ) -> Result<Self, FormatError> {
        let wrong = match (frames, connectivity.vertex_count()) {
            (0, _) => Some(SequenceError::NoFrames),
            (_, 0) => Some(SequenceError::NoVertices),
            _ => None,
        };
        let path = path.to_path_buf();
        match wrong {
            Some(source) => Err(FormatError::Sequence { path, source }),
            None => Ok(Self {
                path,
                connectivity,
                frames: (0..frames).collect(),
                at: 0,
                source,
            }),
        }
    }

    /// A sequence that is in memory already.
    pub fn held(path: &Path, sequence: Sequence) -> Self {
        Self {
            path: path.to_path_buf(),
            connectivity: sequence.connectivity().clone(),
            frames: (0..sequence.frame_count()).collect(),
            at: 0,
            source: Box::new(Held(sequence)),
        }
    }

    /// Only the frames at these 0-based indices, which must ascend; None where they do not, where one does not exist or where there are none.
    pub fn select(mut self, indices: &[usize]) -> Option<Self> {
        let ascend = indices.windows(2).all(|pair| pair[0] < pair[1]);
        let last = indices.last()?;
        if !ascend || *last >= self.frames.len() || self.at > 0 {
            return None;
        }
        self.frames = indices.iter().map(|&i| self.frames[i]).collect();
        Some(self)
    }

    /// The connectivity that all frames share.
    pub fn connectivity(&self) -> &Arc<Connectivity> {
        &self.connectivity
    }

    /// Number of frames n, of which some may have been read.
    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// d = 3V, the numbers in one frame.
    pub fn dimension(&self) -> usize {
        self.connectivity.vertex_count() * 3
    }

    /// The next `count` frames, or as many as are left: 3V finite positions each.
    pub fn read(&mut self, count: usize) -> Result<Vec<f64>, FormatError> {
        let end = self.at.saturating_add(count).min(self.frames.len());
        let wanted = &self.frames[self.at..end];
        let d = self.connectivity.vertex_count() * 3;
        let mut positions = Vec::new();
        // Frames that follow each other are read together.
        for run in wanted.chunk_by(|a, b| a + 1 == *b) {
            let found = self.source.read(run[0], run.len())?;
            if let Some(source) = first_not_finite(&found, d, run[0]) {
                let path = self.path.clone();
                return Err(FormatError::Sequence { path, source });
            }
            match positions.is_empty() {
                true => positions = found,
                false => positions.extend(found),
            }
        }
        self.at = end;
        Ok(positions)
    }
}

/// A sequence in memory as a source.
struct Held(Sequence);

impl Source for Held {
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError> {
        let d = self.0.dimension();
        Ok(self.0.positions()[first * d..(first + count) * d].to_vec())
    }
}

#[cfg(test)]
mod tests {
    use crate::sequence::dataset::{open, open_stream};
    use crate::sequence::format::write;

    #[test]
    fn streams_give_the_frames_of_whole_sequences() {
        let sequence = open("@gallop-small").unwrap();
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.npz", "a.pc2", "frames", "@gallop-small", "@roam-small"] {
            let place = folder.path().join(name);
            let place = match name.starts_with('@') {
                true => name.to_owned(),
                false => {
                    write(&sequence, &place).unwrap();
                    place.to_str().unwrap().to_owned()
                }
            };
            let whole = open(&place).unwrap();
            let n = whole.frame_count();
            let mut stream = open_stream(&place).unwrap();
            assert_eq!(stream.frame_count(), n);
            assert_eq!(stream.connectivity(), whole.connectivity());
            let mut positions = stream.read(5).unwrap();
            positions.extend(stream.read(0).unwrap());
            positions.extend(stream.read(1).unwrap());
            positions.extend(stream.read(usize::MAX).unwrap());
            assert_eq!(positions, whole.positions(), "{name}");
            assert!(stream.read(1).unwrap().is_empty());
            let some = [0, 3, 4, 9, n - 1];
            let mut stream = open_stream(&place).unwrap().select(&some).unwrap();
            let mut positions = stream.read(3).unwrap();
            positions.extend(stream.read(3).unwrap());
            assert_eq!(positions, whole.select(&some).unwrap().positions());
        }
        let bad = [&[][..], &[3, 3], &[4, 1], &[0, 24]];
        for indices in bad {
            let stream = open_stream("@gallop-small").unwrap();
            assert!(stream.select(indices).is_none(), "{indices:?}");
        }
    }
}
