//! File formats of sequences: OBJ frames, NPZ and PC2.
//!
//! | path | what it holds |
//! |---|---|
//! | a folder, a pattern `dir/mesh_*.obj`, one `.obj` | OBJ frames in natural order (frame 2 before frame 10), f64 |
//! | `.npz` | numpy arrays `V` (n, V, 3) of f64 or f32 and `F` (F, 3) of 0-based integers |
//! | `.pc2` | positions in f32, and beside it an OBJ with the faces |
//!
//! Files come from strangers: sizes in a header are held against the file before memory is reserved, nothing is repaired,
//! and every refusal says where and what to do. Writing leaves the whole result or nothing.

mod bytes;
mod error;
mod files;
mod natural;
pub mod npz;
mod obj;
mod pc2;
pub mod peer_tobj;
pub mod stream;
mod writer;

use std::path::{Path, PathBuf};

use self::stream::FrameStream;
use super::Sequence;
pub use error::FormatError;
pub use files::frame_files;
use files::has_extension;
pub use natural::compare as natural_order;
pub use obj::ObjProblem;
pub use writer::FrameWriter;

/// Reads the sequence at `path`; see the table above and [`frame_files`].
///
/// Positions arrive in the file's own vertex order: from OBJ correctly rounded to f64, from f32 files widened. All frames
/// must have the same vertex count and the same triangles in the same order.
pub fn read(path: &Path) -> Result<Sequence, FormatError> {
    if !path.is_dir() {
        if has_extension(path, "npz") {
            return npz::read(path);
        }
        if has_extension(path, "pc2") {
            return pc2::read(path);
        }
    }
    obj::read(&frame_files(path)?)
}

/// Opens what [`read`] reads, to be read some frames at a time; see [`FrameStream`].
///
/// What is wrong with a frame is told when it is read.
pub fn stream(path: &Path) -> Result<FrameStream, FormatError> {
    if !path.is_dir() {
        if has_extension(path, "npz") {
            return npz::stream(path);
        }
        if has_extension(path, "pc2") {
            let cache = pc2::Cache::open(path)?;
            let (connectivity, frames) = (cache.connectivity.clone(), cache.frames);
            return FrameStream::new(path, connectivity, frames, Box::new(cache));
        }
    }
    obj::stream(path, frame_files(path)?)
}

/// The files that [`read`] reads for `path`. Reads names only, no contents.
pub fn source_files(path: &Path) -> Result<Vec<PathBuf>, FormatError> {
    if !path.is_dir() {
        if has_extension(path, "npz") {
            return Ok(vec![path.into()]);
        }
        if has_extension(path, "pc2") {
            return Ok(vec![path.into(), pc2::companion(path)?]);
        }
    }
    frame_files(path)
}

/// The file or folder that [`write()`] makes of `path`, and the mesh beside it where there is one.
pub fn written_files(path: &Path) -> Vec<PathBuf> {
    let beside = has_extension(path, "pc2").then(|| path.with_extension("obj"));
    [path.into()].into_iter().chain(beside).collect()
}

/// Reads OBJ files as the frames of one sequence, in this order.
pub fn read_files(paths: &[PathBuf]) -> Result<Sequence, FormatError> {
    obj::read(paths)
}

/// Writes `sequence` to `path`, in the format its ending names: `.npz` and OBJ keep every bit, `.pc2` rounds to f32.
///
/// - `.npz`: arrays `V` (n, V, 3) of f64 and `F` (F, 3) of int64, 0-based;
/// - `.pc2`: with the first frame and the faces beside it in the `.obj` of the same stem;
/// - `.obj`: one file, for a sequence of one frame;
/// - otherwise a folder of `0001.obj`, `0002.obj`, ... which may exist when it is empty.
///
/// Everything is written under a temporary name in the same folder and then renamed, so that a full disk or a missing
/// permission leaves what was there before. An existing file is replaced. The same sequence always
/// gives the same bytes.
pub fn write(sequence: &Sequence, path: &Path) -> Result<(), FormatError> {
    let frames = sequence.frame_count();
    let mut writer = FrameWriter::create(path, sequence.connectivity(), frames)?;
    writer.push(sequence.positions())?;
    writer.finish()
}
