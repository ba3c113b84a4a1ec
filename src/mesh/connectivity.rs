//! The triangles of a mesh, validated once.

use thiserror::Error;

/// Which vertices make up each triangle. Indices are 0-based and known to be in range.
///
/// Nothing is repaired: degenerate, duplicate and non-manifold faces and unreferenced vertices are kept as they are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connectivity {
    vertex_count: usize,
    faces: Vec<[u32; 3]>,
}

/// Why a list of triangles is not a connectivity.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ConnectivityError {
    /// A face names a vertex that does not exist.
    #[error(
        "face {face} (0-based) refers to vertex {index} (0-based), but there are only {vertex_count} vertices; \
         check that the faces belong to these vertices"
    )]
    IndexOutOfRange {
        face: usize,
        index: u64,
        vertex_count: usize,
    },
    /// More vertices than a 32-bit index can name.
    #[error("{vertex_count} vertices are more than 32-bit indices can name ({max}); split the mesh", max = u32::MAX)]
    TooManyVertices { vertex_count: usize },
}

impl Connectivity {
    /// Validates `faces` (0-based vertex indices) against the number of vertices. Costs one pass.
    pub fn new(vertex_count: usize, faces: Vec<[u32; 3]>) -> Result<Self, ConnectivityError> {
        if vertex_count > u32::MAX as usize {
            return Err(ConnectivityError::TooManyVertices { vertex_count });
        }
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&index) = corners.iter().find(|&&v| v as usize >= vertex_count) {
                return Err(ConnectivityError::IndexOutOfRange {
                    face,
                    index: index.into(),
                    vertex_count,
                });
            }
        }
        Ok(Self {
            vertex_count,
            faces,
        })
    }

    /// Number of vertices V, referenced or not.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// The triangles, F x 3, 0-based.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }
}
