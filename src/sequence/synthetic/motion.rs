//! Motions without an end, whose frames are made one by one.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;

use super::SyntheticError;
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
use crate::sequence::format::FormatError;
use crate::sequence::format::stream::{FrameStream, Source};

/// A mesh that moves, given in closed form at every frame.
pub(super) struct Motion {
    connectivity: Arc<Connectivity>,
    points: Box<dyn Fn(usize) -> Vec<Vector3<f64>>>,
}

impl Motion {
    /// `points` gives the V vertices at a 0-based frame.
    pub(super) fn new(
        faces: &[[u32; 3]],
        points: impl Fn(usize) -> Vec<Vector3<f64>> + 'static,
    ) -> Result<Self, SyntheticError> {
        let vertices = points(0).len();
        Ok(Self {
            connectivity: Arc::new(Connectivity::new(vertices, faces.to_vec())?),
            points: Box::new(points),
        })
    }

    /// Its first frames.
    pub(super) fn sequence(&self, frames: usize) -> Result<Sequence, SyntheticError> {
        let positions = self.positions(0, frames);
        let connectivity = self.connectivity.clone();
        Ok(Sequence::new(connectivity, frames, positions)?)
    }

    /// Its first frames, to be made some at a time; `path` is what it is called.
    pub(super) fn stream(self, path: &Path, frames: usize) -> Result<FrameStream, SyntheticError> {
        let stream = FrameStream::new(path, self.connectivity.clone(), frames, Box::new(self));
        stream.map_err(|_| SyntheticError::NoFrames)
    }

    fn positions(&self, first: usize, count: usize) -> Vec<f64> {
        let frames = (first..first + count).flat_map(|i| (self.points)(i));
        frames.flat_map(|p| [p.x, p.y, p.z]).collect()
    }
}

impl Source for Motion {
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError> {
        Ok(self.positions(first, count))
    }
}
