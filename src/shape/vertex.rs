//! The vertex space: a frame's positions themselves, d = 3V.

use super::reference::{check, check_len};
use super::{ShapeError, Space, SpaceKind};

/// R^3V.
#[derive(Clone, Debug)]
pub struct VertexSpace {
    dimension: usize,
}

impl VertexSpace {
    /// Of meshes of this many vertices.
    pub fn new(vertex_count: usize) -> Self {
        Self {
            dimension: 3 * vertex_count,
        }
    }
}

impl Space for VertexSpace {
    fn kind(&self) -> SpaceKind {
        SpaceKind::Vertex
    }

    fn dimension(&self) -> usize {
        self.dimension
    }

    fn frame_len(&self) -> usize {
        self.dimension
    }

    fn encode(&self, positions: &[f64], z: &mut [f64]) -> Result<(), ShapeError> {
        check("frame", positions, self.dimension)?;
        check_len("z", z, self.dimension)?;
        z.copy_from_slice(positions);
        Ok(())
    }

    fn decode(&self, z: &[f64], positions: &mut [f64]) -> Result<(), ShapeError> {
        check("z", z, self.dimension)?;
        check_len("frame", positions, self.dimension)?;
        positions.copy_from_slice(z);
        Ok(())
    }
}
