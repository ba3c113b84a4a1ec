//! Deforming mesh sequences: n frames over one connectivity.

pub mod dataset;
pub mod format;
pub mod synthetic;

use std::sync::Arc;

use thiserror::Error;

use crate::mesh::Connectivity;

/// n frames of V vertices over one connectivity; positions are f64 and contiguous, frame after frame.
///
/// Frame `i` is `x0 y0 z0 x1 y1 z1 ...`, the stacking of the vertex shape space (Cashman & Hormann 2012, section 5), so the positions are
/// the n x d matrix of frames, row-major, with d = 3V. Every position is finite.
#[derive(Clone, Debug)]
pub struct Sequence {
    connectivity: Arc<Connectivity>,
    frames: usize,
    positions: Vec<f64>,
}

/// Why positions and a connectivity do not make a sequence.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum SequenceError {
    /// No frames at all.
    #[error("a sequence needs at least one frame, found none")]
    NoFrames,
    /// A mesh without vertices.
    #[error("a sequence needs at least one vertex, found none")]
    NoVertices,
    /// The number of coordinates is not a whole number of frames.
    #[error(
        "expected {expected} coordinates ({frames} frames of {vertices} vertices), found {found}"
    )]
    WrongLength {
        frames: usize,
        vertices: usize,
        expected: usize,
        found: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error(
        "frame {frame} (1-based), vertex {vertex} (0-based), coordinate {axis}: found {value}, expected a finite number"
    )]
    NotFinite {
        frame: usize,
        vertex: usize,
        axis: char,
        value: f64,
    },
}

/// The first coordinate that is not finite, in frames of d numbers each of which the first is number `from` (0-based).
fn first_not_finite(positions: &[f64], d: usize, from: usize) -> Option<SequenceError> {
    let at = positions.iter().position(|x| !x.is_finite())?;
    Some(SequenceError::NotFinite {
        frame: from + at / d + 1,
        vertex: at % d / 3,
        axis: ['x', 'y', 'z'][at % 3],
        value: positions[at],
    })
}

impl Sequence {
    /// Takes n x 3V positions, frame-major. Costs one pass to see that all are finite.
    pub fn new(
        connectivity: Arc<Connectivity>,
        frames: usize,
        positions: Vec<f64>,
    ) -> Result<Self, SequenceError> {
        let vertices = connectivity.vertex_count();
        if frames == 0 {
            return Err(SequenceError::NoFrames);
        }
        if vertices == 0 {
            return Err(SequenceError::NoVertices);
        }
        let expected = frames * vertices * 3;
        if positions.len() != expected {
            return Err(SequenceError::WrongLength {
                frames,
                vertices,
                expected,
                found: positions.len(),
            });
        }
        if let Some(wrong) = first_not_finite(&positions, vertices * 3, 0) {
            return Err(wrong);
        }
        Ok(Self {
            connectivity,
            frames,
            positions,
        })
    }

    /// The connectivity that all frames share.
    pub fn connectivity(&self) -> &Arc<Connectivity> {
        &self.connectivity
    }

    /// Number of frames n.
    pub fn frame_count(&self) -> usize {
        self.frames
    }

    /// d = 3V, the numbers in one frame.
    pub fn dimension(&self) -> usize {
        self.connectivity.vertex_count() * 3
    }

    /// All positions, n x d row-major.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// The d numbers of frame `index` (0-based); panics when there is no such frame, as a slice does.
    pub fn frame(&self, index: usize) -> &[f64] {
        let d = self.dimension();
        &self.positions[index * d..(index + 1) * d]
    }

    /// The frames at these 0-based indices, in this order; panics when one does not exist, as a slice does.
    pub fn select(&self, indices: &[usize]) -> Result<Self, SequenceError> {
        let positions = indices
            .iter()
            .flat_map(|&i| self.frame(i))
            .copied()
            .collect();
        Self::new(self.connectivity.clone(), indices.len(), positions)
    }
}
