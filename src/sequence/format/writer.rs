//! Sequences written some frames at a time, so that memory holds only those.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use super::bytes::Draft;
use super::error::FormatError;
use super::files::has_extension;
use super::{npz, obj, pc2};
use crate::arrays::Array;
use crate::mesh::Connectivity;
use crate::sequence::{SequenceError, first_not_finite};

/// Endings that ask for something else than a folder of this name.
const OTHER_FORMATS: [&str; 18] = [
    "abc", "bin", "csv", "fbx", "glb", "gltf", "html", "json", "mdd", "npy", "off", "ply", "stl",
    "txt", "usd", "usda", "usdc", "zip",
];

/// A sequence on disk that has not got its name yet; dropping it removes it.
///
/// The bytes are those of [`super::write`], however many frames come at a time. OBJ frames that come together are written in parallel.
pub struct FrameWriter {
    connectivity: Arc<Connectivity>,
    frames: usize,
    written: usize,
    sink: Sink,
}

/// What takes the frames.
enum Sink {
    Npz(npz::Writer),
    Pc2(pc2::Writer),
    Single(Draft),
    Folder(obj::FolderWriter),
}

impl FrameWriter {
    /// For `frames` frames over one connectivity, in the format that the ending of `path` names; see [`super::write`].
    pub fn create(
        path: &Path,
        connectivity: &Arc<Connectivity>,
        frames: usize,
    ) -> Result<Self, FormatError> {
        let has = |extension| has_extension(path, extension);
        let sink = if has("npz") {
            Sink::Npz(begin_npz(path, connectivity, frames)?)
        } else if has("pc2") {
            Sink::Pc2(pc2::Writer::create(path, connectivity.clone(), frames)?)
        } else if has("obj") {
            Sink::Single(begin_single(path, frames)?)
        } else if OTHER_FORMATS.iter().any(|e| has(e)) {
            return Err(FormatError::Unsupported {
                path: path.to_path_buf(),
            });
        } else {
            Sink::Folder(obj::FolderWriter::create(path, connectivity, frames)?)
        };
        Ok(Self {
            connectivity: connectivity.clone(),
            frames,
            written: 0,
            sink,
        })
    }

    /// The next frames: 3V positions each, which must be finite.
    pub fn push(&mut self, positions: &[f64]) -> Result<(), FormatError> {
        let d = self.connectivity.vertex_count() * 3;
        let count = positions.len() / d.max(1);
        if count * d != positions.len() || self.written + count > self.frames {
            return Err(self.wrong(SequenceError::WrongLength {
                frames: self.frames - self.written,
                vertices: self.connectivity.vertex_count(),
                expected: (self.frames - self.written) * d,
                found: positions.len(),
            }));
        }
        if let Some(source) = first_not_finite(positions, d, self.written) {
            return Err(self.wrong(source));
        }
        match &mut self.sink {
            Sink::Npz(out) => out.extend(positions),
            Sink::Pc2(out) => out.push(positions, self.written),
            Sink::Folder(out) => out.push(positions, self.written),
            Sink::Single(out) => {
                let written = obj::write_frame(positions, &self.connectivity, out);
                written.map_err(|e| FormatError::writing(out.path(), e))
            }
        }?;
        self.written += count;
        Ok(())
    }

    /// Gives the sequence its name, in place of what had it.
    pub fn finish(self) -> Result<(), FormatError> {
        if self.written != self.frames || self.frames == 0 {
            let d = self.connectivity.vertex_count() * 3;
            return Err(self.wrong(match self.frames {
                0 => SequenceError::NoFrames,
                _ => SequenceError::WrongLength {
                    frames: self.frames,
                    vertices: d / 3,
                    expected: self.frames * d,
                    found: self.written * d,
                },
            }));
        }
        match self.sink {
            Sink::Npz(mut out) => {
                add_faces(&mut out, &self.connectivity)?;
                out.finish()
            }
            Sink::Pc2(out) => out.finish(),
            Sink::Single(mut out) => {
                let flushed = out.flush();
                flushed.map_err(|e| FormatError::writing(out.path(), e))?;
                out.keep()
            }
            Sink::Folder(out) => out.finish(),
        }
    }

    fn wrong(&self, source: SequenceError) -> FormatError {
        let path = match &self.sink {
            Sink::Npz(out) => out.path(),
            Sink::Pc2(out) => out.path(),
            Sink::Single(out) => out.path(),
            Sink::Folder(out) => out.path(),
        };
        FormatError::Sequence {
            path: path.to_path_buf(),
            source,
        }
    }
}

/// `V` (n, V, 3) of f64, and behind it `F` (F, 3) of int64, 0-based.
fn begin_npz(
    path: &Path,
    connectivity: &Connectivity,
    frames: usize,
) -> Result<npz::Writer, FormatError> {
    let mut out = npz::Writer::create(path)?;
    out.begin("V", &[frames, connectivity.vertex_count(), 3])?;
    Ok(out)
}

fn add_faces(out: &mut npz::Writer, connectivity: &Connectivity) -> Result<(), FormatError> {
    out.add("F", (&Array::triangles(connectivity.faces())).into())
}

fn begin_single(path: &Path, frames: usize) -> Result<Draft, FormatError> {
    match frames {
        1 => Draft::create(path),
        _ => Err(FormatError::CannotHold {
            path: path.to_path_buf(),
            reason: format!(
                "an OBJ file holds one frame, this sequence has {frames}; name a folder, a .npz or a .pc2"
            ),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::dataset::open;
    use crate::sequence::format::{read, write};

    #[test]
    fn frames_written_some_at_a_time_read_back_to_the_same_bits() {
        let sequence = open("@gallop-small").unwrap();
        let (n, d) = (sequence.frame_count(), sequence.dimension());
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.npz", "a.pc2", "a"] {
            let [whole, parts] = ["whole", "parts"].map(|under| {
                std::fs::create_dir_all(folder.path().join(under)).unwrap();
                folder.path().join(under).join(name)
            });
            write(&sequence, &whole).unwrap();
            let mut writer = FrameWriter::create(&parts, sequence.connectivity(), n).unwrap();
            for some in sequence.positions().chunks(7 * d) {
                writer.push(some).unwrap();
            }
            assert!(writer.push(sequence.frame(0)).is_err());
            writer.finish().unwrap();
            if whole.is_file() {
                assert_eq!(
                    std::fs::read(&whole).unwrap(),
                    std::fs::read(&parts).unwrap()
                );
            }
            let found = read(&parts).unwrap();
            assert_eq!(found.positions(), read(&whole).unwrap().positions());
            assert_eq!(found.connectivity(), sequence.connectivity());
        }
    }

    #[test]
    fn what_is_cut_short_or_not_finite_has_no_name() {
        let sequence = open("@gallop-small").unwrap();
        let folder = tempfile::tempdir().unwrap();
        for name in ["a.npz", "a.pc2", "a"] {
            let path = folder.path().join(name);
            let mut writer = FrameWriter::create(&path, sequence.connectivity(), 3).unwrap();
            writer
                .push(&sequence.positions()[..2 * sequence.dimension()])
                .unwrap();
            assert!(writer.push(&[0.0]).is_err());
            let mut bad = sequence.frame(2).to_vec();
            bad[4] = f64::NAN;
            let refused = writer.push(&bad).unwrap_err().to_string();
            assert!(refused.contains("frame 3 (1-based), vertex 1"), "{refused}");
            assert!(writer.finish().is_err());
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        }
    }
}
