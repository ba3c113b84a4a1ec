//! Frames as OBJ files that read back to the same bits.

use std::io::{self, Write};
use std::path::Path;

use rayon::prelude::*;

use crate::mesh::Connectivity;
use crate::sequence::format::bytes::FolderDraft;
use crate::sequence::format::error::FormatError;

/// A folder of `0001.obj`, `0002.obj`, ... (more digits from 10 000 frames on), whole or not at all.
pub(in crate::sequence::format) struct FolderWriter {
    draft: FolderDraft,
    faces: Vec<u8>,
    d: usize,
    digits: usize,
}

impl FolderWriter {
    pub(in crate::sequence::format) fn create(
        path: &Path,
        connectivity: &Connectivity,
        frames: usize,
    ) -> Result<Self, FormatError> {
        Ok(Self {
            draft: FolderDraft::create(path)?,
            faces: faces_text(connectivity),
            d: connectivity.vertex_count() * 3,
            digits: frames.to_string().len().max(4),
        })
    }

    /// Where the folder is to go in the end.
    pub(in crate::sequence::format) fn path(&self) -> &Path {
        self.draft.path()
    }

    /// Frames of 3V positions, of which the first is number `from` (0-based). In parallel.
    pub(in crate::sequence::format) fn push(
        &mut self,
        positions: &[f64],
        from: usize,
    ) -> Result<(), FormatError> {
        let digits = self.digits;
        let results: Vec<_> = positions
            .par_chunks_exact(self.d)
            .enumerate()
            .map_init(Vec::new, |buffer, (at, frame)| {
                let name = format!("{:0digits$}.obj", from + at + 1);
                buffer.clear();
                vertices_text(buffer, frame)
                    .and_then(|()| buffer.write_all(&self.faces))
                    .and_then(|()| std::fs::write(self.draft.folder().join(&name), &buffer))
                    .map_err(|e| FormatError::writing(&self.path().join(name), e))
            })
            .collect();
        results.into_iter().collect()
    }

    /// Gives the folder its name.
    pub(in crate::sequence::format) fn finish(self) -> Result<(), FormatError> {
        self.draft.keep()
    }
}

/// Writes one frame (3V positions) and the faces.
pub(in crate::sequence::format) fn write_frame(
    frame: &[f64],
    connectivity: &Connectivity,
    out: &mut impl Write,
) -> io::Result<()> {
    vertices_text(out, frame)?;
    out.write_all(&faces_text(connectivity))
}

/// The shortest digits that read back to the same double.
fn vertices_text(out: &mut impl Write, frame: &[f64]) -> io::Result<()> {
    for position in frame.chunks_exact(3) {
        writeln!(
            out,
            "v {:?} {:?} {:?}",
            position[0], position[1], position[2]
        )?;
    }
    Ok(())
}

fn faces_text(connectivity: &Connectivity) -> Vec<u8> {
    let mut text = Vec::new();
    for corners in connectivity.faces() {
        let [a, b, c] = corners.map(|v| u64::from(v) + 1);
        text.extend_from_slice(format!("f {a} {b} {c}\n").as_bytes());
    }
    text
}
