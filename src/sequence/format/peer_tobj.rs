//! A second, independent reader of OBJ files, through the tobj crate: the harness measures what it sees and compares.
//!
//! Nothing of what tobj does is undone. So, compared with [`super::read`]:
//!
//! - **positions are f32**: area, volume and bounds agree to about 1e-7 relative;
//! - **vertices are renumbered** by first use in a face, and unreferenced ones are dropped: the vertex count is that of
//!   the referenced vertices, and bounds, components and the Euler characteristic leave out the others;
//! - triangles come in the same order with the same corner order, so they compare one by one by position;
//! - files split by `o`, `g` or `usemtl` are separate meshes there, joined here by concatenation: a vertex that several of
//!   them use is counted for each, and edges between them are boundary edges;
//! - `v x y z w` is divided by w; continued lines (`\`) and text that is not UTF-8 are not understood.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use thiserror::Error;
use tobj::{LoadError, LoadOptions};

/// One frame as tobj sees it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeerFrame {
    /// `x0 y0 z0 x1 ...` of the referenced vertices, in tobj's order.
    pub positions: Vec<f32>,
    /// 0-based indices into these vertices, in the order of the file; polygons are fans around their first corner.
    pub triangles: Vec<[u32; 3]>,
}

impl PeerFrame {
    /// Number of referenced vertices.
    pub fn vertex_count(&self) -> usize {
        self.positions.len() / 3
    }

    /// The positions of the corners of every triangle, in the order of the file.
    pub fn corner_positions(&self) -> impl Iterator<Item = [[f32; 3]; 3]> + '_ {
        let position = |v: u32| self.positions.as_chunks::<3>().0[v as usize];
        self.triangles.iter().map(move |t| t.map(position))
    }
}

/// Why tobj did not read a file.
#[derive(Debug, Error)]
#[error("{}: the tobj crate cannot read it: {reason}", .path.display())]
pub struct PeerError {
    path: PathBuf,
    reason: String,
}

/// Reads every file on its own; nothing is compared between frames. Files are read in parallel; of several errors the
/// first is given.
pub fn read_with_tobj(paths: &[PathBuf]) -> Result<Vec<PeerFrame>, PeerError> {
    let frames: Vec<_> = paths.par_iter().map(|path| read_frame(path)).collect();
    frames.into_iter().collect()
}

fn read_frame(path: &Path) -> Result<PeerFrame, PeerError> {
    let refuse = |reason: String| PeerError {
        path: path.to_path_buf(),
        reason,
    };
    let file = File::open(path).map_err(|e| refuse(e.to_string()))?;
    let options = LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..LoadOptions::default()
    };
    // Materials change no geometry; their files are not even opened.
    let no_material = |_: &Path| Err(LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(file), &options, no_material)
        .map_err(|e| refuse(e.to_string()))?;
    let mut frame = PeerFrame::default();
    for mesh in models.iter().map(|model| &model.mesh) {
        let before = frame.vertex_count() as u32;
        let triangles = mesh.indices.as_chunks::<3>().0;
        frame
            .triangles
            .extend(triangles.iter().map(|t| t.map(|v| v + before)));
        frame.positions.extend(&mesh.positions);
    }
    Ok(frame)
}
