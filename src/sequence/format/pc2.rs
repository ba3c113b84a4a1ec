//! PC2 point caches: positions in f32 and no faces, so an OBJ stands beside them.
//!
//! The file is little-endian: `POINTCACHE2\0`, i32 version (1), i32 vertices V, f32 start frame, f32 sampling rate, i32
//! frames n; then n x V x 3 f32. It must have exactly that length. Start and rate are ignored, and written as 0 and 1.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::bytes::{self, Draft};
use super::error::FormatError;
use super::files::frame_files;
use super::obj;
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
use crate::sequence::format::stream::Source;

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER: usize = 32;

/// Reads the cache at `path` and the faces from the OBJ of the same stem or, without one, the only OBJ in the folder.
/// Of that OBJ only the faces and the vertex count are used.
pub(super) fn read(path: &Path) -> Result<Sequence, FormatError> {
    let mut cache = Cache::open(path)?;
    let positions = cache.read(0, cache.frames)?;
    Sequence::new(cache.connectivity, cache.frames, positions).map_err(|source| {
        FormatError::Sequence {
            path: path.to_path_buf(),
            source,
        }
    })
}

/// An open cache, whose frames are read on demand.
pub(super) struct Cache {
    path: PathBuf,
    file: File,
    pub(super) connectivity: Arc<Connectivity>,
    pub(super) frames: usize,
}

impl Cache {
    pub(super) fn open(path: &Path) -> Result<Self, FormatError> {
        let (mut file, size) = bytes::open(path)?;
        let mut header = [0; HEADER];
        if size < HEADER as u64 {
            return Err(wrong_size(path, "header".into(), HEADER as u128, size));
        }
        file.read_exact(&mut header)
            .map_err(|e| FormatError::reading(path, e))?;
        let (frames, vertices) = parse_header(path, &header)?;
        let expected = HEADER as u128 + frames as u128 * vertices as u128 * 12;
        if expected != size.into() {
            let what = format!("header says {frames} frames of {vertices} vertices");
            return Err(wrong_size(path, what, expected, size));
        }
        let beside = obj::read(&[companion(path)?])?;
        let connectivity = beside.connectivity().clone();
        if connectivity.vertex_count() != vertices {
            return Err(FormatError::VertexCount {
                path: path.to_path_buf(),
                frame: 1,
                found: vertices as u64,
                expected: connectivity.vertex_count() as u64,
                first: companion(path)?,
            });
        }
        Ok(Self {
            path: path.to_path_buf(),
            file,
            connectivity,
            frames,
        })
    }
}

impl Source for Cache {
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError> {
        let d = self.connectivity.vertex_count() * 3;
        let at = HEADER as u64 + first as u64 * d as u64 * 4;
        let sought = self.file.seek(SeekFrom::Start(at));
        sought.map_err(|e| FormatError::reading(&self.path, e))?;
        read_floats(&self.path, &mut self.file, count * d)
    }
}

fn wrong_size(path: &Path, what: String, expected: u128, found: u64) -> FormatError {
    FormatError::Size {
        path: path.to_path_buf(),
        what,
        expected,
        found,
    }
}

/// The numbers of frames and of vertices.
fn parse_header(path: &Path, header: &[u8; HEADER]) -> Result<(usize, usize), FormatError> {
    let refuse = |reason: String| FormatError::Pc2 {
        path: path.to_path_buf(),
        reason,
    };
    let field =
        |at| i32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    if !header.starts_with(MAGIC) {
        return Err(refuse(
            "expected a PC2 file, which starts with POINTCACHE2".into(),
        ));
    }
    if field(12) != 1 {
        return Err(refuse(format!("PC2 version {}, expected 1", field(12))));
    }
    let (vertices, frames) = (field(16), field(28));
    if vertices < 1 || frames < 1 {
        let reason = format!(
            "header says {frames} frames of {vertices} vertices, expected at least one of each"
        );
        return Err(refuse(reason));
    }
    Ok((frames as usize, vertices as usize))
}

/// The OBJ with the faces: of the same stem, or else the only one of the folder.
pub(super) fn companion(path: &Path) -> Result<PathBuf, FormatError> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let found = match frame_files(folder.unwrap_or(Path::new("."))) {
        Err(FormatError::NoFrames { .. }) => Vec::new(),
        found => found?,
    };
    let same_stem = found.iter().find(|p| p.file_stem() == path.file_stem());
    match (same_stem, &found[..]) {
        (Some(one), _) | (None, [one]) => Ok(one.clone()),
        _ => Err(FormatError::Pc2 {
            path: path.to_path_buf(),
            reason: format!(
                "PC2 holds no faces and the folder holds {} .obj files; put an OBJ of the same name beside it",
                found.len()
            ),
        }),
    }
}

fn read_floats(path: &Path, file: &mut impl Read, count: usize) -> Result<Vec<f64>, FormatError> {
    let mut floats = Vec::new();
    floats
        .try_reserve_exact(count)
        .map_err(|_| FormatError::OutOfMemory {
            path: path.to_path_buf(),
            bytes: count as u64 * 8,
        })?;
    let mut chunk = vec![0; 1 << 16];
    while floats.len() < count {
        let part = chunk.len().min((count - floats.len()) * 4);
        file.read_exact(&mut chunk[..part])
            .map_err(|e| FormatError::reading(path, e))?;
        let (words, _) = chunk[..part].as_chunks::<4>();
        floats.extend(words.iter().map(|&w| f64::from(f32::from_le_bytes(w))));
    }
    Ok(floats)
}

/// A cache and beside it the OBJ of the same stem, with the first frame and the faces.
///
/// That OBJ is replaced when it has the same vertex count and faces; any other is left alone and refused. Positions are
/// rounded to f32; one too large for that is refused.
pub(super) struct Writer {
    connectivity: Arc<Connectivity>,
    cache: Draft,
    /// Once the first frame is known.
    mesh: Option<Draft>,
}

impl Writer {
    pub(super) fn create(
        path: &Path,
        connectivity: Arc<Connectivity>,
        frames: usize,
    ) -> Result<Self, FormatError> {
        let header = header(path, connectivity.vertex_count(), frames)?;
        refuse_foreign_mesh(&connectivity, &path.with_extension("obj"))?;
        Ok(Self {
            cache: Draft::write(path, |out| out.write_all(&header))?,
            mesh: None,
            connectivity,
        })
    }

    /// Where the cache is to go in the end.
    pub(super) fn path(&self) -> &Path {
        self.cache.path()
    }

    /// Frames of 3V positions, of which the first is number `from` (0-based).
    pub(super) fn push(&mut self, positions: &[f64], from: usize) -> Result<(), FormatError> {
        let d = self.connectivity.vertex_count() * 3;
        if let Some(at) = positions.iter().position(|&x| !(x as f32).is_finite()) {
            let reason = format!(
                "frame {} (1-based), vertex {} (0-based): {} is too large for f32; write a .npz",
                from + at / d + 1,
                at % d / 3,
                positions[at]
            );
            return Err(cannot_hold(self.path(), reason));
        }
        if self.mesh.is_none() && !positions.is_empty() {
            let beside = self.path().with_extension("obj");
            let frame = &positions[..d];
            let mesh = Draft::write(&beside, |out| {
                obj::write_frame(frame, &self.connectivity, out)
            });
            self.mesh = Some(mesh?);
        }
        for chunk in positions.chunks(1 << 12) {
            let floats = chunk.iter().flat_map(|&x| (x as f32).to_le_bytes());
            let written = self.cache.write_all(&floats.collect::<Vec<u8>>());
            written.map_err(|e| FormatError::writing(self.path(), e))?;
        }
        Ok(())
    }

    /// Gives both files their names.
    pub(super) fn finish(mut self) -> Result<(), FormatError> {
        let flushed = self.cache.flush();
        flushed.map_err(|e| FormatError::writing(self.path(), e))?;
        self.mesh.map_or(Ok(()), Draft::keep)?;
        self.cache.keep()
    }
}

fn cannot_hold(path: &Path, reason: String) -> FormatError {
    FormatError::CannotHold {
        path: path.to_path_buf(),
        reason,
    }
}

fn header(path: &Path, vertices: usize, frames: usize) -> Result<Vec<u8>, FormatError> {
    let [Ok(vertices), Ok(frames)] = [vertices, frames].map(i32::try_from) else {
        let reason = "PC2 counts in 32 bits; write a .npz".into();
        return Err(cannot_hold(path, reason));
    };
    let mut header = MAGIC.to_vec();
    header.extend(1i32.to_le_bytes());
    header.extend(vertices.to_le_bytes());
    header.extend(0f32.to_le_bytes());
    header.extend(1f32.to_le_bytes());
    header.extend(frames.to_le_bytes());
    Ok(header)
}

fn refuse_foreign_mesh(connectivity: &Connectivity, path: &Path) -> Result<(), FormatError> {
    if !path.exists() {
        return Ok(());
    }
    match obj::read(&[path.to_path_buf()]) {
        Ok(there) if **there.connectivity() == *connectivity => Ok(()),
        _ => Err(FormatError::WouldOverwrite {
            path: path.to_path_buf(),
            reason: "the OBJ with the faces of a PC2 goes here, but this one holds another mesh"
                .into(),
        }),
    }
}
