//! OBJ files: one frame a file, in the file's own vertex order and in f64.
//!
//! General OBJ libraries renumber vertices, drop unused ones or hold f32, which a sequence cannot bear; hence this reader.
//! What is understood:
//!
//! - `v x y z`, then up to four more numbers (weight or colour), which are ignored; numbers are correctly rounded;
//! - `f` with corners `v`, `v/t`, `v//n`, `v/t/n`, counted from 1 or, when negative, back from the last vertex so far;
//!   polygons become the fan of triangles around their first corner; `t` and `n` are ignored and may be empty;
//! - comments, also behind a statement; LF, CR LF and CR; leading blanks; `\` before a line end continues `v` and `f`
//!   between two numbers; a byte order mark. Every other keyword is ignored, and text need not be UTF-8 there.
//!
//! Nothing is repaired: duplicate vertices and faces, degenerate faces and unreferenced vertices stay.

mod cursor;
mod parse;
mod problem;
mod write;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::bytes;
use super::error::FormatError;
use crate::mesh::Connectivity;
use crate::sequence::Sequence;
use crate::sequence::format::stream::{FrameStream, Source};
use parse::{Fault, Summary, Visitor};
pub use problem::ObjProblem;
pub(super) use write::{FolderWriter, write_frame};

/// The fewest bytes a vertex takes: `v 0 0 0` and a line end, which the last line may lack.
const BYTES_PER_VERTEX: u64 = 8;

/// Reads frames over one connectivity, in the order of `paths`; the first defines it, the others must repeat it.
///
/// Files are read in parallel, each parsed in place into its own part of the one n x 3V buffer. Of several faulty frames
/// the first is reported. Memory: the result, the first file, and one file a thread.
pub(super) fn read(paths: &[PathBuf]) -> Result<Sequence, FormatError> {
    let Some(path) = paths.first() else {
        return Err(FormatError::NoFrames {
            path: PathBuf::new(),
        });
    };
    let (first, frame) = First::read(path)?;
    let positions = match paths.len() {
        1 => frame,
        _ => read_frames(paths, &first, &frame)?,
    };
    let connectivity = first.connectivity()?;
    Sequence::new(connectivity, paths.len(), positions).map_err(|source| FormatError::Sequence {
        path: path.clone(),
        source,
    })
}

fn read_frames(paths: &[PathBuf], first: &First, frame: &[f64]) -> Result<Vec<f64>, FormatError> {
    // Before n x 3V numbers are reserved, every file must be long enough to hold its V vertices.
    for (at, path) in paths.iter().enumerate().skip(1) {
        if bytes::size(path)? + 1 < BYTES_PER_VERTEX * first.vertices {
            first.compare(at + 1, path, &mut Vec::new(), &mut [])?;
        }
    }
    let mut positions = vec![0.0; paths.len() * frame.len()];
    let (head, tail) = positions.split_at_mut(frame.len());
    head.copy_from_slice(frame);
    let results: Vec<_> = tail
        .par_chunks_exact_mut(frame.len())
        .zip(paths[1..].par_iter())
        .enumerate()
        .map_init(Vec::new, |buffer, (at, (out, path))| {
            first.compare(at + 2, path, buffer, out)
        })
        .collect();
    results.into_iter().collect::<Result<(), _>>()?;
    Ok(positions)
}

/// Opens OBJ files as the frames of one sequence, of which the first is read to know the connectivity; `path` is what named them.
pub(super) fn stream(path: &Path, paths: Vec<PathBuf>) -> Result<FrameStream, FormatError> {
    let Some(file) = paths.first() else {
        return Err(FormatError::NoFrames {
            path: path.to_path_buf(),
        });
    };
    let (first, _) = First::read(file)?;
    let connectivity = first.connectivity()?;
    let frames = paths.len();
    FrameStream::new(path, connectivity, frames, Box::new(Files { first, paths }))
}

/// OBJ files that are read on demand, those that are asked for together in parallel.
struct Files {
    first: First,
    paths: Vec<PathBuf>,
}

impl Source for Files {
    fn read(&mut self, first: usize, count: usize) -> Result<Vec<f64>, FormatError> {
        let d = self.first.vertices as usize * 3;
        let mut positions = vec![0.0; count * d];
        let results: Vec<_> = positions
            .par_chunks_exact_mut(d)
            .zip(self.paths[first..first + count].par_iter())
            .enumerate()
            .map_init(Vec::new, |buffer, (at, (out, path))| {
                self.first.compare(first + at + 1, path, buffer, out)
            })
            .collect();
        results.into_iter().collect::<Result<(), _>>()?;
        Ok(positions)
    }
}

/// The first frame, with which the others must agree.
struct First {
    path: PathBuf,
    vertices: u64,
    triangles: Vec<[u32; 3]>,
    /// The file's last bytes, from its first face on, if they mean the same triangles at the end of any frame.
    faces_text: Option<Vec<u8>>,
}

impl First {
    fn read(path: &Path) -> Result<(Self, Vec<f64>), FormatError> {
        let mut buffer = Vec::new();
        bytes::read_into(path, &mut buffer)?;
        let mut mesh = Mesh::default();
        let summary = parse_frame(&buffer, &mut mesh, path, 1)?;
        let faces_text = reusable_faces(&summary).map(|at| buffer.split_off(at));
        let first = Self {
            path: path.to_path_buf(),
            vertices: summary.vertices,
            triangles: mesh.triangles,
            faces_text,
        };
        Ok((first, mesh.positions))
    }

    fn connectivity(&self) -> Result<Arc<Connectivity>, FormatError> {
        match Connectivity::new(self.vertices as usize, self.triangles.clone()) {
            Ok(connectivity) => Ok(Arc::new(connectivity)),
            Err(source) => Err(FormatError::Connectivity {
                path: self.path.clone(),
                source,
            }),
        }
    }

    /// Reads another frame's positions into `out` (3V numbers) and holds its connectivity against the first's.
    fn compare(
        &self,
        frame: usize,
        path: &Path,
        buffer: &mut Vec<u8>,
        out: &mut [f64],
    ) -> Result<(), FormatError> {
        bytes::read_into(path, buffer)?;
        if self.ends_alike(buffer, out) {
            return Ok(());
        }
        let mut seen = Frame::new(out, &self.triangles);
        let found = parse_frame(buffer, &mut seen, path, frame)?.vertices;
        self.judge(found, &seen, frame, path)
    }

    /// The fast path: the text of the faces is the first frame's, byte for byte, and V vertices stand before it.
    ///
    /// Anything out of the ordinary is left to the full pass, which also knows where to point.
    fn ends_alike(&self, bytes: &[u8], out: &mut [f64]) -> bool {
        let head = self
            .faces_text
            .as_ref()
            .and_then(|t| bytes.strip_suffix(&t[..]));
        let Some(head) = head.filter(|h| matches!(h.last(), Some(b'\n' | b'\r'))) else {
            return false;
        };
        let mut seen = Frame::new(out, &[]);
        parse::parse(head, &mut seen)
            .is_ok_and(|summary| summary.first_face.is_none() && summary.vertices == self.vertices)
    }

    fn judge(
        &self,
        found: u64,
        seen: &Frame,
        frame: usize,
        path: &Path,
    ) -> Result<(), FormatError> {
        let (path, first) = (path.to_path_buf(), self.path.clone());
        if found != self.vertices {
            return Err(FormatError::VertexCount {
                path,
                frame,
                found,
                expected: self.vertices,
                first,
            });
        }
        if let Some((face, found, line)) = seen.differs {
            return Err(FormatError::FaceDiffers {
                path,
                frame,
                line,
                face,
                found,
                expected: self.triangles[face],
                first,
            });
        }
        if seen.triangles != self.triangles.len() {
            return Err(FormatError::FaceCount {
                path,
                frame,
                found: seen.triangles,
                expected: self.triangles.len(),
                first,
            });
        }
        Ok(())
    }
}

/// Where the faces start, if nothing behind them depends on what stands before them.
fn reusable_faces(summary: &Summary) -> Option<usize> {
    match summary.vertex_after_face || summary.relative {
        true => None,
        false => summary.first_face,
    }
}

fn parse_frame(
    bytes: &[u8],
    visitor: &mut impl Visitor,
    path: &Path,
    frame: usize,
) -> Result<Summary, FormatError> {
    let path = path.to_path_buf();
    if bytes.is_empty() {
        return Err(FormatError::Empty { path, frame });
    }
    match parse::parse(bytes, visitor) {
        Ok(summary) if summary.vertices == 0 => Err(FormatError::NoVertices { path, frame }),
        Ok(summary) => Ok(summary),
        Err(Fault {
            line,
            column,
            problem,
        }) => Err(FormatError::Obj {
            path,
            frame,
            line,
            column,
            problem,
        }),
    }
}

/// Keeps everything: the first frame.
#[derive(Default)]
struct Mesh {
    positions: Vec<f64>,
    triangles: Vec<[u32; 3]>,
}

impl Visitor for Mesh {
    fn vertex(&mut self, position: [f64; 3]) {
        self.positions.extend(position);
    }

    fn triangle(&mut self, corners: [u32; 3], _: usize) {
        self.triangles.push(corners);
    }
}

/// Keeps the positions of a later frame and compares its triangles as they come.
struct Frame<'a> {
    out: std::slice::ChunksExactMut<'a, f64>,
    expected: &'a [[u32; 3]],
    triangles: usize,
    /// The first triangle that differs: its index, its corners and its line.
    differs: Option<(usize, [u32; 3], usize)>,
}

impl<'a> Frame<'a> {
    fn new(out: &'a mut [f64], expected: &'a [[u32; 3]]) -> Self {
        Self {
            out: out.chunks_exact_mut(3),
            expected,
            triangles: 0,
            differs: None,
        }
    }
}

impl Visitor for Frame<'_> {
    #[inline]
    fn vertex(&mut self, position: [f64; 3]) {
        // A vertex too many has no place; it is counted, and the frame refused, by who asked for the pass.
        if let Some(place) = self.out.next() {
            place.copy_from_slice(&position);
        }
    }

    #[inline]
    fn triangle(&mut self, corners: [u32; 3], line: usize) {
        let expected = self.expected.get(self.triangles);
        if self.differs.is_none() && expected.is_some_and(|e| *e != corners) {
            self.differs = Some((self.triangles, corners, line));
        }
        self.triangles += 1;
    }
}

#[cfg(test)]
mod tests;
