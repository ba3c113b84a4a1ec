//! Frames as OBJ files that read back to the same bits.

use std::io::{self, Write};
use std::path::Path;

use rayon::prelude::*;

use crate::sequence::Sequence;
use crate::sequence::format::bytes;
use crate::sequence::format::error::FormatError;

/// Writes a folder of `0001.obj`, `0002.obj`, ... (more digits from 10 000 frames on), whole or not at all.
pub(in crate::sequence::format) fn write_frames(
    sequence: &Sequence,
    path: &Path,
) -> Result<(), FormatError> {
    let faces = faces_text(sequence);
    let digits = sequence.frame_count().to_string().len().max(4);
    bytes::write_folder(path, |folder| {
        let results: Vec<_> = (0..sequence.frame_count())
            .into_par_iter()
            .map_init(Vec::new, |buffer, frame| {
                let name = format!("{:0digits$}.obj", frame + 1);
                buffer.clear();
                vertices_text(buffer, sequence.frame(frame))
                    .and_then(|()| buffer.write_all(&faces))
                    .and_then(|()| std::fs::write(folder.join(&name), &buffer))
                    .map_err(|e| FormatError::writing(&path.join(name), e))
            })
            .collect();
        results.into_iter().collect()
    })
}

/// Writes one frame (0-based, which must exist) and the faces.
pub(in crate::sequence::format) fn write_frame(
    sequence: &Sequence,
    frame: usize,
    out: &mut impl Write,
) -> io::Result<()> {
    vertices_text(out, sequence.frame(frame))?;
    out.write_all(&faces_text(sequence))
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

fn faces_text(sequence: &Sequence) -> Vec<u8> {
    let mut text = Vec::new();
    for corners in sequence.connectivity().faces() {
        let [a, b, c] = corners.map(|v| u64::from(v) + 1);
        text.extend_from_slice(format!("f {a} {b} {c}\n").as_bytes());
    }
    text
}
